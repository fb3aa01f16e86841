// terrace_tile_accuracy measures the distance of decoded tiles from every sample of their source, the errors that the
// tiles state, their bytes and their build time, after greedy insertion and after the drop pass. Decisions 17 and 18
// have the results.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "engine/dem/elevation_model.h"
#include "engine/geo/ellipsoid.h"
#include "engine/geo/error_ladder.h"
#include "engine/geo/tile_cover.h"
#include "engine/geo/tile_key.h"
#include "tests/bench/cpu_clock.h"
#include "tests/bench/table.h"
#include "tests/proto/quantized_mesh_decoder.h"
#include "tests/tiler/source_samples.h"
#include "tests/tiler/tile_surface.h"
#include "tiler/tile_pipeline.h"

namespace terrace::bench {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

struct Arguments {
  std::string dem;
  std::vector<int> levels;
  std::vector<int> steps = {0, 12};
  int tiles = 40, runs = 3;
  bool rim = false;
};

// Seconds, the minimum of all runs.
struct Cost {
  double cpu = kNever, warm = kNever, read = kNever, refine = kNever, encode = kNever, compress = kNever;
};

struct Tile {
  tiler::TileRequest request;
  Cost cost;
  std::size_t bytes = 0, vertices = 0, samples = 0;
  double stated = 0, certified = 0, squares = 0, largest = 0;
};

// Tiles of a level and an error, meshed in one way.
struct Sampling {
  std::shared_ptr<const tiler::TilePipeline> cold, warm;  // without refinements, and with those of the tiles
  std::string mesh;
  double error_m = 0;
  std::vector<Tile> tiles;
};

struct Box {
  double west, south, east, north;
};

Box BoxOf(const geo::TileKey& key) {
  const double side = 180.0 / static_cast<double>(geo::TileRows(key.level));
  const double west = side * static_cast<double>(key.x) - 180, south = side * static_cast<double>(key.y) - 90;
  return {west, south, west + side, south + side};
}

bool HasSamples(const tiler::SampleIndex& samples, const geo::TileKey& key) {
  const Box box = BoxOf(key);
  bool has = false;
  samples.ForEach(box.west, box.south, box.east, box.north, [&](const tiler::Sample&) { has = true; });
  return has;
}

// Tiles that are partly outside the source show the floor there, so their errors say nothing about the lattice.
bool IsInside(const tiler::SampleIndex& samples, const geo::TileKey& key) {
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      if (!HasSamples(samples, geo::Neighbour(key, dx, dy))) return false;
    }
  }
  return true;
}

// Random tiles of the level with samples of the source, with equal probability: those inside the source, or those at
// its rim. If there are none of the requested kind, the others.
std::vector<geo::TileKey> Draw(const dem::ElevationModel& model, const tiler::SampleIndex& samples, int level,
                               const Arguments& arguments) {
  std::vector<geo::TileKey> keys;
  for (const geo::TileRange& range : model.Available(level)) {
    for (std::int64_t y = range.start_y; y <= range.end_y; ++y) {
      for (std::int64_t x = range.start_x; x <= range.end_x; ++x) keys.push_back({level, x, y});
    }
  }
  std::ranges::shuffle(keys, std::mt19937_64(7));
  const auto count = static_cast<std::size_t>(arguments.tiles);
  std::vector<geo::TileKey> wanted, others;
  for (const geo::TileKey& key : keys) {
    if (wanted.size() == count) break;
    if (!HasSamples(samples, key)) continue;
    if (IsInside(samples, key) != arguments.rim) {
      wanted.push_back(key);
    } else if (others.size() < count) {
      others.push_back(key);
    }
  }
  return wanted.empty() ? others : wanted;
}

double SquareKilometres(const geo::TileKey& key) {
  const Box box = BoxOf(key);
  const double latitude = (box.south + box.north) / 2, side = box.north - box.south;
  return side * geo::MetresPerDegreeEast(latitude) * side * geo::MetresPerDegreeNorth(latitude) / 1e6;
}

std::shared_ptr<const tiler::TilePipeline> PipelineOf(const std::shared_ptr<const dem::ElevationModel>& model,
                                                      bool compact, std::size_t refinement_bytes) {
  std::vector<tiler::Dataset> datasets(1);
  datasets[0].model = model;
  datasets[0].mesh_options.compact = compact;
  return std::make_shared<const tiler::TilePipeline>(std::move(datasets), refinement_bytes);
}

