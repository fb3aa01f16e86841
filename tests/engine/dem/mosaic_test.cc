// Several rasters as one dataset: priorities, joints and bounds.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <span>

#include "engine/common/idle_pool.h"
#include "engine/crs/geoid.h"
#include "engine/geo/mercator_grid.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

// Rough terrain, a function of the pixel of the whole raster.
double Terrain(int column, int row) {
  std::uint32_t hash = static_cast<std::uint32_t>(column) * 73856093u ^ static_cast<std::uint32_t>(row) * 19349663u;
  hash = (hash ^ hash >> 13) * 0x5bd1e995u;
  return 800 + 300 * std::sin(column * 0.05) * std::cos(row * 0.07) + (hash >> 16 & 1023) * 0.125;
}

struct Cut {
  std::string name;
  RasterSpec whole;
  std::vector<int> columns, rows;  // first columns and rows of pieces; the first is 0
  int shared = 0;                  // columns and rows that neighbours have in common
  std::string first_crs = {};      // of the first piece, if it differs from the whole's
};

// Writes the pieces as files of one rank.
std::vector<DemFile> WritePieces(const TempDir& dir, const Cut& cut) {
  std::vector<DemFile> files;
  const auto end = [](const std::vector<int>& starts, std::size_t i, int size, int shared) {
    return i + 1 < starts.size() ? starts[i + 1] + shared : size;
  };
  for (std::size_t y = 0; y < cut.rows.size(); ++y) {
    for (std::size_t x = 0; x < cut.columns.size(); ++x) {
      const int column = cut.columns[x], row = cut.rows[y];
      RasterSpec piece = cut.whole;
      piece.width = end(cut.columns, x, cut.whole.width, cut.shared) - column;
      piece.height = end(cut.rows, y, cut.whole.height, cut.shared) - row;
      if (files.empty() && !cut.first_crs.empty()) piece.crs = cut.first_crs;
      auto& to_crs = piece.geo_transform;
      to_crs[0] += column * to_crs[1];
      to_crs[3] += row * to_crs[5];
      piece.value = [value = cut.whole.value, column, row](int c, int r) { return value(column + c, row + r); };
      files.push_back({WriteRaster(dir, piece, cut.name + std::to_string(y) + std::to_string(x) + ".tif")});
    }
  }
  return files;
}

// One arc-second at 20 degrees north, node-registered as SRTM is: neighbours share a row or column.
RasterSpec Seconds(int width, int height) {
  RasterSpec spec;
  spec.width = width;
  spec.height = height;
  spec.geo_transform = {-157 - 0.5 / 3600, 1.0 / 3600, 0, 21 + 0.5 / 3600, 0, -1.0 / 3600};
  spec.value = Terrain;
  return spec;
}

std::vector<Cut> Cuts() {
  const auto holes = [](int c, int r) {  // small holes, one of them on the joint, and a large one
    const bool small = (c - 300) * (c - 300) + (r - 200) * (r - 200) < 90 || (c * 7 + r * 13) % 101 == 0;
    return small || (c > 320 && c < 520 && r > 30 && r < 150) ? -9999.0 : Terrain(c, r);
  };
  std::vector<Cut> cuts;
  cuts.push_back({"nodes", Seconds(601, 481), {0, 304}, {0, 240}, 1});
  cuts.push_back({"pixels", Seconds(600, 480), {0, 304}, {0, 240}, 0});
  cuts.push_back({"odd", Seconds(600, 480), {0, 301}, {0, 239}, 0});
  cuts.push_back({"unit", Seconds(600, 480), {0, 304}, {0, 240}, 0});  // one file states the unit, and none a datum
  cuts.back().first_crs =
      R"(COMPD_CS["WGS 84 + unknown",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,)"
      R"(AUTHORITY["EPSG","7030"]],AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],)"
      R"(UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4326"]],)"
      R"(VERT_CS["unknown",VERT_DATUM["unknown",2005],UNIT["metre",1,AUTHORITY["EPSG","9001"]],AXIS["Up",UP]]])";
  cuts.push_back({"holes", Seconds(601, 481), {0, 304}, {0, 192, 336}, 1});
  cuts.back().whole.value = holes;
  cuts.back().whole.nodata = -9999;
  RasterSpec utm = Seconds(500, 400);
  utm.geo_transform = {300000, 30, 0, 3800000, 0, -30};
  utm.crs = "EPSG:32611";
  cuts.push_back({"utm", utm, {0, 256}, {0, 128}, 0});
  RasterSpec antimeridian = Seconds(600, 300);
  antimeridian.geo_transform[0] = 180 - 304.5 / 3600;
  cuts.push_back({"antimeridian", antimeridian, {0, 304}, {0, 160}, 0});
  RasterSpec globe = Seconds(720, 361);
  globe.geo_transform = {-180.25, 0.5, 0, 90.25, 0, -0.5};
  cuts.push_back({"globe", globe, {0, 304}, {0, 176}, 0});
  return cuts;
}

