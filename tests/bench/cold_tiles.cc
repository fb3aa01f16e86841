// terrace_cold_tiles measures how many tiles a second the pipeline builds on a number of threads, without HTTP, caches
// or queues, and how long the stages of a tile take: milliseconds a tile on the clock, and of the processor in user
// mode. tests/load/cold_storm.py compares a server with it. "hash" is one of all tiles and their errors: builds of the
// same bytes print the same.
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <xxhash.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "config/file/parse.h"
#include "server/cli/common/open_cache.h"
#include "server/cli/common/open_dataset.h"
#include "tiler/tile_pipeline.h"

namespace terrace::bench {
namespace {

struct Arguments {
  std::string config, dataset, tiles;
  unsigned threads = std::max(std::thread::hardware_concurrency(), 1u);
  unsigned rounds = 1;
  bool normals = false;
};

// Processor time of this process in user mode, milliseconds.
double UserTime() {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  return static_cast<double>(used.ru_utime.tv_sec) * 1e3 + static_cast<double>(used.ru_utime.tv_usec) / 1e3;
}

// Does not depend on the order of the tiles.
std::uint64_t HashOf(const geo::TileKey& key, const tiler::EncodedTile& tile) {
  const std::string errors =
      fmt::format("{} {} {}", geo::ToString(key), tile.max_error_m, tile.certified_error_m.value_or(-1));
  return XXH3_64bits_withSeed(tile.bytes.data(), tile.bytes.size(), XXH3_64bits(errors.data(), errors.size()));
}

// One key a line: "/maui/12/252/2520.terrain".
Result<std::vector<geo::TileKey>> ReadKeys(const std::string& file) {
  std::ifstream lines(file);
  std::vector<geo::TileKey> keys;
  for (std::string line; std::getline(lines, line);) {
    geo::TileKey key;
    long long x = 0, y = 0;
    if (std::sscanf(line.c_str(), "/%*[^/]/%d/%lld/%lld.terrain", &key.level, &x, &y) != 3) {
      return MakeError(ErrorCode::kInvalidArgument, "{}: \"{}\" is no tile such as /maui/12/252/2520.terrain", file,
                       line);
    }
    key.x = x;
    key.y = y;
    keys.push_back(key);
  }
  return keys;
}

Result<std::vector<tiler::Dataset>> Open(const Arguments& arguments) {
  const config::ConfigResult config = config::LoadConfig(arguments.config);
  if (!config) return MakeError(ErrorCode::kInvalidArgument, "{}: {}", arguments.config, config.error()[0].message);
  for (const config::DatasetConfig& wanted : config->datasets) {
    if (wanted.name != arguments.dataset) continue;
    auto dataset = cli::OpenDataset(wanted, cli::OpenStatisticsCache(*config), "bench");
    if (!dataset) return tl::unexpected(dataset.error());
    return std::vector<tiler::Dataset>{*std::move(dataset)};
  }
  return MakeError(ErrorCode::kInvalidArgument, "{} has no dataset {}", arguments.config, arguments.dataset);
}

Result<void> Run(const Arguments& arguments) {
  const Result<std::vector<geo::TileKey>> keys = ReadKeys(arguments.tiles);
  if (!keys) return tl::unexpected(keys.error());
  Result<std::vector<tiler::Dataset>> datasets = Open(arguments);
  if (!datasets) return tl::unexpected(datasets.error());
  const tiler::TilePipeline pipeline(*std::move(datasets), 0);  // no tile is a replay of an earlier one

  std::atomic<std::size_t> next{0}, bytes{0}, failed{0};
  std::atomic<std::uint64_t> hash{0};
  std::atomic<std::int64_t> read{0}, refine{0}, encode{0}, compress{0};  // microseconds
  const std::size_t builds = keys->size() * arguments.rounds;
  const auto work = [&] {
    for (std::size_t i = next++; i < builds; i = next++) {
      tiler::TileRequest request;
      request.key = (*keys)[i % keys->size()];
      request.coding = tiler::Coding::kGzip;
      request.extensions.normals = arguments.normals;
      const Result<tiler::EncodedTile> tile = pipeline.Build(request, {});
      if (!tile) ++failed;
      if (!tile) continue;
      bytes += tile->bytes.size();
      hash += HashOf(request.key, *tile);
      read += tile->times.read.count();
      refine += tile->times.refine.count();
      encode += tile->times.encode.count();
      compress += tile->times.compress.count();
    }
  };
  const auto begun = std::chrono::steady_clock::now();
  const double used_before = UserTime();
  std::vector<std::jthread> threads;
  for (unsigned i = 0; i < arguments.threads; ++i) threads.emplace_back(work);
  threads.clear();  // joins
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begun;
  const auto each = [&](const std::atomic<std::int64_t>& stage) {
    return static_cast<double>(stage) / 1000 / static_cast<double>(std::max<std::size_t>(builds - failed, 1));
  };
  fmt::print(
      "{{\"tiles\": {}, \"bytes\": {}, \"hash\": \"{:016x}\", \"errors\": {}, \"seconds\": {:.3f}, "
      "\"read_ms\": {:.3f}, \"refine_ms\": {:.3f}, \"encode_ms\": {:.3f}, \"compress_ms\": {:.3f}, \"user_ms\": "
      "{:.4f}}}\n",
      builds, bytes.load(), hash.load(), failed.load(), seconds.count(), each(read), each(refine), each(encode),
      each(compress), (UserTime() - used_before) / static_cast<double>(builds));
  return {};
}

}  // namespace
}  // namespace terrace::bench

int main(int argc, char** argv) {
  terrace::bench::Arguments arguments;
  CLI::App app("Builds tiles of a dataset as its server would, each once, and prints one line of JSON");
  app.add_option("config", arguments.config, "A server's configuration")->required()->check(CLI::ExistingFile);
  app.add_option("dataset", arguments.dataset, "The name of one of its datasets")->required();
  app.add_option("tiles", arguments.tiles, "A file of paths, one on each line")->required()->check(CLI::ExistingFile);
  app.add_option("--threads", arguments.threads, "As many builds at a time")->check(CLI::PositiveNumber);
  app.add_option("--rounds", arguments.rounds, "Builds each tile as many times")->check(CLI::PositiveNumber);
  app.add_flag("--normals", arguments.normals, "Tiles with octvertexnormals");
  CLI11_PARSE(app, argc, argv);
  spdlog::set_level(spdlog::level::err);
  const terrace::Result<void> done = terrace::bench::Run(arguments);
  if (done) return 0;
  std::fprintf(stderr, "terrace_cold_tiles: %s\n", done.error().message.c_str());
  return 1;
}