// In the calling thread.
Result<void> Build(const Sampling& sampling, Tile& tile) {
  double start = ThreadSeconds();
  const Result<tiler::EncodedTile> cold = sampling.cold->Build(tile.request, {});
  if (!cold) return tl::unexpected(cold.error());
  Cost& cost = tile.cost;
  cost.cpu = std::min(cost.cpu, ThreadSeconds() - start);
  const auto least = [](double& best, std::chrono::microseconds now) {
    best = std::min(best, std::chrono::duration<double>(now).count());
  };
  least(cost.read, cold->times.read);
  least(cost.refine, cold->times.refine);
  least(cost.encode, cold->times.encode);
  least(cost.compress, cold->times.compress);
  start = ThreadSeconds();
  const Result<tiler::EncodedTile> warm = sampling.warm->Build(tile.request, {});
  if (!warm) return tl::unexpected(warm.error());
  cost.warm = std::min(cost.warm, ThreadSeconds() - start);
  return {};
}

Result<void> Measure(const Sampling& sampling, const tiler::SampleIndex& samples, Tile& tile) {
  Result<tiler::EncodedTile> encoded = sampling.warm->Build(tile.request, {});
  if (!encoded) return tl::unexpected(encoded.error());
  tile.bytes = encoded->bytes.size();
  tile.vertices = encoded->vertices;
  tile.stated = encoded->max_error_m;
  tile.certified = encoded->certified_error_m.value_or(kNever);
  tiler::TileRequest plain = tile.request;
  plain.coding = tiler::Coding::kIdentity;
  encoded = sampling.warm->Build(plain, {});
  if (!encoded) return tl::unexpected(encoded.error());
  const auto mesh = proto::DecodeQuantizedMesh(encoded->bytes);
  if (!mesh) return MakeError(ErrorCode::kInternal, "{}: cannot be decoded", geo::ToString(plain.key));
  const tiler::TileSurface surface(*mesh, plain.key);
  const Box box = BoxOf(plain.key);
  samples.ForEach(box.west, box.south, box.east, box.north, [&](const tiler::Sample& sample) {
    const double error = surface.ErrorAt(sample);
    if (error < 0) return;
    ++tile.samples;
    tile.squares += error * error;
    tile.largest = std::max(tile.largest, error);
  });
  return {};
}

std::vector<Cell> RowOf(const Sampling& sampling) {
  const double count = static_cast<double>(sampling.tiles.size());
  const int level = sampling.tiles.front().request.key.level;
  const dem::ElevationModel& model = *sampling.cold->datasets().front().model;
  Tile sum;
  sum.cost = {0, 0, 0, 0, 0, 0};
  double square_km = 0, most_certified = 0;
  for (const Tile& tile : sampling.tiles) {
    sum.bytes += tile.bytes, sum.vertices += tile.vertices, sum.samples += tile.samples, sum.squares += tile.squares;
    sum.stated += tile.stated, sum.certified += tile.certified, square_km += SquareKilometres(tile.request.key);
    sum.largest = std::max(sum.largest, tile.largest), most_certified = std::max(most_certified, tile.certified);
    sum.cost.cpu += tile.cost.cpu, sum.cost.warm += tile.cost.warm, sum.cost.read += tile.cost.read,
        sum.cost.refine += tile.cost.refine;
    sum.cost.encode += tile.cost.encode, sum.cost.compress += tile.cost.compress;
  }
  std::int64_t of_level = 0;
  for (const geo::TileRange& range : model.Available(level)) of_level += geo::Cells(range);
  const auto each = [&](double all) { return Milliseconds(all / count); };
  return {fmt::format("{}", level),
          fmt::format("{}", model.LatticeOf(level).cells + 1),
          Number(sampling.error_m, 3),
          sampling.mesh,
          Count(sampling.tiles.size()),
          Number(std::sqrt(sum.squares / static_cast<double>(std::max<std::size_t>(sum.samples, 1))), 3),
          Number(sum.largest, 3),
          Number(sum.stated / count, 3),
          Number(sum.certified / count, 3),
          Number(most_certified, 3),
          Count(sum.vertices / sampling.tiles.size()),
          Count(sum.bytes / sampling.tiles.size()),
          Number(static_cast<double>(sum.bytes) / 1000 / square_km, 3),
          each(sum.cost.cpu),
          each(sum.cost.warm),
          each(sum.cost.read),
          each(sum.cost.refine),
          each(sum.cost.encode),
          each(sum.cost.compress),
          Count(static_cast<std::size_t>(of_level))};
}