// Averages of blocks that are not cut are equal to the bit. In blocks that are cut, sums have another order, and voids
// are handled block by block.
void ExpectEqual(std::span<const float> whole, std::span<const float> pieces, bool exact, double tolerance,
                 const std::string& what) {
  ASSERT_EQ(whole.size(), pieces.size());
  int different = 0;
  double farthest = 0;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    different += std::bit_cast<std::uint32_t>(whole[i]) != std::bit_cast<std::uint32_t>(pieces[i]);
    farthest = std::max<double>(farthest, std::abs(whole[i] - pieces[i]));
  }
  EXPECT_LE(farthest, exact ? 0 : tolerance) << what;
  EXPECT_TRUE(!exact || different == 0) << what;
}

TEST(Mosaic, PiecesOfARasterAreThatRaster) {
  for (const Cut& cut : Cuts()) {
    SCOPED_TRACE(cut.name);
    const TempDir dir;
    const auto whole = OpenOrFail(WriteRaster(dir, cut.whole, "whole.tif"));
    const auto pieces = OpenOrFail(WritePieces(dir, cut));
    ASSERT_TRUE(whole && pieces);
    ASSERT_EQ(pieces->info().sources.size(), cut.columns.size() * cut.rows.size());
    ASSERT_EQ(pieces->max_level(), whole->max_level());
    const bool has_voids = cut.whole.nodata.has_value();
    int exact_tiles = 0;
    for (int level = 0; level <= whole->max_level(); ++level) {
      EXPECT_EQ(pieces->Available(level), whole->Available(level)) << level;
      ASSERT_EQ(pieces->LatticeOf(level).cells, whole->LatticeOf(level).cells);
      // Up to 16 samples a cell, which is the alignment of most cuts above.
      const bool exact = cut.name == "odd" ? !has_voids : level >= whole->max_level() - 6;
      for (const geo::TileKey& key : SomeTiles(*whole, level, 6)) {
        const auto a = whole->Read(key), b = pieces->Read(key);
        ASSERT_TRUE(a && b);
        ExpectEqual(a->heights, b->heights, exact, has_voids ? 60 : 0.002, geo::ToString(key));
        exact_tiles += exact;
      }
    }
    EXPECT_GT(exact_tiles, 10);
  }
}

