#include "tests/bench/machine.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <memory>
#include <thread>

#include "tests/support/source_dir.h"

namespace terrace::bench {
namespace {

std::string CpuModel() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    const std::size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown";
}

std::string Date() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text.data();
}

nlohmann::ordered_json Load() {
  double one_minute = 0;
  if (getloadavg(&one_minute, 1) != 1) return "unknown";
  return std::round(one_minute * 10) / 10;
}

}  // namespace

std::string FirstLineOf(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  std::array<char, 512> line{};
  if (!pipe || fgets(line.data(), static_cast<int>(line.size()), pipe.get()) == nullptr) return "";
  std::string text = line.data();
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  return text;
}

nlohmann::ordered_json MachineContext() {
  const std::string commit =
      FirstLineOf("git -C '" + test_support::SourceDir().string() + "' describe --always --dirty 2> /dev/null");
  return {{"cpu", CpuModel()},
          {"cores", std::thread::hardware_concurrency()},
          {"load", Load()},
          {"compiler", TERRACE_BENCH_COMPILER},
          {"flags", TERRACE_BENCH_FLAGS},
          {"commit", commit.empty() ? "unknown" : commit},
          {"date", Date()}};
}

}  // namespace terrace::bench
