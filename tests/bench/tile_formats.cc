// terrace_tile_formats measures the CPU time on one core and the bytes of tiles in every format and coding. It runs the
// whole pipeline on a block of tiles in the middle of a level. docs/formats/glb.md has the results.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "engine/dem/elevation_model.h"
#include "tests/bench/cpu_clock.h"
#include "tests/bench/table.h"
#include "tiler/tile_pipeline.h"

namespace terrace::bench {
namespace {

using proto::GlbCompression;
using tiler::Coding;
using tiler::TileFormat;

struct Arguments {
  std::string dem, form;
  int level = 0, step = 0, tiles = 24, runs = 3;
};

struct Variant {
  std::string name;
  TileFormat format = TileFormat::kGlb;
  GlbCompression compression = GlbCompression::kDraco;
  Coding coding = Coding::kIdentity;
  proto::DracoOptions draco = {};
};

std::vector<Variant> Variants() {
  std::vector<Variant> variants;
  const auto both = [&](Variant variant) {
    variants.push_back(variant);
    variant.name += ", gzip";
    variant.coding = Coding::kGzip;
    variants.push_back(variant);
  };
  both({"quantized-mesh with normals", TileFormat::kQuantizedMesh});
  both({"draco"});
  for (const int speed : {0, 3, 5, 10}) {
    variants.push_back({.name = fmt::format("draco, speed {}", speed), .draco = {.speed = speed}});
  }
  both({.name = "meshopt", .compression = GlbCompression::kMeshopt});
  both({.name = "quantized", .compression = GlbCompression::kQuantized});
  both({.name = "none", .compression = GlbCompression::kNone});
  return variants;
}

// The first tiles of the level's first block that are not on its rim.
std::vector<geo::TileKey> TilesOf(const dem::ElevationModel& model, const Arguments& arguments) {
  const geo::TileRange& range = model.Available(arguments.level).front();
  std::vector<geo::TileKey> keys;
  for (std::int64_t y = range.start_y + 1; y < range.end_y; ++y) {
    for (std::int64_t x = range.start_x + 1; x < range.end_x; ++x) {
      if (keys.size() < static_cast<std::size_t>(arguments.tiles)) keys.push_back({arguments.level, x, y});
    }
  }
  return keys;
}

struct Cost {
  double cold_s = std::numeric_limits<double>::infinity(), warm_s = cold_s;  // of a tile, the best run's mean
  std::size_t tiles = 0, bytes = 0, vertices = 0;                            // of all tiles
};

// Builds all tiles without a cached refinement, then with it.
Result<void> Measure(const Variant& variant, const Arguments& arguments, Cost& cost) {
  auto source = dem::ElevationModel::Open(arguments.dem);
  if (!source) return tl::unexpected(source.error());
  const std::vector<geo::TileKey> keys = TilesOf(**source, arguments);
  if (keys.empty()) return MakeError(ErrorCode::kInvalidArgument, "no tiles inside level {}", arguments.level);
  cost.tiles = keys.size();
  std::vector<tiler::Dataset> datasets(1);
  datasets[0].model = *std::move(source);
  datasets[0].glb.draco = variant.draco;
  const tiler::TilePipeline pipeline(std::move(datasets), std::size_t{1} << 30);
  for (double* const best : {&cost.cold_s, &cost.warm_s}) {
    cost.bytes = cost.vertices = 0;
    const double start = ThreadSeconds();
    for (const geo::TileKey& key : keys) {
      tiler::TileRequest request;
      request.key = key;
      request.error_step = arguments.step;
      request.format = variant.format;
      request.compression = variant.compression;
      request.coding = variant.coding;
      request.extensions.normals = variant.format == TileFormat::kQuantizedMesh;
      const Result<tiler::EncodedTile> tile = pipeline.Build(request, {});
      if (!tile) return tl::unexpected(tile.error());
      cost.bytes += tile->bytes.size();
      cost.vertices += tile->vertices;
    }
    *best = std::min(*best, (ThreadSeconds() - start) / static_cast<double>(keys.size()));
  }
  return {};
}

// All formats take turns, so that other load on the machine affects all of them.
Result<void> Run(const Arguments& arguments) {
  std::vector<Variant> variants = Variants();
  std::erase_if(variants,
                [&](const Variant& variant) { return variant.name.find(arguments.form) == std::string::npos; });
  if (variants.empty()) return MakeError(ErrorCode::kInvalidArgument, "no form is called \"{}\"", arguments.form);
  std::vector<Cost> costs(variants.size());
  for (int run = 0; run < arguments.runs; ++run) {
    for (std::size_t i = 0; i < variants.size(); ++i) {
      if (const Result<void> done = Measure(variants[i], arguments, costs[i]); !done) return done;
    }
  }
  Table table("tile_formats",
              fmt::format("{} tiles of {}, level {}, ladder step {}", costs[0].tiles,
                          std::filesystem::path(arguments.dem).filename().string(), arguments.level, arguments.step),
              {"format", "bytes in all", "bytes a tile", "vertices", "cold, ms", "cold, tiles/s", "warm, ms",
               "warm, tiles/s", "warm, of the first"});
  for (std::size_t i = 0; i < variants.size(); ++i) {
    const Cost& cost = costs[i];
    table.Add({variants[i].name, Count(cost.bytes), Count(cost.bytes / cost.tiles), Count(cost.vertices / cost.tiles),
               Milliseconds(cost.cold_s), fmt::format("{:.0f}", 1 / cost.cold_s), Milliseconds(cost.warm_s),
               fmt::format("{:.0f}", 1 / cost.warm_s), Ratio(cost.warm_s / costs[0].warm_s)});
  }
  table.Print(std::cout);
  return {};
}

}  // namespace
}  // namespace terrace::bench

int main(int argc, char** argv) {
  terrace::bench::Arguments arguments;
  CLI::App app("Measures the cost of a tile in every format: cold, and with its refinement in the cache");
  app.add_option("dem", arguments.dem, "A raster")->required()->check(CLI::ExistingFile);
  app.add_option("--level", arguments.level, "Level of the tiles")->required()->check(CLI::Range(0, 24));
  app.add_option("--step", arguments.step, "Ladder step of the error, from -16 (coarse) to 24")
      ->check(CLI::Range(-16, 24));
  app.add_option("--tiles", arguments.tiles, "How many tiles, at most")->check(CLI::PositiveNumber);
  app.add_option("--form", arguments.form, "Only forms with this in their name");
  app.add_option("--runs", arguments.runs, "Runs; the fastest counts")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  spdlog::set_level(spdlog::level::err);  // a raster would repeat its warnings in each run
  const terrace::Result<void> done = terrace::bench::Run(arguments);
  if (done) return 0;
  std::fprintf(stderr, "terrace_tile_formats: %s\n", done.error().message.c_str());
  return 1;
}
