// The level and the samples that an area is meshed from.
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/engine/dem/dem_fixture.h"
#include "tiler/area/area_mesh.h"

namespace terrace::tiler {
namespace {

constexpr std::size_t kMaxSamples = 1'000'000;

TEST(AreaPlan, AcrossTheAntimeridianIsNotCut) {
  const dem::TempDir dir;
  const auto model = dem::OpenOrFail(dem::WriteRaster(
      dir, {.width = 200, .height = 100, .geo_transform = {170, .1, 0, 5, 0, -.1}, .value = [](int column, int) {
              return column;
            }}));
  ASSERT_NE(model, nullptr);
  const auto columns = [&](double west, double east) {
    const auto plan = PlanArea(*model, 0.5, {west, -1, east, 1, 50}, kMaxSamples);
    return plan ? plan->window.columns * model->LatticeOf(plan->level).StepDegrees() : -1;
  };
  EXPECT_NEAR(columns(-180, 180), 20, 0.3);
  EXPECT_NEAR(columns(175, 185), 10, 0.3);
  EXPECT_NEAR(columns(-180, 100), 10, 0.3) << "one side";
  EXPECT_NEAR(columns(-170.01, 171), 1, 0.3) << "parts narrower than a sample do not count";
  const auto both = PlanArea(*model, 0.5, {-175, -1, 175, 1, 50}, kMaxSamples);
  ASSERT_FALSE(both);
  EXPECT_NE(both.error().message.find("two parts of the dataset, at longitudes -175 to -170 and 170 to 175"),
            std::string::npos)
      << both.error().message;
}

// A dataset of the whole Earth with pixels of 5 mm in one place: 2^33 by 2^32 samples at the deepest level.
TEST(AreaPlan, CountsMoreSamplesThanAnIntegerHas) {
  const dem::TempDir dir;
  const dem::RasterSpec earth{.width = 360, .height = 180, .geo_transform = {-180, 1, 0, 90, 0, -1}};
  const auto model = dem::OpenOrFail({{dem::WriteRaster(dir, earth, "earth.tif")},
                                      {dem::WriteRaster(dir, dem::FlatSquare(10, 50, 16, 5e-8, 7), "fine.tif")}});
  ASSERT_NE(model, nullptr);
  ASSERT_EQ(model->max_source_level(), 24);
  ASSERT_EQ(model->LatticeOf(24).columns(), std::int64_t{1} << 33);
  const auto refused = PlanArea(*model, 0.5, {-180, -90, 180, 90, 0.003}, kMaxSamples);
  ASSERT_FALSE(refused);
  const std::string& message = refused.error().message;
  EXPECT_NE(message.find("8589934593 x 4294967297 = 36893488160304005120 samples"), std::string::npos) << message;
}

}  // namespace
}  // namespace terrace::tiler
