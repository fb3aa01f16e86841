// The engine as a contender.
#pragma once

#include <vector>

#include "engine/tin/greedy.h"
#include "tests/bench/cpu_clock.h"
#include "tests/bench/race.h"

namespace terrace::bench {

inline tin::TinMesh MeshOf(const tin::HeightField& field, const tin::GreedyGoal& goal) {
  tin::GreedyTriangulation tin(field);
  tin.Run(goal);
  return tin.Mesh();
}

// From two triangles to the mesh.
inline void MeshFromScratch(const tin::HeightField& field, const tin::GreedyGoal& goal, Runs& runs) {
  runs.seconds.push_back(SecondsOf([&] { runs.points = MeshOf(field, goal).vertices.size(); }));
}

inline std::vector<const tin::HeightField*> PointersTo(const std::vector<tin::HeightField>& fields) {
  std::vector<const tin::HeightField*> pointers;
  for (const tin::HeightField& field : fields) pointers.push_back(&field);
  return pointers;
}

}  // namespace terrace::bench
