// What a bake prints while it runs and at its end.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "bake/baker.h"
#include "bake/estimate.h"

namespace terrace::cli {

// "12.3 MB"
std::string Bytes(double bytes);

// "42 s", "12 min", "3.4 h"
std::string Duration(double seconds);

// Shows on stderr, until it is destroyed, tiles, tiles a second, bytes, units and the time left: on a terminal one line
// that is rewritten, else a line every ten seconds.
class BakeDisplay {
 public:
  BakeDisplay(std::string name, std::uint64_t tiles, std::uint64_t units, const bake::Counters& counters);
  ~BakeDisplay();
  BakeDisplay(const BakeDisplay&) = delete;
  BakeDisplay& operator=(const BakeDisplay&) = delete;

 private:
  void Show();
  std::string Line() const;

  const std::string name_;
  const std::uint64_t tiles_, units_;
  const bake::Counters& counters_;
  const bool terminal_;
  const std::chrono::steady_clock::time_point start_;
  bool shown_ = false;
  std::mutex mutex_;
  std::condition_variable_any ended_;
  std::jthread thread_;
};

// One line of JSON for a unit.
std::string UnitJson(const bake::UnitReport& report, const std::vector<bake::Target>& targets);

// What a bake did, as text or JSON.
struct BakeSummary {
  std::string place;
  std::uint64_t tiles = 0, bytes = 0;                                                    // of all files that are there
  std::uint64_t baked = 0, kept = 0, copied = 0, failed = 0, missing = 0, unusable = 0;  // files
  std::uint64_t built_tiles = 0;                                                         // by this process
  double seconds = 0;
  bool is_complete = false;  // the manifest is written
};
std::string SummaryJson(const BakeSummary& summary, const bake::Counters& counters);
std::string SummaryText(const BakeSummary& summary);

std::string EstimateJson(const bake::Estimate& estimate);
std::string EstimateText(const bake::Estimate& estimate);

}  // namespace terrace::cli
