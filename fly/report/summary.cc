#include "fly/report/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "engine/core/plain_number.h"

namespace terrace::fly {
namespace {

// The server keeps up if at most this share of the frames waits for tiles. It is above 0, because a moving view waits
// for its next tiles in some frames even if the server is fast.
constexpr double kMaxWaitingShare = 0.25;

constexpr float kNever = std::numeric_limits<float>::infinity();  // the last in order

double Share(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

std::string Milliseconds(double seconds) {
  const double ms = seconds * 1000;
  return ms < 10       ? fmt::format("{:.1f} ms", ms)
         : ms < 10'000 ? fmt::format("{:.0f} ms", ms)
                       : fmt::format("{:.1f} s", seconds);
}

std::string MillisecondsOrNever(double seconds) { return seconds < 0 ? "never" : Milliseconds(seconds); }

// Whether a client loaded tiles, or would have.
bool IsLoading(const Second& second) { return second.tiles > 0 || second.wanted > 0 || second.in_flight > 0; }

double LatencyOf(const Totals& totals, double share) {
  ValueCounts all = totals.latencies_s;
  all.Add(kNever, totals.failed_tiles);
  all.AddAbove(all.Percentile(share), totals.open_s);
  const double latency_s = all.Percentile(share);
  return std::isinf(latency_s) ? -1 : latency_s;
}

// Tiles per second over the seconds in which at least half of the frames waited for tiles.
double TilesPerWaitingSecond(const std::vector<Second>& seconds) {
  std::uint64_t tiles = 0, count = 0;
  for (const Second& second : seconds) {
    if (second.frames == 0 || second.waiting * 2 < second.frames) continue;
    tiles += second.tiles;
    ++count;
  }
  return count == 0 ? 0 : static_cast<double>(tiles) / static_cast<double>(count);
}

void FindFaults(const FlightOptions& options, const std::vector<Second>& seconds, Summary& summary) {
  std::vector<std::string>& findings = summary.findings;
  const Totals& totals = summary.totals;
  if (summary.never_opened > 0) {
    const auto failed = std::find_if(summary.clients.begin(), summary.clients.end(),
                                     [](const ClientRecord& client) { return !client.failure.empty(); });
    findings.push_back(fmt::format("{} of {} clients did not fly: {}", summary.never_opened, summary.clients.size(),
                                   failed == summary.clients.end() ? "stopped" : failed->failure));
  }
  if (summary.never_full > 0) {
    findings.push_back(
        fmt::format("{} of {} clients never saw a full view.", summary.never_full, summary.clients.size()));
  }
  if (summary.is_beside_data) {
    findings.emplace_back(
        "The view shows no terrain of the dataset, or only that of level 0. Check the place and the view of --circle, "
        "--from and --to, or --path: longitude comes first, west and south are negative.");
  }
  if (const double waiting = Share(totals.waiting_frames, totals.flying_frames); waiting > kMaxWaitingShare) {
    findings.push_back(fmt::format(
        "The server does not keep up: {:.0f} % of the frames of the flight waited for tiles. While frames "
        "waited, {:.1f} tiles a second arrived with up to {} requests open at a time; half of the tiles took more "
        "than {}.",
        100 * waiting, TilesPerWaitingSecond(seconds), options.max_loads * options.clients,
        MillisecondsOrNever(summary.p50_s)));
  }
  if (const double oldest_s = totals.open_s.Percentile(1); oldest_s > totals.latencies_s.Percentile(1)) {
    findings.push_back(
        fmt::format("{} tiles had not arrived at the end; one was awaited for {}, longer than any that arrived.",
                    Grouped(totals.open_s.size()), Milliseconds(oldest_s)));
  }
  if (totals.hole_frames > 0) {
    findings.push_back(fmt::format("Holes: {} of {} examined frames showed nothing in up to {:.1f} % of the screen.",
                                   totals.hole_frames, totals.measured_frames, 100 * totals.worst_hole));
  }
  if (totals.uncovered_frames > 0) {
    findings.push_back(
        fmt::format("In {} frames no tile was selected where the tree has one.", totals.uncovered_frames));
  }
  for (std::size_t i = 1; i < kOutcomes; ++i) {
    if (totals.outcomes[i] == 0) continue;
    findings.push_back(fmt::format("{} request{}: {}.", Grouped(totals.outcomes[i]), totals.outcomes[i] == 1 ? "" : "s",
                                   NameOf(static_cast<Outcome>(i))));
  }
  if (totals.version_changes > 0) {
    findings.push_back(fmt::format("The dataset changed its version {} times; {} frames showed tiles of two versions.",
                                   totals.version_changes, Grouped(totals.mixed_frames)));
  }
  if (totals.incomplete_tiles > 0) {
    findings.push_back(fmt::format("{} tiles do not cover their rectangle (edits with holes, or damage).",
                                   Grouped(totals.incomplete_tiles)));
  }
  if (Share(totals.late_frames, totals.frames) > 0.05) {
    findings.push_back(
        fmt::format("{:.0f} % of the frames were late: this machine is too slow for so many clients at this "
                    "frame rate, and latencies contain its own waiting.",
                    100 * Share(totals.late_frames, totals.frames)));
  }
}

}  // namespace

Summary Summarize(const FlightOptions& options, const FlightRecord& record) {
  Summary summary;
  summary.totals = record.totals;
  summary.clients = record.clients;
  const std::vector<Second>& seconds = record.seconds;
  summary.seconds = static_cast<double>(seconds.size());
  std::vector<float> views;
  bool has_all_arrived = true;  // of those that opened the document
  for (const ClientRecord& client : summary.clients) {
    if (client.document_s < 0) ++summary.never_opened;
    if (client.document_s >= 0 && client.first_view_s < 0) ++summary.never_full;
    views.push_back(client.first_view_s < 0 ? kNever : static_cast<float>(client.first_view_s));
    summary.arrival_s = std::max(summary.arrival_s, client.arrival_s);
    has_all_arrived &= client.document_s < 0 || client.arrival_s >= 0;
  }
  if (!has_all_arrived) summary.arrival_s = -1;
  const auto view_at = [&views](double share) {
    const double view_s = Percentile(views, share);
    return std::isinf(view_s) ? -1 : view_s;
  };
  summary.first_view_s = view_at(0.5);
  summary.worst_first_view_s = view_at(1);
  const Totals& totals = summary.totals;
  summary.p50_s = LatencyOf(totals, 0.5);
  summary.p99_s = LatencyOf(totals, 0.99);
  summary.max_s = LatencyOf(totals, 1);
  summary.is_beside_data = totals.flying_frames > 0 && totals.data_frames == 0;
  if (totals.frame_worst_px.size() > 0) {
    summary.frame_p50_px = totals.frame_worst_px.Percentile(0.5);
    summary.frame_p99_px = totals.frame_worst_px.Percentile(0.99);
  }
  summary.refined_share = Share(totals.refined_frames, totals.flying_frames);
  std::uint64_t loading = 0;
  for (const Second& second : seconds) {
    loading += IsLoading(second) ? 1 : 0;
    summary.best_tiles_per_second = std::max(summary.best_tiles_per_second, static_cast<double>(second.tiles));
  }
  summary.tiles_per_second = Share(totals.tiles, loading);
  for (std::size_t i = 0; i < kOutcomes; ++i) {
    const auto outcome = static_cast<Outcome>(i);
    if (outcome != Outcome::kOk && outcome != Outcome::kRefused) summary.errors += totals.outcomes[i];
  }
  FindFaults(options, seconds, summary);
  return summary;
}

std::string LineOf(std::size_t i, const Second& second) {
  const double refined = 100 * Share(second.refined, second.frames);
  std::uint64_t known = 0;
  for (std::size_t tier = 0; tier + 1 < kCacheTiers; ++tier) known += second.tiers[tier];
  const std::string hits = known == 0 ? "   -" : fmt::format("{:3.0f}%", 100 * Share(second.tiers[0], known));
  std::uint64_t bad = 0;
  for (std::size_t outcome = 1; outcome < kOutcomes; ++outcome) bad += second.outcomes[outcome];
  return fmt::format(
      "{:4} s  tiles {:4}  {:8.1f} kB  triangles {:7}  hits {}  p50 {:>8}  p99 {:>8}  wanted {:3}  refined "
      "{:3.0f}%  worst {:5.1f} px{}{}",
      i + 1, second.tiles, static_cast<double>(second.bytes) / 1e3, second.triangles, hits,
      Milliseconds(Percentile(second.latencies_s, 0.5)), Milliseconds(Percentile(second.latencies_s, 0.99)),
      second.wanted, refined, second.worst_px,
      second.worst_hole > 0 ? fmt::format("  hole {:.1f}%", 100 * second.worst_hole) : "",
      bad > 0 ? fmt::format("  refused or failed {}", bad) : "");
}

std::string TextOf(const Summary& summary) {
  const Totals& totals = summary.totals;
  std::string text;
  const auto add = [&text](std::string_view name, const std::string& value) {
    fmt::format_to(std::back_inserter(text), "{:<17}{}\n", name, value);
  };
  add("first full view",
      summary.clients.size() == 1
          ? MillisecondsOrNever(summary.first_view_s)
          : fmt::format("{} median, {} worst of {} clients", MillisecondsOrNever(summary.first_view_s),
                        MillisecondsOrNever(summary.worst_first_view_s), summary.clients.size()));
  add("refined", fmt::format("{:.1f} % of {} frames of the flight; {} after its end", 100 * summary.refined_share,
                             Grouped(totals.flying_frames),
                             summary.arrival_s < 0 ? "not full" : "full " + Milliseconds(summary.arrival_s)));
  add("error on screen",
      summary.frame_p99_px < 0
          ? "not measured"
          : fmt::format("{:.1f} px in half of the frames, {:.1f} px in 99 %, {:.1f} px at most; stated by the "
                        "server {:.1f} px at most",
                        summary.frame_p50_px, summary.frame_p99_px, totals.worst_px, totals.worst_stated_px));
  add("holes", fmt::format("{} of {} examined frames, at most {:.2f} % of the screen", totals.hole_frames,
                           totals.measured_frames, 100 * totals.worst_hole));
  add("tiles", fmt::format("{}, {:.1f} a second, {:.0f} in the best second; {} other requests", Grouped(totals.tiles),
                           summary.tiles_per_second, summary.best_tiles_per_second, Grouped(totals.other_requests)));
  add("received", fmt::format("{} bytes, {} triangles, {} connections", Grouped(totals.bytes),
                              Grouped(totals.triangles), Grouped(totals.connections)));
  add("latency of tiles",
      fmt::format("p50 {}, p99 {}, slowest {}; {} failed, {} had not arrived at the end",
                  MillisecondsOrNever(summary.p50_s), MillisecondsOrNever(summary.p99_s),
                  MillisecondsOrNever(summary.max_s), Grouped(totals.failed_tiles), Grouped(totals.open_s.size())));
  add("server had them", fmt::format("in memory {}, lower tier {}, joined a build {}, built {}, not stated {}",
                                     Grouped(totals.tiers[0]), Grouped(totals.tiers[1]), Grouped(totals.tiers[2]),
                                     Grouped(totals.tiers[3]), Grouped(totals.tiers[4])));
  std::string failures;
  for (std::size_t i = 1; i < kOutcomes; ++i) {
    if (totals.outcomes[i] == 0) continue;
    failures += fmt::format("{}{} {}", failures.empty() ? "" : ", ", Grouped(totals.outcomes[i]),
                            NameOf(static_cast<Outcome>(i)));
  }
  add("failures", fmt::format("{}; {} retries", failures.empty() ? "none" : failures, Grouped(totals.retries)));
  for (const std::string& finding : summary.findings) text += "! " + finding + "\n";
  return text;
}

}  // namespace terrace::fly
