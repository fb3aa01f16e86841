#include "tests/bench/peer.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <fstream>
#include <limits>
#include <sstream>

namespace terrace::bench {

std::string GoalArgument(const tin::GreedyGoal& goal) {
  const bool by_points = goal.max_points != std::numeric_limits<std::size_t>::max();
  return by_points ? fmt::format("points={}", goal.max_points) : fmt::format("error={:g}", goal.max_error);
}

Result<PeerRuns> ParsePeerOutput(std::string_view output) {
  PeerRuns runs;
  std::istringstream lines{std::string(output)};
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string seconds_word, points_word;
    double seconds = 0;
    std::size_t points = 0;
    if (!(words >> seconds_word >> seconds >> points_word >> points)) continue;
    if (seconds_word != "seconds" || points_word != "points" || !(seconds > 0)) continue;
    runs.seconds.push_back(seconds);
    runs.points = points;
  }
  if (!runs.seconds.empty()) return runs;
  return MakeError(ErrorCode::kInvalidArgument, "the peer printed no line like `seconds 0.0104 points 1542`, but: {}",
                   output.substr(0, 200));
}

FieldFiles::FieldFiles() : folder_(std::filesystem::temp_directory_path() / fmt::format("terrace-bench-{}", getpid())) {
  std::filesystem::create_directories(folder_);
}

FieldFiles::~FieldFiles() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

Result<std::filesystem::path> FieldFiles::PathOf(const tin::HeightField& field) {
  const auto found = std::find(written_.begin(), written_.end(), &field);
  const std::filesystem::path path = folder_ / fmt::format("{}.f32", found - written_.begin());
  if (found != written_.end()) return path;
  std::ofstream out(path, std::ios::binary);
  for (int y = 0; y < field.height(); ++y) {
    out.write(reinterpret_cast<const char*>(field.Row(y)),
              static_cast<std::streamsize>(sizeof(float)) * static_cast<std::streamsize>(field.width()));
  }
  out.close();
  if (!out) return MakeError(ErrorCode::kUnavailable, "{}: cannot be written; is the disk full?", path.string());
  written_.push_back(&field);
  return path;
}

Result<PeerRuns> RunPeer(const std::string& command, const std::filesystem::path& file, const tin::HeightField& field,
                         const tin::GreedyGoal& goal) {
  const std::string line =
      fmt::format("{} '{}' {} {} {}", command, file.string(), field.width(), field.height(), GoalArgument(goal));
  FILE* pipe = popen(line.c_str(), "r");
  if (pipe == nullptr) return MakeError(ErrorCode::kUnavailable, "{}: cannot be started", line);
  std::string output;
  std::array<char, 4096> buffer{};
  while (const std::size_t size = fread(buffer.data(), 1, buffer.size(), pipe)) output.append(buffer.data(), size);
  if (const int status = pclose(pipe); status != 0) {
    return MakeError(ErrorCode::kUnavailable, "{}: ended with status {}", line, status);
  }
  return ParsePeerOutput(output);
}

}  // namespace terrace::bench