// Both meshes take turns, tile by tile, so that other load on the machine affects both.
Result<void> Try(std::vector<Sampling>& meshes, const tiler::SampleIndex& samples, int runs) {
  for (Sampling& sampling : meshes) {
    for (Tile& tile : sampling.tiles) {
      if (const Result<void> done = Measure(sampling, samples, tile); !done) return done;
    }
  }
  for (int run = 0; run < runs; ++run) {
    for (std::size_t i = 0; i < meshes.front().tiles.size(); ++i) {
      for (Sampling& sampling : meshes) {
        if (const Result<void> done = Build(sampling, sampling.tiles[i]); !done) return done;
      }
    }
  }
  return {};
}

Result<void> Run(const Arguments& arguments) {
  auto opened = dem::ElevationModel::Open(arguments.dem);
  if (!opened) return tl::unexpected(opened.error());
  const std::shared_ptr<const dem::ElevationModel> model = *std::move(opened);
  const tiler::SampleIndex samples(tiler::SamplesOf(arguments.dem));
  Table table("tile_accuracy", std::filesystem::path(arguments.dem).filename().string(),
              {"level",    "nodes",      "error, m",  "mesh",         "tiles",
               "RMS, m",   "largest, m", "stated, m", "certified, m", "most certified, m",
               "vertices", "bytes",      "kB/km2",    "cold, ms",     "warm, ms",
               "read",     "refine",     "encode",    "compress",     "tiles of the level"});
  std::vector<int> levels = arguments.levels;
  if (levels.empty()) levels = {model->max_level(), model->max_level() - 1};
  for (const int level : levels) {
    const std::vector<geo::TileKey> keys = Draw(*model, samples, level, arguments);
    if (keys.empty()) return MakeError(ErrorCode::kInvalidArgument, "no tiles with samples at level {}", level);
    for (const int step : arguments.steps) {
      std::vector<Sampling> meshes;
      for (const bool compact : {false, true}) {
        Sampling& sampling = meshes.emplace_back();
        sampling.cold = PipelineOf(model, compact, 0);
        sampling.warm = PipelineOf(model, compact, std::size_t{1} << 30);
        sampling.mesh = compact ? "compact" : "greedy";
        sampling.error_m = geo::LadderError(level, step);
        for (const geo::TileKey& key : keys) {
          Tile& tile = sampling.tiles.emplace_back();
          tile.request.key = key;
          tile.request.error_step = step;
          tile.request.extensions.normals = true;
          tile.request.coding = tiler::Coding::kGzip;
        }
      }
      if (const Result<void> done = Try(meshes, samples, arguments.runs); !done) return done;
      for (const Sampling& sampling : meshes) table.Add(RowOf(sampling));
    }
  }
  table.Print(std::cout);
  return {};
}

}  // namespace
}  // namespace terrace::bench

int main(int argc, char** argv) {
  terrace::bench::Arguments arguments;
  CLI::App app("Measures decoded tiles against every sample of their source, and what building them costs");
  app.add_option("dem", arguments.dem, "A raster")->required()->check(CLI::ExistingFile);
  app.add_option("--levels", arguments.levels, "Levels of the tiles, by default the two deepest ones")
      ->delimiter(',')
      ->check(CLI::Range(0, 24));
  app.add_option("--steps", arguments.steps, "Ladder steps of the error, from -16 (coarse) to 24; by default 0 and 12")
      ->delimiter(',')
      ->check(CLI::Range(-16, 24));
  app.add_flag("--rim", arguments.rim, "Tiles at the source's rim in place of those inside it");
  app.add_option("--tiles", arguments.tiles, "How many tiles of a level, at most")->check(CLI::PositiveNumber);
  app.add_option("--runs", arguments.runs, "Runs; the fastest of each tile counts")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  spdlog::set_level(spdlog::level::err);
  const terrace::Result<void> done = terrace::bench::Run(arguments);
  if (done) return 0;
  std::fprintf(stderr, "terrace_tile_accuracy: %s\n", done.error().message.c_str());
  return 1;
}
