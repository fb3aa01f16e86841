// Runs two programs on the same fields in turns, so that other load on the machine affects both.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"

namespace terrace::bench {

// The runs of one contender on one field.
struct Runs {
  std::vector<double> seconds;
  std::size_t points = 0;  // vertices of its mesh
};

// Meshes the field one or more times and adds the seconds of each time to the runs.
using Contender = std::function<void(const tin::HeightField&, const tin::GreedyGoal&, Runs&)>;

// Sums over fields: of minima, of medians, of vertices.
struct Score {
  double min_seconds = 0;
  double median_seconds = 0;
  std::size_t points = 0;

  void Add(const Runs& runs);
  Score& operator+=(const Score& other);
};

// Every contender's score over the fields; `turns` turns each on each field, in the order of the contenders.
std::vector<Score> Race(std::span<const tin::HeightField* const> fields, const tin::GreedyGoal& goal, int turns,
                        std::span<const Contender> contenders);

}  // namespace terrace::bench
