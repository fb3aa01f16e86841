// The engine as a contender.
#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "engine/tin/extended/block_joiner.h"
#include "engine/tin/extended/field_partition.h"
#include "engine/tin/greedy.h"
#include "tests/bench/cpu_clock.h"
#include "tests/bench/race.h"

namespace terrace::bench {

using Mesher = std::function<tin::TinMesh(const tin::HeightField&, const tin::GreedyGoal&)>;

// A complete run, from two triangles to the mesh.
inline tin::TinMesh MeshOf(const tin::HeightField& field, const tin::GreedyGoal& goal,
                           const tin::GreedyOptions& options = {}) {
  tin::GreedyTriangulation tin(field, options);
  tin.Run(goal);
  return tin.Mesh();
}

inline Mesher GreedyMesher(const tin::GreedyOptions& options = {}) {
  return [options](const tin::HeightField& field, const tin::GreedyGoal& goal) { return MeshOf(field, goal, options); };
}

// The same in blocks, if the engine's partition has several; all of them on this thread. The goal must be an error.
inline tin::TinMesh MeshInBlocks(const tin::HeightField& field, const tin::GreedyGoal& goal) {
  const tin::FieldPartition cut = tin::FieldPartition::For(field, goal.max_error);
  tin::BlockJoiner joiner(cut);
  while (joiner.added() < cut.size()) {
    joiner.Add(*tin::MeshBlock(field, cut.block(joiner.added()), goal.max_error));
  }
  return std::move(joiner).Take();
}

// Meshes twice a turn, as peers do, because the first run starts with the caches of another process.
inline Contender Timed(Mesher mesher) {
  return [mesher = std::move(mesher)](const tin::HeightField& field, const tin::GreedyGoal& goal, Runs& runs) {
    for (int time = 0; time < 2; ++time) {
      runs.seconds.push_back(SecondsOf([&] { runs.points = mesher(field, goal).vertices.size(); }));
    }
  };
}

inline tin::GreedyOptions DataDependent(tin::FitMeasure measure = tin::FitMeasure::kSumMax, double qthresh = 0.5) {
  tin::GreedyOptions options;
  options.criterion = tin::Criterion::kDataDependent;
  options.data_dependent = {measure, qthresh};
  return options;
}

inline std::vector<const tin::HeightField*> PointersTo(const std::vector<tin::HeightField>& fields) {
  std::vector<const tin::HeightField*> pointers;
  for (const tin::HeightField& field : fields) pointers.push_back(&field);
  return pointers;
}

}  // namespace terrace::bench
