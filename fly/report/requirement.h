// What an operator requires of a flight: "full-view=2s,p99=50ms".
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "fly/report/summary.h"

namespace terrace::fly {

enum class Measure {
  kFullView,  // worst time to the first full view; at most
  kP50,       // latency of tiles; at most
  kP99,
  kRefined,      // share of refined frames; at least
  kScreenError,  // pixels, 99 % of the frames; at most
  kHoles,        // frames; at most
  kErrors,       // failed requests without refusals; at most
  kRefusals,     // 429 and 503; at most
  kHits,         // share of tiles that the server had in memory; at least
  kTiles,        // tiles a second; at least
};

struct Requirement {
  Measure measure = Measure::kFullView;
  double bound = 0;  // seconds, shares of 1, pixels or counts
  std::string text;  // as it was written
};

// kInvalidArgument names the part that is wrong and lists what is possible.
Result<std::vector<Requirement>> ParseRequirements(std::string_view text);

struct Judgement {
  Requirement requirement;
  double value = 0;  // in the unit of `bound`; negative if nothing was measured: the requirement fails
  bool holds = false;
  std::string shown;  // the value with its unit
};

struct Judgements {
  std::vector<Judgement> all;
  bool AllHold() const;
};

Judgements Judge(const std::vector<Requirement>& requirements, const Summary& summary);

}  // namespace terrace::fly
