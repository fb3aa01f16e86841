// Meshes of areas: the content of the file, and requests that are rejected before reading.
#include "tiler/area/area_mesh.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "tests/support/scratch_directory.h"
#include "tests/support/source_dir.h"
#include "tests/support/test_data.h"

namespace terrace::tiler {
namespace {

constexpr std::size_t kMany = 1'000'000;

class AreaMeshTest : public testing::Test {
 protected:
  void SetUp() override {
    auto opened = dem::ElevationModel::Open(test_support::SourceDir() / "config/samples/jacksboro.tif");
    ASSERT_TRUE(opened) << opened.error().message;
    model_ = *std::move(opened);
    area_ = {-84.25, 36.25, -84.2, 36.29, 5, proto::MeshFileFormat::kObj, AreaCoordinates::kGeographic};
  }
  EncodedTile Build(const AreaRequest& area) const {
    const auto plan = PlanArea(*model_, 0.5, area, kMany);
    EXPECT_TRUE(plan) << plan.error().message;
    auto mesh = BuildAreaMesh(*model_, *plan, area, {});
    EXPECT_TRUE(mesh) << mesh.error().message;
    return *std::move(mesh);
  }
  std::string Refusal(const AreaRequest& area, std::size_t max_samples = kMany) const {
    const auto plan = PlanArea(*model_, 0.5, area, max_samples);
    if (plan) return "no refusal";
    EXPECT_EQ(plan.error().code, ErrorCode::kInvalidArgument);
    return plan.error().message;
  }

  std::unique_ptr<dem::ElevationModel> model_;
  AreaRequest area_;
};

TEST_F(AreaMeshTest, RefusesWhatIsNoArea) {
  for (const auto member : {&AreaRequest::west, &AreaRequest::south, &AreaRequest::east, &AreaRequest::north}) {
    AreaRequest area = area_;
    area.*member = NAN;
    EXPECT_EQ(Refusal(area).rfind("bbox", 0), 0u);
  }
  for (const double error_m : {double{NAN}, 0.0, -1.0, HUGE_VAL}) {
    AreaRequest area = area_;
    area.error_m = error_m;
    EXPECT_EQ(Refusal(area).rfind("error", 0), 0u);
  }
  EXPECT_TRUE(PlanArea(*model_, 0.5, area_, SIZE_MAX));
}

struct ObjMesh {
  std::vector<geo::Vec3> vertices;
  std::vector<std::array<std::size_t, 3>> triangles;
};

ObjMesh ReadObj(const std::string& text) {
  ObjMesh mesh;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line.size() > 2 ? line.substr(2) : "");
    if (line.starts_with("v ")) {
      geo::Vec3& v = mesh.vertices.emplace_back();
      words >> v.x >> v.y >> v.z;
    } else if (line.starts_with("f ")) {
      auto& triangle = mesh.triangles.emplace_back();
      words >> triangle[0] >> triangle[1] >> triangle[2];
      for (std::size_t& corner : triangle) --corner;
    }
  }
  return mesh;
}

