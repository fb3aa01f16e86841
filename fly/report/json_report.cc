#include <cmath>
#include <nlohmann/json.hpp>

#include "fly/report/requirement.h"
#include "fly/report/summary.h"

namespace terrace::fly {
namespace {

using Json = nlohmann::ordered_json;

// A latency of a fraction of a millisecond keeps its precision.
double Rounded(double value) { return std::round(value * 1e8) / 1e8; }

Json OrNull(double value) { return value < 0 ? Json(nullptr) : Json(Rounded(value)); }

template <std::size_t N, typename Name, typename Count>
Json Counts(const std::array<Count, N>& counts, Name name) {
  Json json;
  for (std::size_t i = 0; i < N; ++i) json[name(i)] = counts[i];
  return json;
}

const char* OutcomeKey(std::size_t i) { return KeyOf(static_cast<Outcome>(i)); }
const char* TierKey(std::size_t i) { return NameOf(static_cast<CacheTier>(i)); }

Json SummaryJson(const Summary& summary) {
  const Totals& totals = summary.totals;
  Json json;
  json["clients"] = summary.clients.size();
  json["seconds"] = summary.seconds;
  json["first_full_view_s"] = {{"median", OrNull(summary.first_view_s)}, {"worst", OrNull(summary.worst_first_view_s)}};
  json["clients_without_document"] = summary.never_opened;
  json["clients_without_full_view"] = summary.never_full;
  json["arrival_full_view_s"] = OrNull(summary.arrival_s);
  json["frames"] = totals.frames;
  json["flying_frames"] = totals.flying_frames;
  json["refined_share"] = Rounded(summary.refined_share);
  json["late_frames"] = totals.late_frames;
  json["mixed_version_frames"] = totals.mixed_frames;
  json["screen_error_px"] = {{"p50", OrNull(summary.frame_p50_px)},
                             {"p99", OrNull(summary.frame_p99_px)},
                             {"max", OrNull(totals.worst_px)},
                             {"stated_max", OrNull(totals.worst_stated_px)}};
  json["holes"] = {{"examined_frames", totals.measured_frames},
                   {"frames", totals.hole_frames},
                   {"uncovered_frames", totals.uncovered_frames},
                   {"worst_share", Rounded(totals.worst_hole)}};
  json["tiles"] = totals.tiles;
  json["tiles_per_second"] = Rounded(summary.tiles_per_second);
  json["best_tiles_per_second"] = summary.best_tiles_per_second;
  json["incomplete_tiles"] = totals.incomplete_tiles;
  json["other_requests"] = totals.other_requests;
  json["bytes"] = totals.bytes;
  json["triangles"] = totals.triangles;
  json["connections"] = totals.connections;
  json["latency_s"] = {{"p50", OrNull(summary.p50_s)}, {"p99", OrNull(summary.p99_s)}, {"max", OrNull(summary.max_s)}};
  json["failed_tiles"] = totals.failed_tiles;
  json["open_tiles"] = totals.open_s.size();
  json["cache"] = Counts(totals.tiers, TierKey);
  json["outcomes"] = Counts(totals.outcomes, OutcomeKey);
  json["errors"] = summary.errors;
  json["retries"] = totals.retries;
  json["version_changes"] = totals.version_changes;
  json["messages"] = totals.messages;
  json["findings"] = summary.findings;
  return json;
}

Json SecondJson(const Second& second) {
  Json json;
  json["tiles"] = second.tiles;
  json["bytes"] = second.bytes;
  json["triangles"] = second.triangles;
  json["cache"] = Counts(second.tiers, TierKey);
  json["outcomes"] = Counts(second.outcomes, OutcomeKey);
  json["p50_s"] = Rounded(Percentile(second.latencies_s, 0.5));
  json["p99_s"] = Rounded(Percentile(second.latencies_s, 0.99));
  json["frames"] = second.frames;
  json["refined"] = second.refined;
  json["wanted"] = second.wanted;
  json["in_flight"] = second.in_flight;
  json["worst_px"] = Rounded(second.worst_px);
  json["worst_hole"] = Rounded(second.worst_hole);
  return json;
}

}  // namespace

std::string JsonOf(const FlightOptions& options, const Summary& summary, const Judgements& judgements,
                   const std::vector<Second>& seconds) {
  Json json;
  json["document"] = options.document.PublicText();
  json["format"] = options.format == Format::kTerrain ? "terrain" : "3dtiles";
  json["summary"] = SummaryJson(summary);
  json["requirements"] = Json::array();
  for (const Judgement& judgement : judgements.all) {
    json["requirements"].push_back(
        {{"requirement", judgement.requirement.text}, {"value", judgement.shown}, {"holds", judgement.holds}});
  }
  json["seconds"] = Json::array();
  for (const Second& second : seconds) json["seconds"].push_back(SecondJson(second));
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace terrace::fly
