// Another mesher, run as a command: what it costs to mesh the same heights to the same goal.
//
// The command gets four more arguments: a file of raw float32 heights (metres, row by row, this machine's byte order),
// its width, its height, and the goal, `error=5` (metres) or `points=1542` (vertices). For each time it meshed it
// prints a line
//
//   seconds 0.0104 points 1542
//
// the CPU seconds of meshing alone, without reading, and the vertices it got. Lines that begin otherwise are skipped.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"

namespace terrace::bench {

// "error=5" or "points=1542".
std::string GoalArgument(const tin::GreedyGoal& goal);

struct PeerRuns {
  std::vector<double> seconds;  // at least one
  std::size_t points = 0;
};

// What the command printed, as stated above. kInvalidArgument: not a single line of it.
Result<PeerRuns> ParsePeerOutput(std::string_view output);

// Fields written for peers to read; the folder goes with the object.
class FieldFiles {
 public:
  FieldFiles();
  ~FieldFiles();
  FieldFiles(const FieldFiles&) = delete;
  FieldFiles& operator=(const FieldFiles&) = delete;

  // The field's file, written when it is asked for the first time. `field` must outlive this object.
  Result<std::filesystem::path> PathOf(const tin::HeightField& field);

 private:
  std::filesystem::path folder_;
  std::vector<const tin::HeightField*> written_;
};

// Runs the command once. kUnavailable: it failed; kInvalidArgument: it printed something else.
Result<PeerRuns> RunPeer(const std::string& command, const std::filesystem::path& file, const tin::HeightField& field,
                         const tin::GreedyGoal& goal);

}  // namespace terrace::bench
