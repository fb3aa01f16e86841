// Runs another mesher as a command, and reports its time for the same heights and the same goal.
//
// The command gets four more arguments: a file of raw float32 heights (metres, row by row, this machine's byte order),
// its width, its height, and the goal, `error=5` (metres) or `points=1542` (vertices). For each run of its mesher it
// prints a line
//
//   seconds 0.0104 points 1542
// with the CPU seconds of meshing, without reading, and the number of vertices. Other lines are ignored.
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

// Parses the output described above. kInvalidArgument: it has no such line.
Result<PeerRuns> ParsePeerOutput(std::string_view output);

// Writes fields for peers into a temporary folder; the destructor removes it.
class FieldFiles {
 public:
  FieldFiles();
  ~FieldFiles();
  FieldFiles(const FieldFiles&) = delete;
  FieldFiles& operator=(const FieldFiles&) = delete;

  // The field's file; the first call writes it. `field` must outlive this object.
  Result<std::filesystem::path> PathOf(const tin::HeightField& field);

 private:
  std::filesystem::path folder_;
  std::vector<const tin::HeightField*> written_;
};

// Runs the command once. kUnavailable: it failed; kInvalidArgument: its output is invalid.
Result<PeerRuns> RunPeer(const std::string& command, const std::filesystem::path& file, const tin::HeightField& field,
                         const tin::GreedyGoal& goal);

}  // namespace terrace::bench
