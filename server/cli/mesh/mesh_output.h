// Shared by the variants of `terrace mesh`: the output file and messages about it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "engine/tin/mesh/height_field.h"
#include "proto/gltf/mesh_file.h"
#include "server/cli/common/progress.h"
#include "server/cli/common/replaced_file.h"

namespace terrace::cli {

class MeshOutput {
 public:
  // Call it before the work, so that a missing folder is found early. kInvalidArgument: unknown format, or the file is
  // one of `inputs`.
  static Result<MeshOutput> Open(const std::string& path, const std::vector<std::string>& inputs);

  // Writes the whole file. The vertices lie on the placement's grid; `colors` is empty or has one entry per vertex.
  Result<void> Write(std::vector<proto::MeshVertex> vertices,
                     const std::vector<std::array<std::uint32_t, 3>>& triangles, const proto::GridPlacement& placement,
                     const std::vector<Rgb>& colors = {});
  // The same of a file that was encoded before.
  Result<void> Write(const std::string& bytes);

 private:
  MeshOutput(proto::MeshFileFormat format, ReplacedFile file) : format_(format), file_(std::move(file)) {}

  proto::MeshFileFormat format_;
  ReplacedFile file_;
};

struct MeshSeconds {
  double read = 0, triangulate = 0, write = 0;
};

// The largest resident memory of this process so far.
std::int64_t PeakRssBytes();

// Runs to the goal in steps of `step` vertices, and shows the progress. The error decreases roughly as 1 / vertices.
template <typename Goal, typename Greedy>
void RunInSteps(const Goal& goal, std::size_t step, Greedy& greedy) {
  Progress progress("meshing");
  Goal part = goal;
  do {
    part.max_points = std::min(goal.max_points, greedy.vertex_count() + step);
    greedy.Run(part);
    progress.Update(goal.max_points != Goal{}.max_points
                        ? static_cast<double>(greedy.vertex_count()) / static_cast<double>(goal.max_points)
                        : std::min(1.0, goal.max_error / greedy.CurrentError()));
  } while (greedy.vertex_count() == part.max_points && part.max_points != goal.max_points);
}

// Number of samples without a height. `measured`: number of samples with one.
inline std::size_t VoidsOf(const tin::HeightField& field, std::size_t measured) {
  return static_cast<std::size_t>(field.width()) * static_cast<std::size_t>(field.height()) - measured;
}
std::string TextOfVoids(std::size_t voids);  // empty if there are none

// Reports on stderr if the mesh fits every sample with fewer vertices than requested. `points` 0: no number was
// requested.
void ReportUnused(const std::string& input, std::size_t points, std::size_t vertices);

}  // namespace terrace::cli
