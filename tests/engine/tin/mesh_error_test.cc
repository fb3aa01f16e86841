#include "engine/tin/mesh_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

TinMesh TwoTriangles(std::uint16_t east, std::uint16_t north) {
  return {{{0, 0}, {east, 0}, {east, north}, {0, north}}, {{0, 1, 2}, {2, 3, 0}}};
}

TEST(MeshError, MeasuresEverySampleOnce) {
  const HeightField field = MakeField(3, 3, [](int x, int y) {
    return x == 1 && y == 1 ? 3.f : x == 1 && y == 0 ? 4.f : 0.f;
  });
  const MeshError error = MeasureError(field, TwoTriangles(2, 2));
  EXPECT_EQ(error.samples, 9u);
  EXPECT_EQ(error.max, 4);
  EXPECT_EQ(error.worst, (SamplePosition{1, 0}));
  EXPECT_DOUBLE_EQ(error.rms, std::sqrt(25.0 / 9));
}

TEST(MeshError, NamesTheFirstOfTheWorstSamples) {
  const HeightField field =
      MakeField(5, 5, [](int x, int y) { return (x == 1 && y == 3) || (x == 3 && y == 1) ? -2.f : 0.f; });
  EXPECT_EQ(MeasureError(field, TwoTriangles(4, 4)).worst, (SamplePosition{3, 1}));
}

TEST(MeshError, IsZeroForAPlane) {
  const HeightField field = MakeField(9, 5, [](int x, int y) { return static_cast<float>(3 * x - 7 * y + 2); });
  const MeshError error = MeasureError(field, TwoTriangles(8, 4));
  EXPECT_EQ(error.max, 0);
  EXPECT_EQ(error.rms, 0);
  EXPECT_EQ(error.samples, 45u);
}

TEST(MeshError, SkipsVoidsAndShowsHoles) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const HeightField field = MakeField(3, 3, [&](int x, int y) { return x == 1 && y == 1 ? nan : 0.f; });
  EXPECT_EQ(MeasureError(field, TwoTriangles(2, 2)).samples, 8u);
  TinMesh hole = TwoTriangles(2, 2);
  hole.triangles.pop_back();
  EXPECT_EQ(MeasureError(field, hole).samples, 5u);
}

TEST(MeshError, StopsWhenAsked) {
  std::stop_source source;
  source.request_stop();
  EXPECT_EQ(MeasureError(NoiseField(3, 3, 1), TwoTriangles(2, 2), source.get_token()).samples, 0u);
}

}  // namespace
}  // namespace terrace::tin
