// Shared by all parts of the benchmark: the options of the command line, and races against a peer.
#pragma once

#include <optional>
#include <regex>
#include <string>
#include <vector>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "tests/bench/peer.h"
#include "tests/bench/race.h"
#include "tests/bench/table.h"

namespace terrace::bench {

struct Options {
  int runs = 5;                     // turns of every race
  std::string peer;                 // command, see peer.h; empty: no comparison
  std::string data_dependent_peer;  // the same for data-dependent triangulations
  std::string filter;               // regular expression on the names of cases; empty: all
};

class Environment {
 public:
  explicit Environment(Options options) : options_(std::move(options)), filter_(options_.filter) {}

  bool Wants(const std::string& name) const { return std::regex_search(name, filter_); }
  const Options& options() const { return options_; }

 private:
  Options options_;
  std::regex filter_;
};

// Throws a std::runtime_error that only main() catches, so that destructors remove temporary files.
[[noreturn]] void Die(const std::string& message);

// The command (peer.h) as a contender. The fields of its races must outlive it. Dies if the command fails.
Contender PeerContender(const std::string& command);

// Dies unless the mesh meets the goal, measured by tin::MeasureError. Returns the root mean square error.
double CheckMesh(const std::string& name, const tin::HeightField& field, const tin::GreedyGoal& goal,
                 const tin::TinMesh& mesh);

// A race of ours against the peer, if there is one, as a row of SpeedColumns().
std::vector<std::string> SpeedColumns();
struct Contest {
  Score ours;
  std::optional<Score> theirs;
};
std::vector<Cell> SpeedRow(const std::string& name, const Contest& contest, const std::string& target);

}  // namespace terrace::bench