TEST(Mosaic, PiecesGiveTheRastersPointsAndMercatorPixels) {
  for (const Cut& cut : Cuts()) {
    SCOPED_TRACE(cut.name);
    const TempDir dir;
    const auto whole = OpenOrFail(WriteRaster(dir, cut.whole, "whole.tif"));
    const auto pieces = OpenOrFail(WritePieces(dir, cut));
    ASSERT_TRUE(whole && pieces);
    const GeoBounds& b = whole->info().bounds;
    const double width = b.east > b.west ? b.east - b.west : b.east + 360 - b.west;
    std::vector<GeoPosition> points;
    for (int i = 0; i < 3000; ++i) {
      points.push_back({b.west + width * (i % 61 - 2) / 56, b.south + (b.north - b.south) * (i / 61 - 2) / 46});
      points.back().latitude = std::clamp(points.back().latitude, -90.0, 90.0);
    }
    const auto p = whole->ReadPoints(points), q = pieces->ReadPoints(points);
    ASSERT_TRUE(p && q);
    for (std::size_t i = 0; i < points.size(); ++i) {
      ASSERT_EQ(std::bit_cast<std::uint32_t>((*p)[i]), std::bit_cast<std::uint32_t>((*q)[i]))
          << points[i].longitude << " " << points[i].latitude;
    }
    const int depth = whole->info().max_mercator_depth;
    ASSERT_EQ(pieces->info().max_mercator_depth, depth);
    const geo::MercatorGrid grid{depth};
    const double middle = b.west + width * 0.5;
    const NodeWindow window{static_cast<std::int64_t>((middle + 180) / 360 * static_cast<double>(grid.columns())) - 100,
                            grid.rows() / 2 - 1 -
                                static_cast<std::int64_t>(std::asinh(std::tan((b.south + b.north) / 2 * M_PI / 180)) /
                                                          (2 * M_PI) * static_cast<double>(grid.rows())) -
                                100,
                            200, 200};
    const auto m = whole->ReadMercator(depth, window), n = pieces->ReadMercator(depth, window);
    ASSERT_TRUE(m && n);
    ExpectEqual(*m, *n, true, 0, "Mercator");
  }
}

float HeightAt(const ElevationModel& model, double longitude, double latitude) {
  const GeoPosition point{longitude, latitude};
  const auto height = model.ReadPoints({&point, 1});
  EXPECT_TRUE(height);
  return height ? height->front() : -1e9f;
}

// A staircase of twelve rasters in UTM: nodes beside them, within the extent of all, have the floor.
TEST(Mosaic, OnlyNodesInRaggedPiecesHaveTheirHeights) {
  constexpr int kPieces = 12;
  const TempDir dir;
  std::vector<DemFile> files;
  for (int i = 0; i < kPieces; ++i) {
    RasterSpec piece = Seconds(40, 20);
    piece.geo_transform = {300000.0 + i * 600, 30, 0, 3800000.0 - i * 600, 0, -30};
    piece.crs = "EPSG:32611";
    piece.value = [](int, int) { return 100.0; };
    files.push_back({WriteRaster(dir, piece, "step" + std::to_string(i) + ".tif")});
  }
  DemOptions options;
  options.floor = 0;
  const auto model = OpenOrFail(files, options);
  ASSERT_TRUE(model);
  const GeoBounds& bounds = model->info().bounds;
  const geo::Lattice lattice = model->LatticeOf(model->max_level());
  const auto line = [&](double degrees) { return static_cast<std::int64_t>(degrees / lattice.StepDegrees()); };
  const NodeWindow window{line(bounds.west + 180) - 2, line(bounds.south + 90) - 2,
                          static_cast<int>(line(bounds.east - bounds.west) + 6),
                          static_cast<int>(line(bounds.north - bounds.south) + 6)};
  const auto nodes = model->ReadNodes(lattice.level, window);
  ASSERT_TRUE(nodes);
  int inside = 0, outside = 0;
  for (std::size_t n = 0; n < nodes->size(); ++n) {
    const auto columns = static_cast<std::size_t>(window.columns);
    const GeoPosition point{lattice.Longitude(window.column + static_cast<std::int64_t>(n % columns)),
                            lattice.Latitude(window.row + static_cast<std::int64_t>(n / columns))};
    const bool is_inside = !std::isnan(HeightAt(*model, point.longitude, point.latitude));
    ASSERT_EQ((*nodes)[n], is_inside ? 100 : 0) << point.longitude << " " << point.latitude;
    (is_inside ? inside : outside) += 1;
  }
  EXPECT_GT(inside, 1000);
  EXPECT_GT(outside, 1000);
}

// Height of the node nearest to a position, in tiles of the level.
float NodeAt(const ElevationModel& model, int level, double longitude, double latitude) {
  const geo::Lattice lattice = model.LatticeOf(level);
  const NodeWindow window{std::llround((longitude + 180) / lattice.StepDegrees()),
                          std::llround((latitude + 90) / lattice.StepDegrees()), 1, 1};
  const auto heights = model.ReadNodes(level, window);
  EXPECT_TRUE(heights);
  return heights ? heights->front() : -1e9f;
}

