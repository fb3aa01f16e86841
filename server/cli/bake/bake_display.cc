#include "server/cli/bake/bake_display.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "engine/core/elapsed_time.h"
#include "engine/core/plain_number.h"

namespace terrace::cli {
namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

std::string Print(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

const char* OutcomeName(bake::UnitOutcome outcome) {
  constexpr const char* kNames[] = {"baked", "kept", "copied", "failed", "missing", "unusable"};  // by value
  return kNames[static_cast<std::size_t>(outcome)];
}

}  // namespace

std::string Duration(double seconds) {
  if (seconds < 100) return fmt::format("{:.0f} s", seconds);
  if (seconds < 6000) return fmt::format("{:.0f} min", seconds / 60);
  return fmt::format("{:.1f} h", seconds / 3600);
}

std::string Bytes(double bytes) {
  constexpr std::array<const char*, 6> kUnits = {"bytes", "kB", "MB", "GB", "TB", "PB"};
  std::size_t unit = 0;
  while (bytes >= 1000 && unit + 1 < kUnits.size()) {
    bytes /= 1000;
    ++unit;
  }
  return fmt::format("{:.{}f} {}", bytes, unit == 0 ? 0 : 1, kUnits[unit]);
}

BakeDisplay::BakeDisplay(std::string name, std::uint64_t tiles, std::uint64_t units, const bake::Counters& counters)
    : name_(std::move(name)),
      tiles_(tiles),
      units_(units),
      counters_(counters),
      terminal_(::isatty(STDERR_FILENO) != 0),
      start_(Clock::now()) {
  thread_ = std::jthread([this](const std::stop_token& stop) {
    const auto pause = terminal_ ? std::chrono::milliseconds(250) : std::chrono::milliseconds(10'000);
    std::unique_lock lock(mutex_);
    while (!ended_.wait_for(lock, stop, pause, [&stop] { return stop.stop_requested(); })) Show();
  });
}

BakeDisplay::~BakeDisplay() {
  thread_.request_stop();
  thread_.join();
  if (shown_ && terminal_) std::fputs("\r\033[K", stderr);
}

void BakeDisplay::Show() {
  shown_ = true;
  std::fprintf(stderr, terminal_ ? "\r%s\033[K" : "%s\n", Line().c_str());
  std::fflush(stderr);
}

std::string BakeDisplay::Line() const {
  const double seconds = SecondsSince(start_);
  const std::uint64_t built = counters_.tiles, skipped = counters_.skipped;
  const std::uint64_t done = std::min(built + skipped, tiles_);
  const double pace = seconds > 0 ? static_cast<double>(built) / seconds : 0;
  std::string left;
  if (pace > 0 && built > 0) left = ", " + Duration(static_cast<double>(tiles_ - done) / pace) + " left";
  return fmt::format("terrace: baking {}: {} of {} tiles, {:.0f} tiles/s, {}, {} of {} files{}", name_, Grouped(done),
                     Grouped(tiles_), pace, Bytes(static_cast<double>(counters_.bytes.load())), counters_.units.load(),
                     units_, left);
}

std::string UnitJson(const bake::UnitReport& report, const std::vector<bake::Target>& targets) {
  Json json;
  json["unit"] = report.entry.name;
  json["format"] = archive::FolderOf(targets[report.target].manifest.kind.format);
  json["outcome"] = OutcomeName(report.outcome);
  json["key"] = fmt::format("{:016x}", report.entry.key);
  json["tiles"] = report.entry.tiles;
  json["bytes"] = report.entry.bytes;
  json["xxh3"] = report.entry.xxh3;
  json["seconds"] = std::round(report.seconds * 1000) / 1000;
  if (!report.message.empty()) json["message"] = report.message;
  return Print(json);
}

std::string SummaryJson(const BakeSummary& summary, const bake::Counters& counters) {
  const auto milliseconds = [&](const std::atomic<std::uint64_t>& stage) {
    const double each = static_cast<double>(stage) / 1000 / std::max(1.0, static_cast<double>(counters.tiles));
    return std::round(each * 10000) / 10000;
  };
  Json json;
  json["place"] = summary.place;
  json["complete"] = summary.is_complete;
  json["tiles"] = summary.tiles;
  json["bytes"] = summary.bytes;
  json["units"] = {{"baked", summary.baked},   {"kept", summary.kept},       {"copied", summary.copied},
                   {"failed", summary.failed}, {"missing", summary.missing}, {"unusable", summary.unusable}};
  json["built_tiles"] = summary.built_tiles;
  json["seconds"] = std::round(summary.seconds * 1000) / 1000;
  json["tiles_per_second"] = std::round(static_cast<double>(summary.built_tiles) / std::max(summary.seconds, 1e-3));
  json["milliseconds_per_tile"] = {{"read", milliseconds(counters.read)},
                                   {"refine", milliseconds(counters.refine)},
                                   {"encode", milliseconds(counters.encode)},
                                   {"compress", milliseconds(counters.compress)}};
  return Print({{"summary", json}});
}

std::string SummaryText(const BakeSummary& summary) {
  std::string text =
      fmt::format("{}: {} tiles, {}, {} files", summary.place, Grouped(summary.tiles),
                  Bytes(static_cast<double>(summary.bytes)), summary.baked + summary.kept + summary.copied);
  for (const auto& [count, what] : {std::pair(summary.kept, "were there"), std::pair(summary.copied, "copied"),
                                    std::pair(summary.missing, "missing"), std::pair(summary.unusable, "unusable"),
                                    std::pair(summary.failed, "failed")}) {
    if (count > 0) text += fmt::format(", {} {}", count, what);
  }
  if (summary.built_tiles > 0) {
    text += fmt::format("; built {} tiles in {}, {:.0f} tiles/s", Grouped(summary.built_tiles),
                        Duration(summary.seconds), static_cast<double>(summary.built_tiles) / summary.seconds);
  }
  return text;
}

std::string EstimateJson(const bake::Estimate& estimate) {
  Json json;
  json["tiles"] = estimate.tiles;
  json["files"] = estimate.files;
  json["subtrees"] = estimate.subtree_files;
  json["bytes"] = std::round(estimate.bytes);
  json["core_hours"] = estimate.core_hours;
  json["sampled_tiles"] = estimate.sampled;
  for (const bake::LevelEstimate& level : estimate.levels) {
    json["levels"].push_back({{"format", level.format},
                              {"level", level.level},
                              {"tiles", level.tiles},
                              {"bytes_per_tile", std::round(level.bytes_per_tile)},
                              {"milliseconds_per_tile", level.milliseconds_per_tile}});
  }
  return Print(json);
}

std::string EstimateText(const bake::Estimate& estimate) {
  std::string text =
      fmt::format("{:<8} {:>5} {:>15} {:>12} {:>10}\n", "format", "level", "tiles", "bytes/tile", "ms/tile");
  for (const bake::LevelEstimate& level : estimate.levels) {
    fmt::format_to(std::back_inserter(text), "{:<8} {:>5} {:>15} {:>12.0f} {:>10.2f}\n", level.format, level.level,
                   Grouped(level.tiles), level.bytes_per_tile, level.milliseconds_per_tile);
  }
  const std::string hours = estimate.core_hours < 0.1 ? fmt::format("{:.1f} core-minutes", estimate.core_hours * 60)
                                                      : fmt::format("{:.1f} core-hours", estimate.core_hours);
  fmt::format_to(std::back_inserter(text), "{} tiles in {} files ({} subtrees), about {} and {}; {}\n",
                 Grouped(estimate.tiles), Grouped(estimate.files), Grouped(estimate.subtree_files),
                 Bytes(estimate.bytes), hours,
                 estimate.sampled > 0 ? fmt::format("from {} tiles that were built", estimate.sampled)
                                      : std::string("from the assumed bytes and milliseconds a tile"));
  return text;
}

}  // namespace terrace::cli
