#include "tests/bench/race.h"

#include <algorithm>

#include "engine/core/check.h"

namespace terrace::bench {

void Score::Add(const Runs& runs) {
  TERRACE_CHECK(!runs.seconds.empty());
  std::vector<double> sorted = runs.seconds;
  std::sort(sorted.begin(), sorted.end());
  const std::size_t half = sorted.size() / 2;
  min_seconds += sorted.front();
  median_seconds += sorted.size() % 2 == 1 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
  points += runs.points;
}

Score& Score::operator+=(const Score& other) {
  min_seconds += other.min_seconds;
  median_seconds += other.median_seconds;
  points += other.points;
  return *this;
}

std::vector<Score> Race(std::span<const tin::HeightField* const> fields, const tin::GreedyGoal& goal, int turns,
                        std::span<const Contender> contenders) {
  std::vector<Score> scores(contenders.size());
  for (const tin::HeightField* field : fields) {
    std::vector<Runs> runs(contenders.size());
    for (int turn = 0; turn < turns; ++turn) {
      for (std::size_t i = 0; i < contenders.size(); ++i) contenders[i](*field, goal, runs[i]);
    }
    for (std::size_t i = 0; i < contenders.size(); ++i) scores[i].Add(runs[i]);
  }
  return scores;
}

}  // namespace terrace::bench