TEST(Mosaic, FirstSourceWinsWhereItHasAHeight) {
  const TempDir dir;
  RasterSpec holed = FlatSquare(10, 50, 200, 0.01, 100);
  holed.nodata = -1;
  holed.value = [](int c, int r) { return c >= 100 && r >= 100 ? -1.0 : 100.0; };
  const std::string first = WriteRaster(dir, holed, "first.tif");
  const std::string second = WriteRaster(dir, FlatSquare(9, 51, 400, 0.01, 200), "second.tif");
  const std::string base = WriteRaster(dir, FlatSquare(0, 60, 30, 1, 300), "base.tif");
  const auto source = OpenOrFail({{first, 0}, {second, 1}, {base, 2}});
  ASSERT_NE(source, nullptr);
  ASSERT_EQ(source->info().sources.size(), 3u);
  EXPECT_EQ(source->info().sources[0].path, first);
  struct Case {
    double longitude, latitude;
    float height;
  };
  for (const Case& c : {Case{10.5, 49.5, 100}, {11.5, 48.5, 200}, {9.5, 50.5, 200}, {20.5, 40.5, 300}}) {
    EXPECT_EQ(HeightAt(*source, c.longitude, c.latitude), c.height) << c.longitude;
    for (const int level : {6, 8, source->max_level()}) {
      EXPECT_EQ(NodeAt(*source, level, c.longitude, c.latitude), c.height) << c.longitude << " level " << level;
    }
  }
  EXPECT_TRUE(std::isnan(HeightAt(*source, 50, 0)));
  EXPECT_EQ(NodeAt(*source, 6, 50, 0), 100);  // the floor: the lowest of all
  EXPECT_EQ(source->info().bounds.west, 0);
  EXPECT_EQ(source->info().bounds.north, 60);
  EXPECT_EQ(source->info().heights.max, 300);

  const auto reversed = OpenOrFail({{first, 2}, {second, 1}, {base, 0}});
  EXPECT_EQ(HeightAt(*reversed, 10.5, 49.5), 300);
  EXPECT_NE(reversed->fingerprint(), source->fingerprint());
}

TEST(Mosaic, OfOneRankTheFinerSourceWinsThenTheName) {
  const TempDir dir;
  const std::string coarse = WriteRaster(dir, FlatSquare(0, 10, 10, 1, 1), "a.tif");
  const std::string fine = WriteRaster(dir, FlatSquare(3, 7, 40, 0.1, 2), "b.tif");
  const std::string beside =
      WriteRaster(dir, FlatSquare(3.05, 7, 40, 0.1, 3), "c.tif");  // half a pixel off: another raster grid
  const auto source = OpenOrFail({{coarse}, {beside}, {fine}});
  EXPECT_EQ(HeightAt(*source, 5, 5), 2);
  EXPECT_EQ(HeightAt(*source, 7.03, 5), 3);  // only `beside` covers it
  EXPECT_EQ(HeightAt(*source, 1, 1), 1);
}

TEST(Mosaic, OverlappingPiecesOfAGridFillEachOthersVoids) {
  const TempDir dir;
  RasterSpec a = FlatSquare(0, 10, 20, 0.5, 10), b = FlatSquare(5, 10, 20, 0.5, 20);
  a.nodata = -1;
  a.value = [](int c, int) { return c >= 15 ? -1.0 : 10.0; };
  const auto source = OpenOrFail({{WriteRaster(dir, a, "a.tif")}, {WriteRaster(dir, b, "b.tif")}});
  EXPECT_EQ(HeightAt(*source, 6.1, 5), 10);
  EXPECT_EQ(HeightAt(*source, 9.1, 5), 20);
}

