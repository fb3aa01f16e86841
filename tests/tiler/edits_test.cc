// Tiles of a dataset with edits: edges, errors, holes, and what does not change.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "engine/dem/tile_edits.h"
#include "engine/geo/ellipsoid.h"
#include "engine/geo/error_ladder.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/proto/glb_decoder.h"
#include "tests/proto/quantized_mesh_decoder.h"
#include "tests/support/scratch_directory.h"
#include "tests/support/source_dir.h"
#include "tests/tiler/decoded_error.h"
#include "tests/tiler/edit_kinds.h"
#include "tests/tiler/fetched_tile.h"
#include "tests/tiler/source_samples.h"
#include "tests/tiler/tile_surface.h"
#include "tiler/tile_pipeline.h"

namespace terrace::tiler {
namespace {

class Edits : public testing::Test {
 protected:
  TilePipeline Open(const std::vector<std::string>& features, MeshOptions mesh = {}) {
    dem::DemOptions options;
    if (!features.empty()) {
      const std::string path = dir_.path() / fmt::format("{}.geojson", files_++);
      std::ofstream file(path);
      file << R"({"type":"FeatureCollection","features":[)";
      for (std::size_t i = 0; i < features.size(); ++i) file << (i > 0 ? "," : "") << features[i];
      file << "]}";
      std::filesystem::copy_file(test_support::SourceDir() / "config/samples/etopo5.tif", dir_.path() / "etopo5.tif",
                                 std::filesystem::copy_options::skip_existing);
      options.edits = {path};
    }
    auto source = dem::ElevationModel::Open(Jacksboro(), options);
    EXPECT_TRUE(source.has_value()) << (source ? "" : source.error().message);
    Dataset dataset;
    dataset.name = "edited";
    dataset.mesh_options = mesh;
    if (source) dataset.model = *std::move(source);
    dataset.generation = dataset.model->fingerprint();
    dataset.unedited_generation = dataset.model->unedited_fingerprint();
    std::vector<Dataset> datasets;
    datasets.push_back(std::move(dataset));
    return TilePipeline(std::move(datasets));
  }