double DoubledArea(geo::Vec3 a, geo::Vec3 b, geo::Vec3 c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// The surface's height at a position, by testing every triangle; NaN if there is none.
double HeightAt(const ObjMesh& mesh, double x, double y) {
  const geo::Vec3 p{x, y, 0};
  for (const auto& [i, j, k] : mesh.triangles) {
    const geo::Vec3 a = mesh.vertices[i], b = mesh.vertices[j], c = mesh.vertices[k];
    const double all = DoubledArea(a, b, c), u = DoubledArea(p, b, c) / all, v = DoubledArea(a, p, c) / all;
    constexpr double kEdge = -1e-6;
    if (u >= kEdge && v >= kEdge && 1 - u - v >= kEdge) return u * a.z + v * b.z + (1 - u - v) * c.z;
  }
  return std::nan("");
}

TEST_F(AreaMeshTest, KeepsTheErrorAtEverySample) {
  const auto plan = PlanArea(*model_, 0.5, area_, kMany);
  ASSERT_TRUE(plan);
  const auto heights = model_->ReadNodes(plan->level, plan->window);
  ASSERT_TRUE(heights);
  const EncodedTile encoded = Build(area_);
  const ObjMesh mesh = ReadObj(encoded.bytes);
  ASSERT_EQ(mesh.vertices.size(), encoded.vertices);
  EXPECT_LT(encoded.vertices, heights->size() / 2);
  const geo::Lattice lattice = model_->LatticeOf(plan->level);
  double largest = 0;
  for (int j = 0; j < plan->window.rows; ++j) {
    for (int i = 0; i < plan->window.columns; ++i) {
      const double surface =
          HeightAt(mesh, lattice.Longitude(plan->window.column + i), lattice.Latitude(plan->window.row + j));
      const double off = std::abs(surface - (*heights)[static_cast<std::size_t>(j * plan->window.columns + i)]);
      ASSERT_LE(off, 5.001) << i << " " << j;  // NaN, a hole, fails as well
      largest = std::max(largest, off);
    }
  }
  EXPECT_NEAR(encoded.max_error_m, largest, 1e-4) << "what is stated is what is found";
}

TEST_F(AreaMeshTest, CoversTheAreaAndWindsUpwards) {
  const ObjMesh mesh = ReadObj(Build(area_).bytes);
  double west = 180, east = -180, south = 90, north = -90;
  for (const geo::Vec3& v : mesh.vertices) {
    west = std::min(west, v.x);
    east = std::max(east, v.x);
    south = std::min(south, v.y);
    north = std::max(north, v.y);
  }
  const double step = 0.001;
  EXPECT_TRUE(west <= area_.west && west > area_.west - step) << west;
  EXPECT_TRUE(east >= area_.east && east < area_.east + step) << east;
  EXPECT_TRUE(south <= area_.south && south > area_.south - step) << south;
  EXPECT_TRUE(north >= area_.north && north < area_.north + step) << north;
  for (const auto& [i, j, k] : mesh.triangles) {
    ASSERT_GT(DoubledArea(mesh.vertices[i], mesh.vertices[j], mesh.vertices[k]), 0);
  }
}

TEST_F(AreaMeshTest, LiesWhereItsCoordinatesSay) {
  AreaRequest area = area_;
  area.coordinates = AreaCoordinates::kEnu;
  const EncodedTile local_file = Build(area);
  area.coordinates = AreaCoordinates::kEcef;
  const EncodedTile global_file = Build(area);
  EXPECT_LE(local_file.max_error_m, 5.002);
  EXPECT_LE(global_file.max_error_m, 5.002);
  const ObjMesh local = ReadObj(local_file.bytes), global = ReadObj(global_file.bytes);
  ASSERT_EQ(local.vertices.size(), global.vertices.size());
  const auto plan = PlanArea(*model_, 0.5, area, kMany);
  const double lon = plan->centre.longitude, lat = plan->centre.latitude;
  EXPECT_NEAR(lon, -84.225, 1e-9);
  EXPECT_NEAR(lat, 36.27, 1e-9);
  const geo::Vec3 origin = geo::ToEcef(lon, lat, 0), up = geo::SurfaceNormal(lon, lat);
  const geo::Vec3 east{-std::sin(geo::ToRadians(lon)), std::cos(geo::ToRadians(lon)), 0}, north = geo::Cross(up, east);
  for (std::size_t i = 0; i < local.vertices.size(); ++i) {
    const geo::Vec3 v = local.vertices[i];
    const geo::Vec3 in_space = origin + east * v.x + north * v.y + up * v.z;
    ASSERT_LT(geo::Length(in_space - global.vertices[i]), 0.002) << i;
    ASSERT_GT(v.z, 200);
    ASSERT_LT(v.z, 1100);
  }
}

// Without the Earth's curvature two triangles would be enough for a plain, but they would be far below it.
TEST_F(AreaMeshTest, LargeTrianglesDoNotCutThroughTheEarth) {
  auto opened = dem::ElevationModel::Open(test_support::SourceDir() / "config/samples/etopo5.tif");
  ASSERT_TRUE(opened) << opened.error().message;
  model_ = *std::move(opened);
  AreaRequest area{-20, 20, 30, 56, 2000, proto::MeshFileFormat::kGlb, AreaCoordinates::kEcef};
  const EncodedTile encoded = Build(area);
  EXPECT_LE(encoded.max_error_m, 2000.1);
  EXPECT_GT(encoded.vertices, 100u);
  area.coordinates = AreaCoordinates::kGeographic;
  EXPECT_LT(Build(area).vertices, encoded.vertices);
}

// Triangles that go half around the Earth collapse into a line, and must not be measured as exact.
TEST_F(AreaMeshTest, TheWholeEarthStaysRoundWhateverTheError) {
  auto opened = dem::ElevationModel::Open(test_support::SourceDir() / "config/samples/etopo5.tif");
  ASSERT_TRUE(opened) << opened.error().message;
  model_ = *std::move(opened);
  for (const AreaCoordinates coordinates : {AreaCoordinates::kEcef, AreaCoordinates::kEnu}) {
    const EncodedTile encoded = Build({-180, -90, 180, 90, 1e300, proto::MeshFileFormat::kObj, coordinates});
    EXPECT_GT(encoded.max_error_m, 1e5) << "a few dozen triangles are no sphere, and are not said to be one";
    EXPECT_LE(encoded.max_error_m, 1e6);
    EXPECT_GT(encoded.vertices, 20u);
  }
}

// Near a pole parallels are small circles, so triangles in space are not where they are in longitude and latitude.
TEST_F(AreaMeshTest, KeepsTheErrorUpToThePole) {
  auto opened = dem::ElevationModel::Open(test_support::SourceDir() / "config/samples/etopo5.tif");
  ASSERT_TRUE(opened) << opened.error().message;
  model_ = *std::move(opened);
  for (const double error_m : {10.0, 50.0}) {
    const EncodedTile encoded = Build({-20, 80, 20, 90, error_m, proto::MeshFileFormat::kObj, AreaCoordinates::kEcef});
    EXPECT_LE(encoded.max_error_m, error_m + 0.01);
  }
}

// In space the chord between two vertices of a parallel also bulges sideways: off the ground at its samples where that
// is steep.
TEST_F(AreaMeshTest, KeepsTheErrorOnItsEdges) {
  for (const double error_m : {1.0, 3.0, 10.0}) {
    AreaRequest area{-84.4, 36.2, -84.1, 36.4, error_m, proto::MeshFileFormat::kObj, AreaCoordinates::kEnu};
    EXPECT_LE(Build(area).max_error_m, error_m + 0.01);
  }
  auto opened = dem::ElevationModel::Open(test_support::SourceDir() / "config/samples/etopo5.tif");
  ASSERT_TRUE(opened) << opened.error().message;
  model_ = *std::move(opened);
  for (const double error_m : {5.0, 20.0, 200.0}) {
    for (const double south : {-90.0, -89.0, 60.0, 86.0, 87.5}) {
      AreaRequest area{0, south, 40, south + 2, error_m, proto::MeshFileFormat::kObj, AreaCoordinates::kEcef};
      const EncodedTile encoded = Build(area);
      EXPECT_LE(encoded.max_error_m, error_m + 0.01) << south;
      EXPECT_LT(encoded.vertices, 400'000u) << south;
    }
  }
}

// Where the chord of a parallel and the ground's bulge meet, a thin triangle stands upright in space.
TEST_F(AreaMeshTest, KeepsTheErrorAtTheCornersOfUprightTriangles) {
  constexpr const char* kFile = "bigtujunga_30m_utm11.tif";
  const auto path = test_support::TestDataPath(kFile);
  if (!path) GTEST_SKIP() << test_support::MissingTestData(kFile);
  auto opened = dem::ElevationModel::Open(*path);
  ASSERT_TRUE(opened) << opened.error().message;
  model_ = *std::move(opened);
  const AreaRequest area{-180, -90, 180, 90, 5, proto::MeshFileFormat::kGlb, AreaCoordinates::kEnu};
  const auto plan = PlanArea(*model_, 0.5, area, 16 * kMany);
  ASSERT_TRUE(plan) << plan.error().message;
  const auto mesh = BuildAreaMesh(*model_, *plan, area, {});
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_LE(mesh->max_error_m, 5.001);
}

// An area closer to the pole than the rounding of a node still has one row of cells.
TEST_F(AreaMeshTest, AreasAtThePoleHaveOneRowOfCells) {
  auto opened = dem::ElevationModel::Open(test_support::SourceDir() / "config/samples/etopo5.tif");
  ASSERT_TRUE(opened) << opened.error().message;
  model_ = *std::move(opened);
  AreaRequest area{0, 89.99999999999, 1, 90, 100, proto::MeshFileFormat::kGlb, AreaCoordinates::kEnu};
  const auto north = PlanArea(*model_, 0.5, area, kMany);
  ASSERT_TRUE(north) << north.error().message;
  EXPECT_EQ(north->window.row, model_->LatticeOf(north->level).rows() - 1);
  EXPECT_EQ(north->window.rows, 2);
  area.south = -90;
  area.north = -89.99999999999;
  const auto south = PlanArea(*model_, 0.5, area, kMany);
  ASSERT_TRUE(south) << south.error().message;
  EXPECT_EQ(south->window.row, 0);
  EXPECT_EQ(south->window.rows, 2);
}

TEST_F(AreaMeshTest, CrossesTheAntimeridian) {
  auto opened = dem::ElevationModel::Open(test_support::SourceDir() / "config/samples/etopo5.tif");
  ASSERT_TRUE(opened) << opened.error().message;
  model_ = *std::move(opened);
  const AreaRequest area{175, -20, 190, -10, 100, proto::MeshFileFormat::kObj, AreaCoordinates::kGeographic};
  const ObjMesh mesh = ReadObj(Build(area).bytes);
  double west = 1e9, east = -1e9;
  for (const geo::Vec3& v : mesh.vertices) {
    west = std::min(west, v.x);
    east = std::max(east, v.x);
  }
  EXPECT_NEAR(west, 175, .2);
  EXPECT_NEAR(east, 190, .2);
}

TEST_F(AreaMeshTest, SameRequestSameBytes) {
  for (const proto::MeshFileFormat format :
       {proto::MeshFileFormat::kGlb, proto::MeshFileFormat::kObj, proto::MeshFileFormat::kPly}) {
    AreaRequest area = area_;
    area.format = format;
    area.coordinates = AreaCoordinates::kEnu;
    const EncodedTile once = Build(area), again = Build(area);
    EXPECT_EQ(once.bytes, again.bytes);
    EXPECT_EQ(once.etag, again.etag);
  }
}

TEST_F(AreaMeshTest, ClipsToTheDataset) {
  AreaRequest area = area_;
  area.west = -90;
  area.north = 89;
  area.error_m = 20;
  const auto vertices = ReadObj(Build(area).bytes).vertices;
  ASSERT_FALSE(vertices.empty());
  for (const geo::Vec3& v : vertices) {
    ASSERT_GT(v.x, -84.43);
    ASSERT_LT(v.y, 36.46);
  }
}

TEST_F(AreaMeshTest, RefusesAreasBesideTheDataset) {
  AreaRequest area = area_;
  area.west = 10;
  area.east = 11;
  EXPECT_NE(Refusal(area).find("outside the dataset"), std::string::npos);
  area = area_;
  area.south = -40;
  area.north = -30;
  EXPECT_NE(Refusal(area).find("outside the dataset"), std::string::npos);
}

TEST_F(AreaMeshTest, ARefusalNamesTheLimitThatIsExceeded) {
  const auto plan = PlanArea(*model_, 0.5, area_, kMany);
  ASSERT_TRUE(plan);
  const int columns = plan->window.columns, rows = plan->window.rows;
  EXPECT_EQ(Refusal(area_, 500).substr(0, Refusal(area_, 500).find(';')),
            fmt::format("at an error of 5 m this area has {} x {} = {} samples, more than max_mesh_samples of this "
                        "server (500)",
                        columns, rows, columns * rows));
  const std::string tiny = Refusal(area_, 3);
  EXPECT_TRUE(
      tiny.starts_with("even at the largest error this area has 2 x 2 = 4 samples, more than max_mesh_samples "
                       "of this server (3); ask for a smaller bbox"))
      << tiny;
  EXPECT_EQ(tiny.find("or for an error"), std::string::npos) << "no error helps";
}

// The area is long and narrow, so it has few samples.
TEST_F(AreaMeshTest, ARefusalForALongSideIsNotAboutSamples) {
  dem::DemOptions deep;
  deep.finest_error = 0.01;
  const auto source = dem::ElevationModel::Open(test_support::SourceDir() / "config/samples/jacksboro.tif", deep);
  ASSERT_TRUE(source) << source.error().message;
  AreaRequest area = area_;
  area.west = -84.2;
  area.east = -84.1;
  area.north = area.south + 1e-5;
  area.error_m = 0.01;
  const auto refused = PlanArea(**source, 0.5, area, kMany);
  ASSERT_FALSE(refused);
  const std::string& message = refused.error().message;
  EXPECT_NE(message.find("more than the 32768 that a mesh may have on a side; ask for a smaller bbox, or for an error"),
            std::string::npos)
      << message;
  EXPECT_EQ(message.find("max_mesh_samples"), std::string::npos) << message;
  area.error_m = std::stod(message.substr(message.find("or for an error of ") + 19));
  EXPECT_TRUE(PlanArea(**source, 0.5, area, kMany)) << message;
  area.error_m = 0.01;
  area.north = area.south + 1e-2;
  const auto both = PlanArea(**source, 0.5, area, kMany);
  ASSERT_FALSE(both);
  EXPECT_NE(both.error().message.find("max_mesh_samples of this server (1000000), and more than the 32768"),
            std::string::npos)
      << both.error().message;
}

// The error that the message suggests is accepted.
TEST_F(AreaMeshTest, ItsRemedyIsOne) {
  const std::string refusal = Refusal(area_, 500);
  const std::size_t at = refusal.find("for an error of ");
  ASSERT_NE(at, std::string::npos) << refusal;
  AreaRequest area = area_;
  area.error_m = std::stod(refusal.substr(at + 16));
  EXPECT_LT(area.error_m, 500) << "not just any large one";
  EXPECT_TRUE(PlanArea(*model_, 0.5, area, 500)) << refusal;
}

TEST_F(AreaMeshTest, StopsWhenAsked) {
  const auto plan = PlanArea(*model_, 0.5, area_, kMany);
  std::stop_source stop;
  stop.request_stop();
  const auto mesh = BuildAreaMesh(*model_, *plan, area_, stop.get_token());
  ASSERT_FALSE(mesh);
  EXPECT_EQ(mesh.error().code, ErrorCode::kCancelled);
}

// A rectangle in the middle of `area_`, with the edits in a file.
class EditedAreaMesh : public AreaMeshTest {
 protected:
  void Edit(const std::string& terrain, const std::string& geometry) {
    const std::string path = dir_.path() / "edits.geojson";
    std::ofstream(path) << R"({"type":"FeatureCollection","features":[{"type":"Feature","properties":{"terrain":)"
                        << terrain << R"(},"geometry":)" << geometry << "}]}";
    dem::DemOptions options;
    options.edits = {path};
    auto opened = dem::ElevationModel::Open({{test_support::SourceDir() / "config/samples/jacksboro.tif"}}, options);
    ASSERT_TRUE(opened) << opened.error().message;
    model_ = *std::move(opened);
  }
  static constexpr const char* kPolygon =
      R"({"type":"Polygon","coordinates":[[[-84.235,36.262],[-84.215,36.264],[-84.214,36.278],[-84.236,36.276],[-84.235,36.262]]]})";

  const test_support::ScratchDirectory dir_;
};

TEST_F(EditedAreaMesh, KeepsThePrecisionAtEverySample) {
  area_.error_m = 40;
  const std::size_t plain = ReadObj(Build(area_).bytes).triangles.size();
  Edit(R"({"op":"precision","error_m":0.5})", kPolygon);
  for (const AreaCoordinates coordinates : {AreaCoordinates::kGeographic, AreaCoordinates::kEnu}) {
    area_.coordinates = coordinates;
    const auto plan = PlanArea(*model_, 0.5, area_, kMany);
    ASSERT_TRUE(plan);
    const ObjMesh mesh = ReadObj(Build(area_).bytes);
    EXPECT_GT(mesh.triangles.size(), 2 * plain);
    if (coordinates != AreaCoordinates::kGeographic) continue;
    const auto heights = model_->ReadNodes(plan->level, plan->window);
    ASSERT_TRUE(heights);
    const geo::Lattice lattice = model_->LatticeOf(plan->level);
    int inside = 0;
    for (int j = 0; j < plan->window.rows; ++j) {
      for (int i = 0; i < plan->window.columns; ++i) {
        const double x = lattice.Longitude(plan->window.column + i), y = lattice.Latitude(plan->window.row + j);
        if (x < -84.234 || x > -84.216 || y < 36.2645 || y > 36.2755) continue;
        ++inside;
        const float sample = (*heights)[static_cast<std::size_t>(j * plan->window.columns + i)];
        ASSERT_NEAR(HeightAt(mesh, x, y), static_cast<double>(sample), 0.5);
      }
    }
    EXPECT_GT(inside, 200);
  }
}

TEST_F(EditedAreaMesh, GoesNoDeeperThanItsSamplesAllow) {
  area_.error_m = 0.1;
  area_.west = -84.23, area_.east = -84.22, area_.south = 36.266, area_.north = 36.272;
  const auto plain = PlanArea(*model_, 0.5, area_, kMany);
  ASSERT_TRUE(plain);
  Edit(R"({"op":"precision","error_m":0.1})", kPolygon);
  const auto deep = PlanArea(*model_, 0.5, area_, kMany);
  ASSERT_TRUE(deep);
  ASSERT_GT(deep->level, plain->level);
  const auto samples = [](const AreaPlan& plan) {
    return static_cast<std::size_t>(plan.window.columns) * static_cast<std::size_t>(plan.window.rows);
  };
  const auto shallower = PlanArea(*model_, 0.5, area_, samples(*deep) - 1);
  ASSERT_TRUE(shallower) << shallower.error().message;
  EXPECT_EQ(shallower->level, deep->level - 1);
  const auto as_before = PlanArea(*model_, 0.5, area_, samples(*plain));
  ASSERT_TRUE(as_before) << as_before.error().message;
  EXPECT_EQ(as_before->level, plain->level);
  EXPECT_FALSE(plain->depends_on_limit);
  for (const auto& plan : {deep, shallower, as_before}) EXPECT_TRUE(plan->depends_on_limit) << plan->level;
}

TEST_F(EditedAreaMesh, HasHolesAndBreaklines) {
  area_.error_m = 40;
  Edit(R"({"op":"hole"})", kPolygon);
  const ObjMesh holed = ReadObj(Build(area_).bytes);
  EXPECT_TRUE(std::isnan(HeightAt(holed, -84.225, 36.27)));
  EXPECT_FALSE(std::isnan(HeightAt(holed, -84.245, 36.27)));
  std::vector<bool> is_used(holed.vertices.size());
  for (const auto& triangle : holed.triangles) {
    for (const std::size_t k : triangle) is_used[k] = true;
  }
  EXPECT_TRUE(std::ranges::all_of(is_used, [](bool is) { return is; }));
  AreaRequest within = area_;
  within.west = -84.23, within.east = -84.22, within.south = 36.266, within.north = 36.272;
  const auto plan = PlanArea(*model_, 0.5, within, kMany);
  ASSERT_TRUE(plan);
  const auto nothing = BuildAreaMesh(*model_, *plan, within, {});
  ASSERT_FALSE(nothing);
  EXPECT_EQ(nothing.error().code, ErrorCode::kInvalidArgument);

  Edit(R"({"op":"breakline"})", R"({"type":"LineString","coordinates":[[-84.24,36.265],[-84.21,36.265]]})");
  const auto line_plan = PlanArea(*model_, 0.5, area_, kMany);
  ASSERT_TRUE(line_plan);
  const ObjMesh lined = ReadObj(Build(area_).bytes);
  const geo::Lattice lattice = model_->LatticeOf(line_plan->level);
  const auto on_line = std::ranges::count_if(lined.vertices, [&](const geo::Vec3& vertex) {
    return std::abs(vertex.y - 36.265) < 0.51 * lattice.StepDegrees() && vertex.x > -84.24 && vertex.x < -84.21;
  });
  EXPECT_GE(static_cast<double>(on_line), 0.03 / lattice.StepDegrees() - 2);
}

}  // namespace
}  // namespace terrace::tiler