TEST(Mosaic, DescriptionOfManyScatteredSourcesStaysSmall) {
  const TempDir dir;
  std::vector<DemFile> files;
  for (int i = 0; i < 400; ++i) {
    const double west = -170 + i % 20 * 17.03, north = 80 - i / 20 * 8.03;
    files.push_back({WriteRaster(dir, FlatSquare(west, north, 4, 0.0001, i), std::to_string(i) + ".tif")});
  }
  const auto source = OpenOrFail(files);
  std::size_t blocks = 0;
  for (int level = 0; level <= source->max_level(); ++level) blocks += source->Available(level).size();
  EXPECT_GT(blocks, 400u * 5);
  EXPECT_LT(blocks, 2000u * 20);
  EXPECT_EQ(HeightAt(*source, -170 + 0.0002, 80 - 0.0002), 0);
  EXPECT_EQ(HeightAt(*source, -170 + 17.03 + 0.0002, 80 - 8.03 - 0.0002), 21);
}

TEST(Mosaic, HeightsLieWithinTheBoundOfTheirTile) {
  for (const Cut& cut : Cuts()) {
    SCOPED_TRACE(cut.name);
    const TempDir dir;
    std::vector<DemFile> files = WritePieces(dir, cut);
    files.pop_back();  // one corner shows the source below
    files.push_back({WriteRaster(dir, FlatSquare(-180, 90, 18, 10, -500), "base.tif"), 1});
    const auto source = OpenOrFail(files);
    ASSERT_NE(source, nullptr);
    for (int level = 0; level <= source->max_level(); ++level) {
      for (const geo::TileKey& key : SomeTiles(*source, level, 5)) {
        const auto tile = source->Read(key);
        ASSERT_TRUE(tile);
        const HeightRange bound = source->RangeBound(key);
        for (int j = 0; j <= tile->lattice.cells; ++j) {
          for (int i = 0; i <= tile->lattice.cells; ++i) {
            ASSERT_GE(tile->At(i, j), bound.min) << geo::ToString(key);
            ASSERT_LE(tile->At(i, j), bound.max) << geo::ToString(key);
          }
        }
      }
    }
  }
}

TEST(Mosaic, NeighboursShareTheirBordersAcrossSources) {
  TERRACE_REQUIRE_DATA(base, "etopo5_global_10min.tif");
  TERRACE_REQUIRE_DATA(west, "srtm1_N51E179_antimeridian_w.tif");
  TERRACE_REQUIRE_DATA(east, "srtm1_N51W180_antimeridian_e.tif");
  TERRACE_REQUIRE_DATA(hawaii, "antimeridian_hawaii_topobathy_5min.tif");
  TERRACE_REQUIRE_DATA(antarctica, "pole_antarctica_bedmap_5km.tif");
  TERRACE_REQUIRE_DATA(lidar, "lidar_slovenia_1m_nodata.tif");
  const auto source = OpenOrFail({{west, 0}, {east, 0}, {lidar, 1}, {hawaii, 2}, {antarctica, 3}, {base, 4}});
  ASSERT_NE(source, nullptr);
  for (int level = 0; level <= source->max_level(); ++level) {
    std::vector<geo::TileKey> keys = SomeTiles(*source, level, 3);
    const geo::TileKey aleutians{level, geo::TileColumns(level) - 1, geo::TileRows(level) * 1415 / 1800};
    if (source->IsAvailable(aleutians)) keys.push_back(aleutians);
    for (const geo::TileKey& key : keys) {
      const auto tile = source->Read(key), right = source->Read(geo::Neighbour(key, 1, 0));
      ASSERT_TRUE(tile && right);
      const int n = tile->lattice.cells;
      for (int j = -1; j <= n + 1; ++j) {
        for (int i = -1; i <= 1; ++i) {
          ASSERT_EQ(std::bit_cast<std::uint32_t>(tile->At(n + i, j)), std::bit_cast<std::uint32_t>(right->At(i, j)))
              << geo::ToString(key);
        }
      }
    }
  }
}