 private:
  const test_support::ScratchDirectory dir_;
  int files_ = 0;
};

geo::TileKey TileAt(int level, std::int64_t dx = 0, std::int64_t dy = 0) {
  const double side = 180.0 / static_cast<double>(geo::TileRows(level));
  return {level, static_cast<std::int64_t>((kLongitude + 180) / side) + dx,
          static_cast<std::int64_t>((kLatitude + 90) / side) + dy};
}

TileRequest RequestFor(const geo::TileKey& key, int step) {
  TileRequest request;
  request.key = key;
  request.error_step = step;
  return request;
}

const dem::ElevationModel& ModelOf(const TilePipeline& pipeline) { return *pipeline.datasets().front().model; }

constexpr std::array kSteps = {-8, 0, 8, 20};
constexpr std::array kLevels = {9, 11, 12};
constexpr std::array kMeshes = {MeshOptions{}, MeshOptions{tin::Criterion::kDataDependent, false},
                                MeshOptions{tin::Criterion::kDelaunay, true}};

using TilesByPlace = std::map<std::pair<std::int64_t, std::int64_t>, FetchedTile>;

// Compares all common edges: positions, heights and normals. Returns their number.
int ExpectEqualEdges(const TilesByPlace& tiles, const std::string& where) {
  int compared = 0;
  for (const auto& [at, tile] : tiles) {
    for (const bool is_east : {true, false}) {
      const auto next = tiles.find({at.first + (is_east ? 1 : 0), at.second + (is_east ? 0 : 1)});
      if (next == tiles.end()) continue;
      EXPECT_EQ(EdgeOf(tile, is_east, 32767), EdgeOf(next->second, is_east, 0)) << where;
      ++compared;
    }
  }
  return compared;
}

// Of 4 x 4 tiles.
TEST_F(Edits, LeaveEdgesOfNeighboursEqual) {
  for (const auto& [kind, feature] : Kinds()) {
    for (const MeshOptions& mesh : kMeshes) {
      const TilePipeline pipeline = Open({feature}, mesh);
      for (const int level : kLevels) {
        for (const int step : kSteps) {
          TilesByPlace tiles;
          for (int dy = -2; dy <= 1; ++dy) {
            for (int dx = -2; dx <= 1; ++dx) {
              const geo::TileKey key = TileAt(level, dx, dy);
              if (ModelOf(pipeline).IsAvailable(key)) tiles[{dx, dy}] = FetchTile(pipeline, RequestFor(key, step));
            }
          }
          ASSERT_TRUE(ExpectEqualEdges(tiles, fmt::format("{} {} {}", kind, level, step)) >= 4 && !HasFailure());
        }
      }
    }
  }
}

// The distance that quantized-mesh may leave at a node although it and all of its neighbours are vertices. Positions
// are 32767ths of a tile, which is the more the steeper the ground is beside the node. Heights are 32767ths of a tile's
// range; on edges multiples of a step that both tiles have, 2^k from a 16384th of the larger range on (edge_steps.h).
double LeastInFormat(const dem::ElevationModel& model, const geo::TileKey& key, const FetchedTile& mesh,
                     const dem::TileHeights& tile, std::size_t k) {
  const int cells = tile.lattice.cells, x = static_cast<int>(k) % (cells + 1), y = static_cast<int>(k) / (cells + 1);
  const int east = x == 0 ? -1 : (x == cells ? 1 : 0), north = y == 0 ? -1 : (y == cells ? 1 : 0);
  double step = static_cast<double>(mesh.mesh.max_height - mesh.mesh.min_height) / 32767;
  if (east != 0 || north != 0) {
    double range = 0;
    for (const auto& [dx, dy] : {std::pair{0, 0}, {east, 0}, {0, north}, {east, north}}) {
      const dem::HeightRange of = model.RangeBound(geo::Neighbour(key, dx, dy));
      range = std::max(range, of.max - of.min);
    }
    step = 0x1p-10;
    while (step < range / 16384) step *= 2;
  }
  double low = std::numeric_limits<double>::infinity(), high = -low;  // of the nodes around, on an edge along it
  for (const int i : {-1, 0, 1}) {
    for (const int j : {-1, 0, 1}) {
      if ((east != 0 && i != 0) || (north != 0 && j != 0)) continue;
      const auto height = static_cast<double>(tile.At(x + i, y + j));
      low = std::min(low, height), high = std::max(high, height);
    }
  }
  const double across = (high - low) * ((east == 0 ? 1 : 0) + (north == 0 ? 1 : 0));
  return step / 2 + across * cells / (2 * 32767.0);
}

// The share of nodes of the tile for which the edits ask more, each measured by an independent decoder.
TEST_F(Edits, KeepThePrecisionAtEverySample) {
  for (const MeshOptions& mesh : kMeshes) {
    for (const char* kind : {"precision", "factor", "precision beside a corner"}) {
      const TilePipeline pipeline = Open({Kinds().at(kind)}, mesh);
      std::size_t limited = 0, exceeded = 0;
      for (const int level : kLevels) {
        for (const int step : kSteps) {
          for (const auto& [dx, dy] : {std::pair{0, 0}, {-1, 0}, {0, -1}, {-1, -1}}) {
            const geo::TileKey key = TileAt(level, dx, dy);
            const FetchedTile tile = FetchTile(pipeline, RequestFor(key, step));
            const auto heights = ModelOf(pipeline).Read(key);
            ASSERT_TRUE(heights.has_value());
            const dem::MeshDemands demands = dem::TileEdits(ModelOf(pipeline)).DemandsOf(key);
            const std::vector<double> errors = DecodedErrors(tile.mesh, *heights);
            const double error_m = geo::LadderError(level, step);
            for (std::size_t k = 0; k < demands.weights.size(); ++k) {
              const double allowed =
                  std::min(error_m / static_cast<double>(demands.weights[k]), static_cast<double>(demands.caps[k]));
              if (allowed >= error_m) continue;
              ++limited;
              const double least =
                  std::max(allowed, LeastInFormat(ModelOf(pipeline), key, tile, *heights, k)) + 0x1p-11;
              EXPECT_LE(errors[k], least) << kind << " " << geo::ToString(key) << " step " << step;
              exceeded += errors[k] > least ? 1 : 0;
            }
          }
        }
      }
      EXPECT_GT(limited, 1000u);
      EXPECT_EQ(exceeded, 0u);
    }
  }
}

// Bounds of centimetres beside a cliff of 60 m: the border rule has the same limits.
TEST_F(Edits, KeepCentimetresBesideCliffs) {
  const TilePipeline pipeline = Open({Feature(R"({"op":"offset","metres":60})", Polygon()),
                                      Feature(R"({"op":"precision","error_m":0.02,"blend_m":300})", Polygon())});
  std::size_t limited = 0, on_edges = 0;
  for (const int level : {11, 12, 13}) {
    for (const auto& [dx, dy] : {std::pair{0, 0}, {-1, 0}, {0, -1}, {-1, -1}}) {
      const geo::TileKey key = TileAt(level, dx, dy);
      const FetchedTile tile = FetchTile(pipeline, RequestFor(key, 0));
      const auto heights = ModelOf(pipeline).Read(key);
      ASSERT_TRUE(heights.has_value());
      const dem::MeshDemands demands = dem::TileEdits(ModelOf(pipeline)).DemandsOf(key);
      const std::vector<double> errors = DecodedErrors(tile.mesh, *heights);
      const int cells = heights->lattice.cells;
      for (std::size_t k = 0; k < demands.caps.size(); ++k) {
        const auto allowed = static_cast<double>(demands.caps[k]);
        if (allowed > 0.05) continue;
        ++limited;
        const int x = static_cast<int>(k) % (cells + 1), y = static_cast<int>(k) / (cells + 1);
        on_edges += x == 0 || y == 0 || x == cells || y == cells ? 1 : 0;
        const double least = LeastInFormat(ModelOf(pipeline), key, tile, *heights, k);
        EXPECT_LE(errors[k], std::max(allowed, least) + 0x1p-11) << geo::ToString(key) << " " << x << " " << y;
      }
    }
  }
  EXPECT_GT(limited, 1000u);
  EXPECT_GT(on_edges, 100u);
}

// Of up to 60 tiles of a level below the sources' deepest: common edges, and the precision at every sample.
void ExpectEdgesAndPrecision(const TilePipeline& pipeline, int level, int step) {
  const dem::ElevationModel& model = ModelOf(pipeline);
  TilesByPlace tiles;
  for (const geo::TileRange& range : model.Available(level)) {
    for (std::int64_t y = range.start_y; y <= range.end_y && tiles.size() < 60; ++y) {
      for (std::int64_t x = range.start_x; x <= range.end_x; ++x)
        tiles[{x, y}] = FetchTile(pipeline, RequestFor({level, x, y}, step));
    }
  }
  EXPECT_GE(ExpectEqualEdges(tiles, fmt::format("{} {}", level, step)), 4) << level;
  std::size_t limited = 0;
  for (const auto& [at, tile] : tiles) {
    const geo::TileKey key{level, at.first, at.second};
    const auto heights = model.Read(key);
    ASSERT_TRUE(heights.has_value());
    const dem::MeshDemands demands = dem::TileEdits(model).DemandsOf(key);
    const std::vector<double> errors = DecodedErrors(tile.mesh, *heights);
    for (std::size_t k = 0; k < demands.caps.size(); ++k) {
      const auto allowed = static_cast<double>(demands.caps[k]);
      if (allowed > 0.25) continue;
      ++limited;
      EXPECT_LE(errors[k], std::max(allowed, LeastInFormat(model, key, tile, *heights, k)) + 0x1p-11)
          << geo::ToString(key) << " step " << step;
    }
  }
  EXPECT_GT(limited, 30u) << level;
}

// Below the deepest level of the sources: edges of neighbours at four errors, with all kinds of meshes, and the
// precision.
TEST_F(Edits, GoDeeperWherePrecisionAsksForIt) {
  const std::string small = fmt::format(R"({{"type":"Polygon","coordinates":[[{},{},{},{},{}]]}})",
                                        Position(-0.0011, -0.0004), Position(0.0010, -0.0002), Position(0.0009, 0.0005),
                                        Position(-0.0012, 0.0003), Position(-0.0011, -0.0004));
  const std::vector<std::string> features = {Feature(R"({"op":"flatten","height":"mean","blend_m":15})", small),
                                             Feature(R"({"op":"precision","error_m":0.2,"blend_m":20})", small)};
  const TilePipeline plain = Open({}), pipeline = Open(features);
  const dem::ElevationModel& model = ModelOf(pipeline);
  const int finest = ModelOf(plain).max_level(), deepest = model.max_level();
  ASSERT_EQ(model.max_source_level(), finest);
  ASSERT_GT(deepest, finest + 1);
  for (const MeshOptions& mesh : kMeshes) {
    const TilePipeline meshed = Open(features, mesh);
    for (int level = finest + 1; level <= deepest; ++level) {
      for (const int step : kSteps) ExpectEdgesAndPrecision(meshed, level, step);
    }
  }
  // Elsewhere the deepest tiles stay as they are, whatever a request asks for.
  const geo::TileKey beside = TileAt(finest, -4, 3);
  ASSERT_EQ(dem::TileEdits(model).Hash(beside), 0u);
  for (const TileFormat format : {TileFormat::kQuantizedMesh, TileFormat::kGlb}) {
    for (const bool metadata : {false, true}) {
      for (const int step : kSteps) {
        TileRequest request = RequestFor(beside, step);
        request.format = format;
        request.extensions.metadata = metadata;
        EXPECT_EQ(TileEditsHash(model, request), 0u);
        const auto a = plain.Build(request, {}), b = pipeline.Build(request, {});
        ASSERT_TRUE(a.has_value() && b.has_value());
        EXPECT_EQ(a->bytes, b->bytes) << step;
      }
    }
  }
}

TEST_F(Edits, LeaveTheBytesOfTilesThatTheyDoNotTouch) {
  const TilePipeline plain = Open({});
  for (const auto& [kind, feature] : Kinds()) {
    const TilePipeline edited = Open({feature});
    int same = 0, touched = 0, differ = 0;
    for (int level = 0; level <= ModelOf(plain).max_level(); ++level) {
      for (int dy = -3; dy <= 3; ++dy) {
        for (int dx = -3; dx <= 3; ++dx) {
          const geo::TileKey key = TileAt(level, dx, dy);
          if (!ModelOf(plain).IsAvailable(key)) continue;
          for (const TileFormat format : {TileFormat::kQuantizedMesh, TileFormat::kGlb}) {
            TileRequest request = RequestFor(key, 0);
            request.format = format;
            const auto a = plain.Build(request, {}), b = edited.Build(request, {});
            ASSERT_TRUE(a.has_value() && b.has_value());
            const bool is_touched = dem::TileEdits(ModelOf(edited)).Hash(key) != 0;
            if (is_touched) {
              ++touched;
              differ += a->bytes != b->bytes ? 1 : 0;
            } else {
              ++same;
              ASSERT_EQ(a->bytes, b->bytes) << kind << " " << geo::ToString(key);
            }
          }
        }
      }
    }
    EXPECT_GT(same, 50) << kind;
    EXPECT_GT(touched, 5) << kind;
    EXPECT_GT(differ, 2) << kind;
  }
}

// Every sample of the raster, edited, against the decoded mesh.
TEST_F(Edits, AreCertified) {
  const std::vector<Sample> samples = SamplesOf(Jacksboro());
  for (const auto& [kind, feature] : Kinds()) {
    if (kind == "replace" || kind == "hole") continue;  // samples are another source's, or missing
    const TilePipeline pipeline = Open({feature});
    std::vector<dem::GeoPosition> positions;
    for (const Sample& sample : samples) positions.push_back({sample.longitude, sample.latitude});
    const auto heights = ModelOf(pipeline).ReadPoints(positions);
    ASSERT_TRUE(heights.has_value());
    std::vector<Sample> edited = samples;
    for (std::size_t i = 0; i < edited.size(); ++i) edited[i].height = static_cast<double>((*heights)[i]);
    const SampleIndex index(std::move(edited));
    for (const int level : {7, 9, 10, 11, 12}) {
      for (const auto& [dx, dy] : {std::pair{0, 0}, {-1, 0}, {0, -1}}) {
        const FetchedTile tile = FetchTile(pipeline, RequestFor(TileAt(level, dx, dy), 8));
        const double error = TileSurface(tile.mesh, TileAt(level, dx, dy)).LargestError(index);
        EXPECT_LE(error, tile.encoded.certified_error_m.value_or(0)) << kind << " level " << level;
      }
    }
  }
}

// The edited samples of the dataset's own raster, and within a replacement also those of the other raster. The coarse
// one has creases between samples of the fine one; the fine one is rough between nodes, and ends inside of the polygon.
TEST_F(Edits, AreCertifiedBesideHolesAndOverReplacements) {
  const dem::TempDir dir;
  dem::RasterSpec rough;
  rough.width = 300, rough.height = 150;
  rough.geo_transform = {kLongitude - 0.0155, 0.0001, 0, kLatitude + 0.0065, 0, -0.0001};
  rough.value = [](int column, int row) {
    return 350.0 + 7 * ((column * 31 + row * 17) % 13) + (column > 120 ? 90 : 0);
  };
  const std::string path = dem::WriteRaster(dir, rough, "rough.tif");
  dem::RasterSpec half = rough;
  half.width = 160;
  const std::string half_path = dem::WriteRaster(dir, half, "half.tif");
  dem::RasterSpec plate;  // a plateau of a few pixels that ends between two columns of nodes
  plate.width = 4, plate.height = 7;
  plate.geo_transform = {kLongitude - 0.0155, 0.003, 0, kLatitude + 0.0105, 0, -0.003};
  plate.value = [](int, int) { return 900.0; };
  const std::string plate_path = dem::WriteRaster(dir, plate, "plate.tif");
  dem::RasterSpec notched = rough;  // with a void that is too wide to be filled, and open to the north
  notched.nodata = -1;
  notched.value = [](int column, int row) { return column > 115 && column < 185 && row < 100 ? -1.0 : 900.0; };
  const std::string notched_path = dem::WriteRaster(dir, notched, "notched.tif");
  dem::RasterSpec pierced = rough;  // with voids that have data all around them
  pierced.nodata = -1;
  pierced.value = [&rough](int column, int row) {
    const bool is_void = (column > 140 && column < 230 && row > 30 && row < 110) || (column % 40 < 3 && row % 25 < 3);
    return is_void ? -1.0 : rough.value(column, row);
  };
  const std::string pierced_path = dem::WriteRaster(dir, pierced, "pierced.tif");
  const auto replace = [](const std::string& source, int blend_m) {
    return Feature(fmt::format(R"({{"op":"replace","source":"{}","blend_m":{}}})", source, blend_m), Polygon());
  };
  const std::map<std::string, std::pair<std::string, std::string>> kinds = {
      {"hole", {Kinds().at("hole"), ""}},
      {"coarse", {Kinds().at("replace"), ""}},
      {"rough", {replace(path, 150), path}},
      {"rough without blend", {replace(path, 0), path}},
      {"ends inside", {replace(half_path, 150), half_path}},
      {"ends inside, flat", {replace(plate_path, 3000), ""}},
      {"has a void", {replace(notched_path, 3000), ""}},
      {"has enclosed voids", {replace(pierced_path, 150), pierced_path}}};
  for (const auto& [kind, feature] : kinds) {
    const TilePipeline pipeline = Open({feature.first});
    std::vector<Sample> samples = SamplesOf(Jacksboro());
    std::vector<dem::GeoPosition> positions;
    for (const Sample& sample : samples) positions.push_back({sample.longitude, sample.latitude});
    const auto heights = ModelOf(pipeline).ReadPoints(positions);
    ASSERT_TRUE(heights.has_value());
    for (std::size_t i = 0; i < samples.size(); ++i) samples[i].height = static_cast<double>((*heights)[i]);
    const auto missing = std::erase_if(samples, [](const Sample& sample) { return std::isnan(sample.height); });
    EXPECT_EQ(missing > 0, kind == "hole");
    if (!feature.second.empty()) {
      std::size_t added = 0;
      for (const Sample& sample : SamplesOf(feature.second)) {
        const double east = sample.longitude - kLongitude, north = sample.latitude - kLatitude;
        if (std::abs(east + 0.001) > 0.009 || north < -0.0015 || north > 0.003) continue;  // well inside
        samples.push_back(sample);
        ++added;
      }
      EXPECT_GT(added, 1000u);
    }
    const SampleIndex index(std::move(samples));
    for (const int level : {7, 9, 10, 11, 12, 13}) {
      for (const auto& [dx, dy] : {std::pair{0, 0}, {-1, 0}, {0, -1}, {-1, -1}}) {
        const FetchedTile tile = FetchTile(pipeline, RequestFor(TileAt(level, dx, dy), 8));
        const double error = TileSurface(tile.mesh, TileAt(level, dx, dy)).LargestError(index);
        EXPECT_LE(error, tile.encoded.certified_error_m.value_or(0)) << kind << " level " << level;
      }
    }
  }
}

// Positions of the common edge of two GLB tiles, without the feet of skirts: bit-equal, though the grid inside of a
// tile with precision is finer than that of its neighbours.
TEST_F(Edits, LeaveEdgesOfGlbTilesEqual) {
  const auto rim = [](const TilePipeline& pipeline, const geo::TileKey& key, int step, geo::Vec3 across) {
    TileRequest request = RequestFor(key, step);
    request.format = TileFormat::kGlb;
    const auto tile = pipeline.Build(request, {});
    EXPECT_TRUE(tile.has_value());
    const auto glb = proto::DecodeGlb(tile->bytes);
    EXPECT_TRUE(glb.has_value());
    std::set<proto::Corner> feet, points;
    for (const auto& [from, to] : proto::OpenSidesOf(*glb).sides) feet.insert(from);
    for (const geo::Vec3& p : glb->positions) {
      const proto::Corner point{p.x, p.y, p.z};
      if (std::abs(geo::Dot(across, p)) < 0.01 && !feet.contains(point)) points.insert(point);
    }
    return points;
  };
  for (const char* kind : {"precision", "factor", "precision beside a corner", "flatten", "breakline"}) {
    const TilePipeline pipeline = Open({Kinds().at(kind)});
    for (const int level : {11, 12}) {
      for (const int step : kSteps) {
        for (const auto& [dx, dy] : {std::pair{-1, 0}, {-1, -1}, {0, 0}}) {
          const geo::TileKey west = TileAt(level, dx, dy), east = geo::Neighbour(west, 1, 0);
          const geo::Lattice lattice = ModelOf(pipeline).LatticeOf(level);
          const geo::Vec3 meridian = geo::SurfaceNormal(lattice.Longitude(lattice.FirstColumn(east)), 0);
          const geo::Vec3 across{-meridian.y, meridian.x, 0};
          const auto a = rim(pipeline, west, step, across), b = rim(pipeline, east, step, across);
          EXPECT_GE(a.size(), 2u);
          EXPECT_EQ(a, b) << kind << " " << geo::ToString(west) << " step " << step;
        }
      }
    }
  }
}

TEST_F(Edits, CutHoles) {
  const TilePipeline plain = Open({}), pipeline = Open({Kinds().at("hole")});
  const auto middle = ModelOf(pipeline).ReadPoints(std::array{dem::GeoPosition{kLongitude, kLatitude}});
  EXPECT_TRUE(middle && std::isnan(middle->front()));
  for (const int step : kSteps) {
    const geo::TileKey key = TileAt(12);
    const FetchedTile tile = FetchTile(pipeline, RequestFor(key, step));
    const double side = 180.0 / static_cast<double>(geo::TileRows(12));
    std::size_t real = 0;
    for (const auto& triangle : tile.mesh.triangles) {
      double east = 0, north = 0;
      for (const std::uint32_t k : triangle) {
        east += (static_cast<double>(key.x) + tile.mesh.u[k] / 32767.0) * side / 3;
        north += (static_cast<double>(key.y) + tile.mesh.v[k] / 32767.0) * side / 3;
      }
      if (triangle[0] == triangle[1]) continue;
      ++real;
      // A rectangle well inside of the polygon.
      const double dx = east - 180 - kLongitude, dy = north - 90 - kLatitude;
      EXPECT_FALSE(std::abs(dx) < 0.007 && dy > -0.0015 && dy < 0.002) << dx << " " << dy;
    }
    EXPECT_GT(real, 2u);
    EXPECT_NE(tile.encoded.bytes, FetchTile(plain, RequestFor(key, step)).encoded.bytes);
  }
}

// Ground may stand in a hole as far as a triangle of one cell at its outline, whatever the criterion.
TEST_F(Edits, CutHolesAlongTheirOutline) {
  constexpr double kReach = 0.06, kSide = 180.0 / 2048;  // a diamond: all steps of its outline are diagonal
  const std::string diamond =
      Feature(R"({"op":"hole"})",
              fmt::format(R"({{"type":"Polygon","coordinates":[[{0},{1},{2},{3},{0}]]}})", Position(kReach, 0),
                          Position(0, kReach), Position(-kReach, 0), Position(0, -kReach)));
  for (const bool compact : {false, true}) {
    const TilePipeline pipeline = Open({diamond}, {tin::Criterion::kDataDependent, compact});
    const double cell = kSide / ModelOf(pipeline).LatticeOf(11).cells;
    for (const auto& [dx, dy] : {std::pair{-1, -1}, {-1, 0}, {0, -1}, {0, 0}}) {
      const geo::TileKey key = TileAt(11, dx, dy);
      const FetchedTile tile = FetchTile(pipeline, RequestFor(key, geo::SnapToLadder(11, 2)));
      double deepest = -1000;  // cells along an axis
      for (const auto& triangle : tile.mesh.triangles) {
        for (std::size_t i = 0; i < 3 && triangle[0] != triangle[1]; ++i) {
          const double east = (static_cast<double>(key.x) + tile.mesh.u[triangle[i]] / 32767.0) * kSide - 180;
          const double north = (static_cast<double>(key.y) + tile.mesh.v[triangle[i]] / 32767.0) * kSide - 90;
          deepest = std::max(deepest, (kReach - std::abs(east - kLongitude) - std::abs(north - kLatitude)) / cell);
        }
      }
      EXPECT_TRUE(deepest > -1 && deepest < 2.2) << geo::ToString(key) << ' ' << deepest;
    }
  }
}

}  // namespace
}  // namespace terrace::tiler
