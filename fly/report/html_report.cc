#include "fly/report/html_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <numeric>

#include "engine/core/escape_html.h"
#include "engine/core/plain_number.h"
#include "fly/report/map_plot.h"
#include "fly/report/plot.h"

namespace terrace::fly {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

constexpr const char* kStyle = R"(<style>
:root{--ink:#1c2330;--soft:#5d6778;--page:#f4f5f7;--card:#fff;--rule:#d9dde4;--a:#2a6fb5;--b:#e0912f;--c:#3a9d6a;--d:#b9483f;--e:#8a93a3;--good:#23794c;--bad:#b3312c}
@media (prefers-color-scheme:dark){:root{--ink:#e8ebf0;--soft:#9aa5b5;--page:#14181f;--card:#1d232d;--rule:#343c49;--a:#6aa9e9;--b:#f0b060;--c:#62c493;--d:#e5776e;--e:#778194;--good:#62c493;--bad:#ee8179}}
body{font:15px/1.45 system-ui,sans-serif;color:var(--ink);background:var(--page);margin:0}
main{max-width:1340px;margin:0 auto;padding:28px 18px 60px}
h1{font-size:26px;margin:0 0 4px}h2{font-size:18px;margin:34px 0 10px}
.sub{color:var(--soft);margin:0 0 20px;overflow-wrap:anywhere}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(190px,1fr));gap:12px}
.card{background:var(--card);border:1px solid var(--rule);border-radius:8px;padding:12px 14px}
.card b{display:block;font-size:25px;font-weight:600;font-variant-numeric:tabular-nums}
.card span{color:var(--soft);font-size:13px}
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(460px,1fr));gap:14px}
figure{margin:0;background:var(--card);border:1px solid var(--rule);border-radius:8px;padding:12px 14px 6px}
.wide{grid-column:1/-1;margin-bottom:14px}
figcaption p{margin:2px 0 4px;color:var(--soft);font-size:13px}
.unit{color:var(--soft)}
.key{font-size:13px;color:var(--soft);margin-right:14px;white-space:nowrap}
.key i{display:inline-block;width:11px;height:11px;border-radius:2px;margin-right:5px}
.key i.mark{width:2px;background:var(--d)}
svg{width:100%;height:auto;display:block}
.grid{stroke:var(--rule);stroke-width:1}.tick{fill:var(--soft);font-size:11px}
.line{fill:none;stroke-width:1.8;stroke-linejoin:round}
line.limit{stroke:var(--ink);stroke-width:1;stroke-dasharray:5 4}text.limit{fill:var(--ink);font-size:11px}
line.mark{stroke:var(--d);stroke-width:2}
.map{background:#10141b;border-radius:4px}.map rect{fill-opacity:.55;stroke:#000;stroke-opacity:.55;stroke-width:.6}
.map rect:hover{fill-opacity:.95}
.map .halo{fill:none;stroke:#000;stroke-opacity:.6;stroke-width:6;stroke-linejoin:round}.map .track{fill:none;stroke:#fff;stroke-width:2.4;stroke-linejoin:round}
.map .start{fill:#fff;stroke:#000;stroke-width:1.5}.map .bar{fill:none;stroke:#fff;stroke-width:2}.map .tick{fill:#fff;font-size:13px}
table{border-collapse:collapse;background:var(--card);border:1px solid var(--rule);border-radius:8px}
td,th{padding:5px 14px;text-align:left;border-bottom:1px solid var(--rule);vertical-align:top}
td.n{text-align:right;font-variant-numeric:tabular-nums}
.good{color:var(--good)}.bad{color:var(--bad)}
.banner{border-left:5px solid;background:var(--card);padding:10px 16px;margin:0 0 18px;border-radius:4px}
.banner ul{margin:4px 0;padding-left:20px}
</style>)";

std::string Time(double seconds) {
  if (seconds < 0) return "never";
  if (seconds < 0.01) return fmt::format("{:.1f} ms", seconds * 1000);
  return seconds < 1 ? fmt::format("{:.0f} ms", seconds * 1000) : fmt::format("{:.2f} s", seconds);
}

std::vector<double> ValuesOf(const std::vector<Second>& seconds, double (*value)(const Second&)) {
  std::vector<double> values;
  std::transform(seconds.begin(), seconds.end(), std::back_inserter(values), value);
  return values;
}

void AddCard(const std::string& value, const std::string& name, bool is_bad, std::string& html) {
  fmt::format_to(std::back_inserter(html), R"(<div class="card"><b{}>{}</b><span>{}</span></div>)",
                 is_bad ? R"( class="bad")" : "", EscapeHtml(value), EscapeHtml(name));
}

std::string CardsOf(const Summary& summary) {
  const Totals& totals = summary.totals;
  std::string html = R"(<div class="cards">)";
  const bool is_one = summary.clients.size() == 1;
  AddCard(Time(summary.worst_first_view_s),
          is_one ? "until the first full view" : "until the first full view, slowest client",
          summary.worst_first_view_s < 0, html);
  AddCard(fmt::format("{:.1f} %", 100 * summary.refined_share), "of the frames fully refined",
          summary.refined_share < 0.75, html);
  AddCard(summary.frame_p99_px < 0 ? "not measured" : fmt::format("{:.1f} px", summary.frame_p99_px),
          "worst error on screen in 99 % of the frames", false, html);
  AddCard(fmt::format("{}", totals.hole_frames),
          fmt::format("frames with holes, of {} examined", totals.measured_frames), totals.hole_frames > 0, html);
  AddCard(Time(summary.p50_s), "p50 of a tile's latency", false, html);
  AddCard(Time(summary.p99_s), "p99 of a tile's latency", false, html);
  AddCard(fmt::format("{}", totals.tiles), fmt::format("tiles, {:.1f} a second", summary.tiles_per_second), false,
          html);
  AddCard(fmt::format("{:.2f} MB", static_cast<double>(totals.bytes) / 1e6), "received", false, html);
  AddCard(fmt::format("{:.2f} M", static_cast<double>(totals.triangles) / 1e6), "triangles", false, html);
  const auto refused = totals.outcomes[static_cast<std::size_t>(Outcome::kRefused)];
  AddCard(fmt::format("{}", summary.errors + refused), "requests failed or refused", summary.errors + refused > 0,
          html);
  return html + "</div>";
}

std::string BannerOf(const Summary& summary, const Judgements& judgements) {
  std::string html;
  const bool fails = !judgements.AllHold();
  if (!judgements.all.empty()) {
    html += fmt::format(R"(<div class="banner {0}"><b class="{0}">{1}</b><ul>)", fails ? "bad" : "good",
                        fails ? "Requirements failed" : "All requirements hold");
    for (const Judgement& judgement : judgements.all) {
      fmt::format_to(std::back_inserter(html), R"(<li class="{}">{}: {}</li>)", judgement.holds ? "good" : "bad",
                     EscapeHtml(judgement.requirement.text), EscapeHtml(judgement.shown));
    }
    html += "</ul></div>";
  }
  if (summary.findings.empty()) return html;
  html += R"(<div class="banner bad"><b>What is wrong</b><ul>)";
  for (const std::string& finding : summary.findings) html += "<li>" + EscapeHtml(finding) + "</li>";
  return html + "</ul></div>";
}

using Shape = Series::Shape;

TimePlot TilesPlot(const std::vector<Second>& seconds) {
  return {
      .title = "Tiles",
      .unit = "a second",
      .note = "Where the server had them, by Server-Timing.",
      .series = {
          {"in memory", "var(--c)", ValuesOf(seconds, [](auto& s) { return double(s.tiers[0]); }), Shape::kBars},
          {"lower tier", "var(--a)", ValuesOf(seconds, [](auto& s) { return double(s.tiers[1]); }), Shape::kBars},
          {"joined a build", "var(--b)", ValuesOf(seconds, [](auto& s) { return double(s.tiers[2]); }), Shape::kBars},
          {"built", "var(--d)", ValuesOf(seconds, [](auto& s) { return double(s.tiers[3]); }), Shape::kBars},
          {"not stated", "var(--e)", ValuesOf(seconds, [](auto& s) { return double(s.tiers[4]); }), Shape::kBars}}};
}

double LatencyMs(const Second& second, double share) {
  return second.latencies_s.empty() ? kNone : 1000 * Percentile(second.latencies_s, share);
}

TimePlot LatencyPlot(const std::vector<Second>& seconds) {
  return {.title = "Latency of tiles",
          .unit = "ms, logarithmic",
          .note = "From the first request of a tile to the last byte, of those that arrived.",
          .series = {{"p99", "var(--d)", ValuesOf(seconds, [](auto& s) { return LatencyMs(s, 0.99); })},
                     {"p50", "var(--a)", ValuesOf(seconds, [](auto& s) { return LatencyMs(s, 0.5); })}},
          .is_logarithmic = true};
}

double RefinedPercent(const Second& second) {
  return second.frames == 0 ? kNone : 100.0 * second.refined / second.frames;
}

TimePlot RefinedPlot(const std::vector<Second>& seconds) {
  return {.title = "Fully refined frames",
          .unit = "%",
          .note = "Frames that showed every tile that the view asks for.",
          .series = {{"refined", "var(--c)", ValuesOf(seconds, RefinedPercent), Shape::kArea}},
          .min_top = 100};
}

double PositiveOrNone(double value) { return value <= 0 ? kNone : value; }

TimePlot ErrorPlot(const FlightOptions& options, const std::vector<Second>& seconds) {
  return {
      .title = "Worst error on screen",
      .unit = "pixels, logarithmic",
      .note =
          "Assumed: of the levels, where a finer tile exists. Stated: of Terrain-Max-Error, on all tiles whose "
          "volume the camera is not in.",
      .series = {{"assumed", "var(--b)", ValuesOf(seconds, [](auto& s) { return PositiveOrNone(s.worst_px); })},
                 {"stated", "var(--a)", ValuesOf(seconds, [](auto& s) { return PositiveOrNone(s.worst_stated_px); })}},
      .is_logarithmic = true,
      .limit = options.select.max_error_px,
      .limit_name = "refined above"};
}

TimePlot QueuePlot(const std::vector<Second>& seconds) {
  return {.title = "Wanted and requested tiles",
          .unit = "most in a second, of one client",
          .note = "Wanted contains what is loaded ahead: siblings and ancestors.",
          .series = {{"wanted", "var(--b)", ValuesOf(seconds, [](auto& s) { return double(s.wanted); })},
                     {"open requests", "var(--a)", ValuesOf(seconds, [](auto& s) { return double(s.in_flight); })},
                     {"drawn", "var(--e)", ValuesOf(seconds, [](auto& s) { return double(s.drawn); })}}};
}

TimePlot BytesPlot(const std::vector<Second>& seconds) {
  return {
      .title = "Received",
      .unit = "kB a second",
      .note = "Heads and bodies as sent, compressed.",
      .series = {{"kB", "var(--a)", ValuesOf(seconds, [](auto& s) { return double(s.bytes) / 1000; }), Shape::kBars}}};
}

double FailuresOf(const Second& second) {
  return std::accumulate(second.outcomes.begin() + 2, second.outcomes.end(), 0.0);
}

TimePlot FailurePlot(const std::vector<Second>& seconds) {
  return {.title = "Refused and failed requests",
          .unit = "a second",
          .note = "The client asks again for refused ones when Retry-After says.",
          .series = {{"refused (429, 503)", "var(--b)",
                      ValuesOf(seconds, [](auto& s) { return double(s.outcomes[1]); }), Shape::kBars},
                     {"failed", "var(--d)", ValuesOf(seconds, FailuresOf), Shape::kBars}}};
}

BarPlot LevelPlot(const std::map<int, std::uint64_t>& counts) {
  BarPlot plot{.title = "Tiles by level",
               .unit = "count",
               .note = "Each is half as wide as the one before.",
               .series = {{"tiles", "var(--a)", {}, Shape::kBars}}};
  for (const auto& [level, count] : counts) {
    plot.labels.push_back(std::to_string(level));
    plot.series[0].values.push_back(static_cast<double>(count));
  }
  return plot;
}

BarPlot LatencyHistogram(const ValueCounts& latencies_s) {
  BarPlot plot{.title = "Latencies of all tiles",
               .unit = "count",
               .note = "Each class reaches up to its label.",
               .series = {{"tiles", "var(--a)", {}, Shape::kBars}}};
  constexpr double kBounds[] = {1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000};
  std::uint64_t below = 0;
  for (const double bound : kBounds) {
    const std::uint64_t count = latencies_s.CountUpTo(bound / 1000);
    plot.labels.push_back(bound < 1000 ? PlainNumber(bound) + " ms" : PlainNumber(bound / 1000) + " s");
    plot.series[0].values.push_back(static_cast<double>(count - below));
    below = count;
  }
  plot.labels.emplace_back("more");
  plot.series[0].values.push_back(static_cast<double>(latencies_s.size() - below));
  return plot;
}

std::string TablesOf(const Totals& totals) {
  std::string html = "<h2>Requests</h2><table>";
  for (std::size_t i = 0; i < kOutcomes; ++i) {
    if (i > 0 && totals.outcomes[i] == 0) continue;
    fmt::format_to(std::back_inserter(html), R"(<tr><td>{}</td><td class="n">{}</td></tr>)",
                   NameOf(static_cast<Outcome>(i)), totals.outcomes[i]);
  }
  fmt::format_to(
      std::back_inserter(html),
      R"(<tr><td>retries</td><td class="n">{}</td></tr><tr><td>connections opened</td><td class="n">{}</td></tr><tr><td>version changes</td><td class="n">{}</td></tr></table>)",
      totals.retries, totals.connections, totals.version_changes);
  if (totals.messages.empty()) return html;
  html += "<h2>Messages</h2><table>";
  for (const auto& [message, count] : totals.messages) {
    fmt::format_to(std::back_inserter(html), R"(<tr><td class="n">{}</td><td>{}</td></tr>)", count,
                   EscapeHtml(message));
  }
  return html + "</table>";
}

}  // namespace

std::string HtmlOf(const FlightOptions& options, const Summary& summary, const Judgements& judgements,
                   const FlightRecord& record) {
  const std::vector<Second>& seconds = record.seconds;
  std::string html =
      R"(<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">)";
  html +=
      "<title>Flight over " + EscapeHtml(options.document.PublicText()) + "</title>" + kStyle + "</head><body><main>";
  fmt::format_to(
      std::back_inserter(html),
      R"(<h1>Flight report</h1><p class="sub">{} &middot; {} client{} &middot; {:.1f} km path, {:.0f} s each &middot; {} x {} px, {}&deg;, refined above {} px</p>)",
      EscapeHtml(options.document.PublicText()), options.clients, options.clients == 1 ? "" : "s",
      options.path.length_m() / 1000, options.duration_s, options.lens.width_px, options.lens.height_px,
      PlainNumber(options.lens.field_of_view), PlainNumber(options.select.max_error_px));
  html += BannerOf(summary, judgements) + CardsOf(summary) + "<h2>The flight</h2>";
  html += MapOf(record.loaded_tiles, record.track) + R"(<div class="plots">)";
  std::vector<TimePlot> plots = {TilesPlot(seconds),          LatencyPlot(seconds), RefinedPlot(seconds),
                                 ErrorPlot(options, seconds), QueuePlot(seconds),   BytesPlot(seconds)};
  if (summary.errors + summary.totals.outcomes[static_cast<std::size_t>(Outcome::kRefused)] > 0)
    plots.push_back(FailurePlot(seconds));
  for (TimePlot& plot : plots) {
    plot.marks = record.version_changes;
    plot.marks_name = "new version of the dataset";
    html += SvgOf(plot);
  }
  html +=
      SvgOf(LatencyHistogram(summary.totals.latencies_s)) + SvgOf(LevelPlot(summary.totals.tiles_by_level)) + "</div>";
  return html + TablesOf(summary.totals) + "</main></body></html>\n";
}

}  // namespace terrace::fly