TEST(Mosaic, FeatherBlendsWhatIsConverted) {
  const TempDir dir;
  const std::string over = WriteRaster(dir, FlatSquare(10, 50, 200, 0.01, 100), "over.tif");
  const std::string base = WriteRaster(dir, FlatSquare(0, 60, 30, 1, 300), "base.tif");
  const DemOptions options{.feather = 20'000};
  const auto raw = OpenOrFail({{over, 0}, {base, 1}}, options);
  const auto mixed = OpenOrFail(
      {{over, 0, false, SourceOptions{.vertical = "egm96"}}, {base, 1, false, SourceOptions{.vertical = "ellipsoid"}}},
      options);
  ASSERT_TRUE(raw && mixed);
  EXPECT_TRUE(mixed->has_datum());
  const int level = mixed->max_level();
  int blended = 0;
  for (double inside = -0.05; inside < 0.3; inside += 0.01) {
    const double latitude = 50 - inside, before = NodeAt(*raw, level, 11, latitude);
    const double share = (300 - before) / 200;
    const double undulation = (*Geoid::OfCrs("EPSG:5773", {11, latitude}))->Undulation({11, latitude});
    ASSERT_GT(undulation, 30);
    // The node is the one nearest to the position.
    EXPECT_NEAR(NodeAt(*mixed, level, 11, latitude), before + share * undulation, 0.05) << inside;
    blended += share > 0.1 && share < 0.9;
  }
  EXPECT_GT(blended, 5);
  for (const geo::TileKey& key : SomeTiles(*mixed, 8, 6)) {
    const auto tile = mixed->Read(key);
    ASSERT_TRUE(tile);
    const HeightRange bound = mixed->RangeBound(key);
    for (int j = 0; j <= tile->lattice.cells; ++j) {
      for (int i = 0; i <= tile->lattice.cells; ++i) {
        ASSERT_GE(tile->At(i, j), bound.min) << geo::ToString(key);
        ASSERT_LE(tile->At(i, j), bound.max) << geo::ToString(key);
      }
    }
  }
}

TEST(Mosaic, FeatherLeadsFromOneSourceToTheNext) {
  const TempDir dir;
  RasterSpec upper = FlatSquare(10, 50, 200, 0.01, 100);  // a void of 20 samples a side in its middle
  upper.nodata = -1;
  upper.value = [](int c, int r) { return c >= 90 && c < 110 && r >= 90 && r < 110 ? -1.0 : 100.0; };
  const std::string over = WriteRaster(dir, upper, "over.tif");
  const std::string base = WriteRaster(dir, FlatSquare(0, 60, 30, 1, 300), "base.tif");
  DemOptions options;
  options.max_void_gap = 0;
  const auto hard = OpenOrFail({{over, 0}, {base, 1}}, options);
  options.feather = 20'000;
  const auto soft = OpenOrFail({{over, 0}, {base, 1}}, options), alone = OpenOrFail({{over, 0}}, options);
  ASSERT_TRUE(hard && soft && alone);
  EXPECT_NE(hard->fingerprint(), soft->fingerprint());
  const int level = soft->max_level();
  double before = 300;
  for (double inside = 0.01; inside < 0.5; inside += 0.01) {  // towards the middle of the northern half
    const double height = NodeAt(*soft, level, 11, 50 - inside);
    EXPECT_LE(height, before + 0.01) << inside;
    EXPECT_LT(before - height, 30) << inside;  // 200 m over 18 samples, without a step
    const double metres = inside * 111'200;
    EXPECT_NEAR(height, metres > 21'500 ? 100 : 300 - 200 * std::min(1.0, metres / 20'000), 25) << inside;
    before = height;
  }
  EXPECT_EQ(NodeAt(*soft, level, 11, 49.6), 100);
  EXPECT_EQ(NodeAt(*soft, level, 11, 50.2), 300);
  EXPECT_NEAR(NodeAt(*soft, level, 11, 49), 300, 1);  // in the void
  EXPECT_GT(NodeAt(*soft, level, 11.13, 49), 220);    // 3 samples from its rim
  EXPECT_EQ(NodeAt(*hard, level, 11.13, 49), 100);
  EXPECT_EQ(NodeAt(*alone, level, 11, 49.97), 100);  // nothing is blended with the floor
  for (int z = 3; z <= level; ++z) {
    for (const geo::TileKey& key : SomeTiles(*soft, z, 4)) {
      const auto tile = soft->Read(key), east = soft->Read(geo::Neighbour(key, 1, 0));
      ASSERT_TRUE(tile && east);
      const HeightRange bound = soft->RangeBound(key);
      for (int j = 0; j <= tile->lattice.cells; ++j) {
        ASSERT_EQ(tile->At(tile->lattice.cells, j), east->At(0, j)) << geo::ToString(key);
        for (int i = 0; i <= tile->lattice.cells; ++i) {
          ASSERT_GE(tile->At(i, j), bound.min) << geo::ToString(key);
          ASSERT_LE(tile->At(i, j), bound.max) << geo::ToString(key);
        }
      }
    }
  }
}

