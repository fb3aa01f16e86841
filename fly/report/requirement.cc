#include "fly/report/requirement.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>

namespace terrace::fly {
namespace {

enum class Unit { kSeconds, kShare, kPixels, kCount };

struct Row {
  std::string_view name;
  Measure measure;
  Unit unit;
  bool is_minimum;
};

constexpr std::array<Row, 10> kRows = {{
    {"full-view", Measure::kFullView, Unit::kSeconds, false},
    {"p50", Measure::kP50, Unit::kSeconds, false},
    {"p99", Measure::kP99, Unit::kSeconds, false},
    {"refined", Measure::kRefined, Unit::kShare, true},
    {"screen-error", Measure::kScreenError, Unit::kPixels, false},
    {"holes", Measure::kHoles, Unit::kCount, false},
    {"errors", Measure::kErrors, Unit::kCount, false},
    {"refusals", Measure::kRefusals, Unit::kCount, false},
    {"hits", Measure::kHits, Unit::kShare, true},
    {"tiles", Measure::kTiles, Unit::kCount, true},
}};

const Row& RowOf(Measure measure) {
  return *std::find_if(kRows.begin(), kRows.end(), [measure](const Row& row) { return row.measure == measure; });
}

// The factor of a suffix; nothing if the unit has no such suffix.
std::optional<double> FactorOf(Unit unit, std::string_view suffix) {
  switch (unit) {
    case Unit::kSeconds:
      return suffix == "s" ? std::optional(1.0) : suffix == "ms" ? std::optional(0.001) : std::nullopt;
    case Unit::kShare:
      return suffix == "%" ? std::optional(0.01) : std::nullopt;
    case Unit::kPixels:
      return suffix == "px" || suffix.empty() ? std::optional(1.0) : std::nullopt;
    case Unit::kCount:
      return suffix.empty() ? std::optional(1.0) : std::nullopt;
  }
  return std::nullopt;
}

double ValueOf(Measure measure, const Summary& summary) {
  const Totals& totals = summary.totals;
  const bool has_tiles = totals.tiles > 0, has_flight = totals.flying_frames > 0;
  switch (measure) {
    case Measure::kFullView:
      return summary.worst_first_view_s;
    case Measure::kP50:
      return has_tiles ? summary.p50_s : -1;
    case Measure::kP99:
      return has_tiles ? summary.p99_s : -1;
    case Measure::kRefined:
      return has_flight ? summary.refined_share : -1;
    case Measure::kScreenError:
      return summary.frame_p99_px;
    case Measure::kHoles:
      return totals.measured_frames > 0 ? static_cast<double>(totals.hole_frames) : -1;
    case Measure::kErrors:
      return static_cast<double>(summary.errors);
    case Measure::kRefusals:
      return static_cast<double>(totals.outcomes[static_cast<std::size_t>(Outcome::kRefused)]);
    case Measure::kHits:
      return has_tiles ? static_cast<double>(totals.tiers[0]) / static_cast<double>(totals.tiles) : -1;
    case Measure::kTiles:
      return has_tiles ? summary.tiles_per_second : -1;
  }
  return -1;
}

// With `more` decimals than usual.
std::string Show(Unit unit, double value, int more) {
  if (value < 0) return unit == Unit::kSeconds ? "never" : "not measured";
  switch (unit) {
    case Unit::kSeconds:
      return value < 1 ? fmt::format("{:.{}f} ms", value * 1000, 1 + more) : fmt::format("{:.{}f} s", value, 2 + more);
    case Unit::kShare:
      return fmt::format("{:.{}f} %", value * 100, 2 + more);
    case Unit::kPixels:
      return fmt::format("{:.{}f} px", value, 1 + more);
    case Unit::kCount:
      return fmt::format("{:.{}f}", value, more);
  }
  return {};
}

}  // namespace

Result<std::vector<Requirement>> ParseRequirements(std::string_view text) {
  std::vector<Requirement> requirements;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(','), text.size());
    const std::string_view part = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::size_t equals = part.find('=');
    const auto row = std::find_if(kRows.begin(), kRows.end(),
                                  [&](const Row& candidate) { return candidate.name == part.substr(0, equals); });
    double value = -1;
    std::optional<double> factor;
    if (row != kRows.end() && equals != std::string_view::npos) {
      const char* const begin = part.data() + equals + 1;
      const auto [rest, error] = std::from_chars(begin, part.data() + part.size(), value);
      if (error == std::errc() && value >= 0 && std::isfinite(value)) {
        factor = FactorOf(row->unit, {rest, static_cast<std::size_t>(part.data() + part.size() - rest)});
      }
    }
    if (!factor) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "--require: \"{}\" is no requirement; possible are full-view=2s, p50=10ms, p99=50ms, refined=95%, "
          "screen-error=20px, holes=0, errors=0, refusals=0, hits=80% and tiles=30, joined by commas",
          part);
    }
    requirements.push_back({row->measure, value * *factor, std::string(part)});
  }
  return requirements;
}

bool Judgements::AllHold() const {
  return std::all_of(all.begin(), all.end(), [](const Judgement& judgement) { return judgement.holds; });
}

Judgements Judge(const std::vector<Requirement>& requirements, const Summary& summary) {
  Judgements judgements;
  for (const Requirement& requirement : requirements) {
    const Row& row = RowOf(requirement.measure);
    Judgement judgement;
    judgement.requirement = requirement;
    judgement.value = ValueOf(requirement.measure, summary);
    judgement.holds = judgement.value >= 0 &&
                      (row.is_minimum ? judgement.value >= requirement.bound : judgement.value <= requirement.bound);
    // A value that fails is not shown as the bound itself.
    int more = 0;
    do {
      judgement.shown = Show(row.unit, judgement.value, more);
    } while (!judgement.holds && judgement.shown == Show(row.unit, requirement.bound, more) && ++more < 10);
    judgements.all.push_back(std::move(judgement));
  }
  return judgements;
}

}  // namespace terrace::fly
