#include "tests/bench/environment.h"

#include <limits>
#include <memory>
#include <stdexcept>

#include "engine/tin/mesh_error.h"

namespace terrace::bench {

Contender PeerContender(const std::string& command) {
  const auto files = std::make_shared<FieldFiles>();
  return [files, command](const tin::HeightField& field, const tin::GreedyGoal& goal, Runs& runs) {
    const auto path = files->PathOf(field);
    if (!path) Die(path.error().message);
    const auto ran = RunPeer(command, *path, field, goal);
    if (!ran) Die(ran.error().message);
    runs.seconds.insert(runs.seconds.end(), ran->seconds.begin(), ran->seconds.end());
    runs.points = ran->points;
  };
}

void Die(const std::string& message) { throw std::runtime_error(message); }

double CheckMesh(const std::string& name, const tin::HeightField& field, const tin::GreedyGoal& goal,
                 const tin::TinMesh& mesh) {
  const tin::MeshError error = tin::MeasureError(field, mesh);
  const auto samples = static_cast<std::size_t>(field.width()) * static_cast<std::size_t>(field.height());
  if (error.samples != samples) Die(fmt::format("{}: the mesh covers {} of {} samples", name, error.samples, samples));
  if (goal.max_points != std::numeric_limits<std::size_t>::max()) {
    if (mesh.vertices.size() > goal.max_points) Die(fmt::format("{}: {} vertices", name, mesh.vertices.size()));
  } else if (error.max > goal.max_error + 1e-9) {  // the measurement rounds
    Die(fmt::format("{}: the mesh is {} m off where {} m were asked", name, error.max, goal.max_error));
  }
  return error.rms;
}

std::vector<std::string> SpeedColumns() {
  return {"case", "ours ms", "ours median", "peer ms", "peer median", "ratio", "aim", "vertices", "peer's", "more"};
}

std::vector<Cell> SpeedRow(const std::string& name, const Contest& contest, const std::string& target) {
  const Score& ours = contest.ours;
  std::vector<Cell> row{name, Milliseconds(ours.min_seconds), Milliseconds(ours.median_seconds)};
  if (contest.theirs) {
    const Score& theirs = *contest.theirs;
    row.insert(row.end(),
               {Milliseconds(theirs.min_seconds), Milliseconds(theirs.median_seconds),
                Ratio(theirs.min_seconds / ours.min_seconds), target, Count(ours.points), Count(theirs.points),
                Percent(static_cast<double>(ours.points) / static_cast<double>(theirs.points) - 1)});
  } else {
    row.insert(row.end(), {{}, {}, {}, target, Count(ours.points), {}, {}});
  }
  return row;
}

}  // namespace terrace::bench