TEST(Mosaic, KeepsFewFilesOpen) {
  const TempDir dir;
  std::vector<DemFile> files;
  for (int i = 0; i < 60; ++i) {
    files.push_back({WriteRaster(dir, FlatSquare(i % 10 * 4, 40 - i / 10 * 4, 8, 0.5, i), std::to_string(i) + ".tif")});
  }
  SetMaxIdle(5);
  const auto source = OpenOrFail(files), other = OpenOrFail(std::vector<DemFile>(files.begin(), files.begin() + 30));
  ASSERT_NE(source, nullptr);
  ASSERT_NE(other, nullptr);
  for (int round = 0; round < 2; ++round) {
    for (const auto* dataset : {source.get(), other.get()}) {
      for (const geo::TileKey& key : SomeTiles(*dataset, dataset->max_level(), 60)) ASSERT_TRUE(dataset->Read(key));
    }
  }
  std::size_t open = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code gone;
    open += std::filesystem::read_symlink(entry, gone).string().starts_with(dir.path().string());
  }
  EXPECT_LE(open, 5u) << "of both together";
  EXPECT_GT(open, 0u);
  SetMaxIdle(std::numeric_limits<std::size_t>::max());
}

TEST(Mosaic, FilesOfAFolderThatAreNoRastersAreLeftOut) {
  const TempDir dir;
  const std::string raster = WriteRaster(dir, FlatSquare(0, 10, 10, 1, 1), "a.tif");
  std::ofstream(dir.File("readme.txt")) << "no raster\n";
  std::ofstream(dir.File("broken.tif")) << "II*";
  const auto source = ElevationModel::Open({{raster, 0, true}, {dir.File("readme.txt"), 0, true}});
  ASSERT_TRUE(source) << source.error().message;
  EXPECT_EQ((*source)->info().sources.size(), 1u);
  const auto named = ElevationModel::Open({{raster, 0, false}, {dir.File("readme.txt"), 0, false}});
  ASSERT_FALSE(named);
  EXPECT_NE(named.error().message.find("readme.txt"), std::string::npos);
  const auto none = ElevationModel::Open({{dir.File("readme.txt"), 0, true}});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kNotFound);
}

// Of two rasters on one grid around the Earth the first lies across its last column.
TEST(Mosaic, CertifiedErrorCountsRastersAcrossTheLastColumn) {
  const TempDir dir;
  RasterSpec across{.width = 32, .height = 64};
  across.geo_transform = {176, 0.25, 0, 24, 0, -0.25};
  across.value = [](int column, int row) {  // single summits between 181 and 183 degrees
    return column >= 20 && column < 28 && column % 2 == 0 && row % 2 == 0 ? 1000.0 : 0.0;
  };
  RasterSpec globe{.width = 1440, .height = 720};
  globe.geo_transform = {-180, 0.25, 0, 90, 0, -0.25};
  globe.value = [](int, int) { return 0.0; };
  const std::vector<DemFile> files = {{WriteRaster(dir, across, "across.tif"), {}},
                                      {WriteRaster(dir, globe, "globe.tif"), {}}};
  const auto model = OpenOrFail(files);
  ASSERT_NE(model, nullptr);
  const auto tile = model->Read({0, 0, 0});
  ASSERT_TRUE(tile) << tile.error().message;
  const float highest = *std::ranges::max_element(tile->heights);
  ASSERT_LT(highest, 600) << "averages";
  EXPECT_GE(tile->source_error_m, 1000 - highest);
}

}  // namespace
}  // namespace terrace::dem
