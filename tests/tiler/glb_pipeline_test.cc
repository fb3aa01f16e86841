// GLB tiles of the sample data as clients get them: errors, edges and skirts of decoded bytes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "engine/geo/error_ladder.h"
#include "proto/mesh/skirt.h"
#include "tests/proto/glb_decoder.h"
#include "tests/tiler/fetched_tile.h"
#include "tiler/tile_pipeline.h"

namespace terrace::tiler {
namespace {

using proto::Corner;
using proto::GlbCompression;

const dem::ElevationModel& ModelOf(std::uint32_t dataset) { return *SamplePipeline().datasets()[dataset].model; }

geo::TileKey MiddleTile(std::uint32_t dataset, int level) {
  const geo::TileRange& range = ModelOf(dataset).Available(level).front();
  return {level, (range.start_x + range.end_x) / 2, (range.start_y + range.end_y) / 2};
}

TileRequest GlbRequest(std::uint32_t dataset, geo::TileKey key, int step,
                       GlbCompression compression = GlbCompression::kDraco) {
  TileRequest request;
  request.dataset = dataset;
  request.key = key;
  request.error_step = step;
  request.format = TileFormat::kGlb;
  request.compression = compression;
  return request;
}

EncodedTile Build(const TileRequest& request) {
  const auto tile = SamplePipeline().Build(request, {});
  EXPECT_TRUE(tile.has_value()) << (tile ? "" : tile.error().message);
  return tile.value_or(EncodedTile{});
}

proto::DecodedGlb Fetch(std::uint32_t dataset, geo::TileKey key, int step) {
  const auto glb = proto::DecodeGlb(Build(GlbRequest(dataset, key, step)).bytes);
  EXPECT_TRUE(glb.has_value());
  return glb.value_or(proto::DecodedGlb{});
}

// The points of the skirts' feet.
std::set<Corner> Feet(const proto::DecodedGlb& glb) {
  std::set<Corner> feet;
  for (const auto& [from, to] : proto::OpenSidesOf(glb).sides) feet.insert(from);
  return feet;
}

// Feet of `tile` near the meridian or parallel where it ends in the east or north, away from the pole.
std::set<Corner> FeetNear(const std::set<Corner>& feet, geo::Vec3 normal, double offset, double tolerance) {
  std::set<Corner> near;
  for (const Corner& p : feet) {
    if (std::abs(normal.x * p[0] + normal.y * p[1] + normal.z * p[2] - offset) < tolerance) near.insert(p);
  }
  return near;
}

TEST(GlbPipeline, NeighboursShareTheirEdges) {
  for (const std::uint32_t dataset : {0u, 1u}) {
    for (const int step : {-8, 0, 10}) {
      for (int level = 1; level <= ModelOf(dataset).max_level(); level += 3) {
        geo::TileKey key = MiddleTile(dataset, level);
        // For the global dataset, across the antimeridian.
        if (dataset == 0) key.x = geo::TileColumns(level) - 1;
        const geo::TileKey east = geo::Neighbour(key, 1, 0);
        if (!ModelOf(dataset).IsAvailable(east)) continue;
        // Points of an eastern edge are in the plane of its meridian.
        const geo::Lattice lattice = ModelOf(dataset).LatticeOf(level);
        const double longitude = lattice.Longitude(lattice.FirstColumn(east));
        const geo::Vec3 meridian = geo::SurfaceNormal(longitude, 0), across{-meridian.y, meridian.x, 0};
        const double tolerance = level > 8 ? 0.01 : geo::LadderError(level, step) / 16;
        const auto a = FeetNear(Feet(Fetch(dataset, key, step)), across, 0, tolerance);
        const auto b = FeetNear(Feet(Fetch(dataset, east, step)), across, 0, tolerance);
        EXPECT_GE(a.size(), 2u);
        EXPECT_EQ(a, b) << geo::ToString(key) << " step " << step;
      }
    }
  }
}

// Skirts have the positions of the rim, so if neighbours share feet they share rims. This test checks the rims of one
// tile.
TEST(GlbPipeline, SkirtsHangAsDeepAsTheySay) {
  const geo::TileKey key = MiddleTile(1, 11);
  const proto::DecodedGlb glb = Fetch(1, key, 0);
  const double depth = proto::SkirtDepth(11, geo::LadderError(11, 0));
  std::set<Corner> points;
  for (const geo::Vec3& p : glb.positions) points.insert({p.x, p.y, p.z});
  const std::set<Corner> feet = Feet(glb);
  ASSERT_FALSE(feet.empty());
  for (const Corner& foot : feet) {
    const geo::Vec3 p{foot[0], foot[1], foot[2]};
    const double longitude = geo::ToDegrees(std::atan2(p.y, p.x));
    // Within a hundredth of a degree of the geodetic latitude, which is exact enough over a few hundred metres.
    const double latitude = geo::ToDegrees(std::atan2(p.z, (1 - geo::kEccentricitySquared) * std::hypot(p.x, p.y)));
    const geo::Vec3 top = p + geo::SurfaceNormal(longitude, latitude) * depth;
    const bool found = std::any_of(points.begin(), points.end(), [&](const Corner& q) {
      return geo::Length(geo::Vec3{q[0], q[1], q[2]} - top) < 2;
    });
    EXPECT_TRUE(found);
  }
}

TEST(GlbPipeline, ReachesTheLadderError) {
  for (const std::uint32_t dataset : {0u, 1u}) {
    for (const int step : {-16, -4, 0, 8, 16}) {
      for (int level = 0; level <= ModelOf(dataset).max_level(); ++level) {
        EXPECT_LE(Build(GlbRequest(dataset, MiddleTile(dataset, level), step)).max_error_m,
                  geo::LadderError(level, step))
            << dataset << " level " << level << " step " << step;
      }
    }
  }
}

// Height of the flat surface above the ellipsoid along the normal of a lattice sample: where the line through the
// sample meets a triangle (Moeller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997).
std::optional<double> HeightOn(const proto::DecodedGlb& glb, const std::array<std::uint32_t, 3>& triangle,
                               geo::Vec3 base, geo::Vec3 up) {
  constexpr double kSlack = 1e-9;
  const geo::Vec3 a = glb.positions[triangle[0]], ab = glb.positions[triangle[1]] - a,
                  ac = glb.positions[triangle[2]] - a;
  const geo::Vec3 h = geo::Cross(up, ac);
  const double determinant = geo::Dot(ab, h);
  if (determinant >= 0) return std::nullopt;  // the back of a triangle, or a skirt seen from its edge
  const geo::Vec3 s = base - a;
  const double u = geo::Dot(s, h) / determinant;
  const geo::Vec3 q = geo::Cross(s, ab);
  const double v = geo::Dot(up, q) / determinant;
  if (u < -kSlack || v < -kSlack || u + v > 1 + kSlack) return std::nullopt;
  return geo::Dot(ac, q) / determinant;
}

// Measures the drawn surface independently.
TEST(GlbPipeline, DrawsTheTerrainWithinTheStatedError) {
  const struct {
    std::uint32_t dataset;
    int level, step;
  } cases[] = {{0, 2, 4}, {0, 5, 0}, {1, 9, 0}, {1, 13, 4}};
  for (const auto& c : cases) {
    SCOPED_TRACE(testing::Message() << "level " << c.level << " step " << c.step);
    const geo::TileKey key = MiddleTile(c.dataset, c.level);
    const EncodedTile encoded = Build(GlbRequest(c.dataset, key, c.step));
    const auto glb = proto::DecodeGlb(encoded.bytes);
    ASSERT_TRUE(glb.has_value());
    const auto heights = ModelOf(c.dataset).Read(key);
    ASSERT_TRUE(heights.has_value());
    const geo::Lattice& lattice = heights->lattice;
    double worst = 0;
    int missed = 0;
    for (int j = 1; j < lattice.cells; j += 3) {
      for (int i = 1; i < lattice.cells; i += 3) {
        const double longitude = lattice.Longitude(lattice.FirstColumn(key) + i);
        const double latitude = lattice.Latitude(lattice.FirstRow(key) + j);
        const geo::Vec3 base = geo::ToEcef(longitude, latitude, 0), up = geo::SurfaceNormal(longitude, latitude);
        std::optional<double> height;
        for (const auto& triangle : glb->triangles) {
          if ((height = HeightOn(*glb, triangle, base, up))) break;
        }
        if (!height) {
          ++missed;
          continue;
        }
        worst = std::max(worst, std::abs(*height - static_cast<double>(heights->At(i, j))));
      }
    }
    EXPECT_EQ(missed, 0);
    EXPECT_LE(worst, geo::LadderError(c.level, c.step) * 1.02);
    EXPECT_GT(worst, encoded.max_error_m / 4);
  }
}

TEST(GlbPipeline, CarriesItsErrorsAsTheHeadersStateThem) {
  for (const GlbCompression compression : {GlbCompression::kDraco, GlbCompression::kMeshopt}) {
    for (const int level : {0, 5, 11}) {
      const EncodedTile tile = Build(GlbRequest(1, MiddleTile(1, level), 0, compression));
      const auto glb = proto::DecodeGlb(tile.bytes);
      ASSERT_TRUE(glb && tile.certified_error_m);
      const nlohmann::json& terrain = glb->json["scenes"][0]["extras"]["terrain"];
      const double most = terrain["maxError"], certified = terrain["certifiedError"];
      EXPECT_GE(most, tile.max_error_m);
      EXPECT_LE(most, tile.max_error_m * (1 + 1.001e-5));
      EXPECT_GE(certified, *tile.certified_error_m);
      EXPECT_LE(certified, *tile.certified_error_m * (1 + 1.001e-5));
      EXPECT_GE(certified, most);
    }
  }
}

TEST(GlbPipeline, FormatsShareOneRefinement) {
  std::vector<Dataset> datasets;
  datasets.push_back(OpenSample("jacksboro"));
  const TilePipeline pipeline(std::move(datasets));
  TileRequest request;
  request.key = MiddleTile(1, 10);
  EXPECT_EQ(pipeline.Build(request, {})->refinement_use, RefinementUse::kMade);
  request.format = TileFormat::kGlb;
  const Result<EncodedTile> glb = pipeline.Build(request, {});
  EXPECT_EQ(glb->refinement_use, RefinementUse::kReplayed);
  EXPECT_EQ(glb->times.read.count(), 0);
}

// The tiles that a client gets without the parameter `compression` have the dataset's form.
TEST(GlbPipeline, HeightsOfGlbTilesAreThoseOfTheDatasetsForm) {
  std::vector<dem::GeoPosition> points;
  for (int k = 0; k < 20; ++k) points.push_back({-84.2 + 0.003 * k, 36.3 + 0.002 * k});
  for (const auto& [form, other] : {std::pair(GlbCompression::kQuantized, GlbCompression::kDraco),
                                    std::pair(GlbCompression::kMeshopt, GlbCompression::kDraco),
                                    std::pair(GlbCompression::kDraco, GlbCompression::kQuantized)}) {
    std::vector<Dataset> datasets;
    datasets.push_back(OpenSample("jacksboro"));
    datasets[0].glb.compression = form;
    const TilePipeline pipeline(std::move(datasets));
    const auto heights_of = [&](std::optional<GlbCompression> compression) {
      DrawnSurface surface;
      surface.format = TileFormat::kGlb;
      surface.compression = compression;
      const auto heights = pipeline.ReadDrawnPoints(0, surface, points, false, {});
      EXPECT_TRUE(heights) << (heights ? "" : heights.error().message);
      return heights ? heights->heights : std::vector<float>();
    };
    const std::vector<float> of_dataset = heights_of(std::nullopt);
    EXPECT_EQ(of_dataset, heights_of(form));
    EXPECT_NE(of_dataset, heights_of(other));
  }
}

TEST(GlbPipeline, GivesTheSameBytesOnEveryThreadAndFromEveryRefinement) {
  for (const GlbCompression compression :
       {GlbCompression::kDraco, GlbCompression::kNone, GlbCompression::kQuantized, GlbCompression::kMeshopt}) {
    const TileRequest request = GlbRequest(1, MiddleTile(1, 11), 4, compression);
    const std::string expected = Build(request).bytes;
    std::vector<std::thread> threads;
    for (int k = 0; k < 4; ++k) threads.emplace_back([&] { EXPECT_EQ(Build(request).bytes, expected); });
    for (std::thread& thread : threads) thread.join();
    std::vector<Dataset> fresh;
    fresh.push_back(OpenSample("etopo5"));
    fresh.push_back(OpenSample("jacksboro"));
    EXPECT_EQ(TilePipeline(std::move(fresh), 0).Build(request, {})->bytes, expected);
  }
}

}  // namespace
}  // namespace terrace::tiler
