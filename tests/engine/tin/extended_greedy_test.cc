#include "engine/tin/extended/extended_greedy.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <utility>

#include "engine/tin/extended/extended_error.h"
#include "engine/tin/greedy.h"
#include "tests/engine/tin/mesh_laws.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

std::vector<Rgba> Colors(int width, int height, const std::function<Rgba(int, int)>& at) {
  std::vector<Rgba> colors;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) colors.push_back(at(x, y));
  }
  return colors;
}

// Discs over a gradient: smooth parts, edges, and channels that differ.
Rgba Picture(int x, int y) {
  const bool in_disc = (x - 20) * (x - 20) + (y - 15) * (y - 15) < 90;
  const auto level = [](int value) { return static_cast<std::uint8_t>(std::clamp(value, 0, 255)); };
  return {level(in_disc ? 220 : 3 * x), level(in_disc ? 40 : 2 * y + x), level((x * y) / 8), 255};
}

ExtendedField Make(HeightField heights, const std::function<Rgba(int, int)>& at, double weight) {
  std::vector<Rgba> colors = Colors(heights.width(), heights.height(), at);
  return ExtendedField::Make(std::move(heights), std::move(colors), weight).value();
}

ExtendedField Hills(double weight) { return Make(HillField(61, 43, 7), Picture, weight); }

HeightField Flat(int width, int height) {
  return MakeField(width, height, [](int, int) { return 12.5F; });
}

// The largest error by the paper's formula: for every sample the first triangle that contains it, by barycentric
// coordinates in floating point. Independent of the product's rasterizer.
struct Measured {
  double combined = 0, height = 0, color_squares = 0;
  int known = 0;
};

Measured Measure(const ExtendedField& field, const ColoredMesh& mesh) {
  double low = 1e300, high = -1e300;
  for (int i = 0; i < field.width() * field.height(); ++i) {
    const double z = static_cast<double>(field.heights().At(i % field.width(), i / field.width()));
    if (!std::isnan(z)) low = std::min(low, z), high = std::max(high, z);
  }
  const double range = high > low ? high - low : 1, w = field.color_weight();
  Measured measured;
  for (int y = 0; y < field.height(); ++y) {
    for (int x = 0; x < field.width(); ++x) {
      const float z = field.heights().At(x, y);
      if (std::isnan(z)) continue;
      bool found = false;
      for (const auto& t : mesh.tin.triangles) {
        const auto corner = [&](int i) { return mesh.tin.vertices[t[static_cast<std::size_t>(i)]]; };
        const auto area = [](double ax, double ay, double bx, double by, double cx, double cy) {
          return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
        };
        const auto [a, b, c] = std::array{corner(0), corner(1), corner(2)};
        const double whole = area(a.x, a.y, b.x, b.y, c.x, c.y);
        const std::array<double, 3> share = {area(x, y, b.x, b.y, c.x, c.y) / whole,
                                             area(a.x, a.y, x, y, c.x, c.y) / whole,
                                             area(a.x, a.y, b.x, b.y, x, y) / whole};
        if (*std::ranges::min_element(share) < -1e-9) continue;
        found = true;
        double at_z = 0;
        std::array<double, 3> at{};
        for (int i = 0; i < 3; ++i) {
          const double part = share[static_cast<std::size_t>(i)];
          at_z += part * static_cast<double>(field.heights().VertexHeight(corner(i).x, corner(i).y));
          for (std::size_t k = 0; k < 3; ++k) at[k] += part * mesh.colors[t[static_cast<std::size_t>(i)]][k] / 255.0;
        }
        double colors = 0;
        if (const Rgba& color = field.ColorAt(x, y); color[3] != 0) {
          ++measured.known;
          for (std::size_t k = 0; k < 3; ++k) {
            const double distance = std::abs(at[k] - color[k] / 255.0);
            colors += distance;
            measured.color_squares += distance * distance;
          }
        }
        const double dz = std::abs(at_z - static_cast<double>(z));
        measured.height = std::max(measured.height, dz);
        measured.combined = std::max(measured.combined, (1 - w) * dz + w * (range / 3) * colors);
        break;
      }
      EXPECT_TRUE(found) << x << ", " << y;
    }
  }
  return measured;
}

ColoredMesh MeshOf(const ExtendedField& field, const ExtendedGoal& goal) {
  ExtendedGreedy greedy(field);
  EXPECT_TRUE(greedy.Run(goal));
  ColoredMesh mesh = greedy.Mesh();
  EXPECT_EQ(mesh.colors.size(), mesh.tin.vertices.size());
  EXPECT_TRUE(CoversExactly(field.heights(), mesh.tin));
  EXPECT_TRUE(IsDelaunay(mesh.tin));
  return mesh;
}

std::set<std::pair<int, int>> Positions(const TinMesh& mesh) {
  std::set<std::pair<int, int>> positions;
  for (const SamplePosition p : mesh.vertices) positions.emplace(p.x, p.y);
  return positions;
}

TEST(ExtendedGreedy, KeepsTheCombinedBoundOverEveryWeight) {
  for (const double weight : {0.0, 0.2, 0.5, 0.9, 1.0}) {
    const ExtendedField field = Hills(weight);
    for (const double bound : {60.0, 15.0, 3.0}) {
      const ColoredMesh mesh = MeshOf(field, {.max_error = bound});
      const Measured measured = Measure(field, mesh);
      EXPECT_LE(measured.combined, bound * (1 + 1e-12)) << weight;
      EXPECT_LT(mesh.tin.vertices.size(), 61u * 43u);
      const ExtendedError error = MeasureExtendedError(field, mesh);
      EXPECT_NEAR(error.max_combined, measured.combined, 1e-9);
      EXPECT_NEAR(error.height.max, measured.height, 1e-9);
      EXPECT_NEAR(error.color_rms, std::sqrt(measured.color_squares / (3.0 * measured.known)), 1e-9);
      EXPECT_EQ(error.height.samples, 61u * 43u);
    }
  }
}

TEST(ExtendedGreedy, InsertsTheWorstSampleOfAll) {
  const ExtendedField field = Hills(0.5);
  ExtendedGreedy greedy(field);
  for (std::size_t points = 5; points < 40; ++points) {
    const Measured before = Measure(field, greedy.Mesh());
    EXPECT_NEAR(greedy.CurrentError(), before.combined, 1e-5 * before.combined);
    greedy.Run({.max_points = points});
    ASSERT_EQ(greedy.vertex_count(), points);
    const SamplePosition inserted = greedy.Mesh().tin.vertices.back();
    const Rgba& color = field.ColorAt(inserted.x, inserted.y);
    EXPECT_EQ(greedy.Mesh().colors.back(), (Rgb{color[0], color[1], color[2]}));
  }
}

TEST(ExtendedGreedy, WithoutColorChoosesTheVerticesOfThePlainOne) {
  for (const int seed : {1, 2, 3}) {
    const HeightField heights = NoiseField(50, 40, static_cast<std::uint64_t>(seed));  // all errors differ
    for (const double bound : {80.0, 40.0, 10.0}) {
      GreedyTriangulation plain(heights);
      plain.Run({.max_error = bound});
      const ColoredMesh mesh = MeshOf(Make(heights, Picture, 0), {.max_error = bound});
      EXPECT_EQ(Positions(mesh.tin), Positions(plain.Mesh())) << seed << ", " << bound;
    }
  }
}

TEST(ExtendedGreedy, WithColorAloneIgnoresHeights) {
  const ExtendedField hills = Hills(1), flat = Make(Flat(61, 43), Picture, 1);
  const ColoredMesh over_hills = MeshOf(hills, {.max_points = 300}), over_plain = MeshOf(flat, {.max_points = 300});
  // M differs by a factor and rounds differently, so results are equal except for ties.
  std::vector<std::pair<int, int>> common;
  std::ranges::set_intersection(Positions(over_hills.tin), Positions(over_plain.tin), std::back_inserter(common));
  EXPECT_GE(common.size(), 285u);
  EXPECT_NEAR(MeasureExtendedError(hills, over_hills).color_rms, MeasureExtendedError(flat, over_plain).color_rms,
              2e-3);
}

TEST(ExtendedGreedy, WeighsHeightsAgainstColorsAsThePaperDoes) {
  // Heights step along x = 20, colours along y = 20.
  const auto field = [](double weight) {
    return Make(
        MakeField(41, 41, [](int x, int) { return x < 20 ? 0.0F : 100.0F; }),
        [](int, int y) {
          return y < 20 ? Rgba{0, 0, 0, 255} : Rgba{255, 255, 255, 255};
        },
        weight);
  };
  // A completely wrong height has the error (1 - w) M, a completely wrong colour w M.
  for (const auto& [weight, expected] : {std::pair{0.25, 75.0}, std::pair{0.5, 50.0}, std::pair{0.75, 75.0}}) {
    const ExtendedField judged = field(weight);
    EXPECT_DOUBLE_EQ(judged.Error(0, 3 * 255), weight * 100);
    EXPECT_DOUBLE_EQ(judged.Error(100, 0), (1 - weight) * 100);
    const ColoredMesh mesh = MeshOf(judged, {.max_error = expected - 1e-3});
    EXPECT_LT(Measure(judged, mesh).combined, expected);
  }
}

TEST(ExtendedGreedy, GoesOnToTheMeshOfOneRun) {
  const ExtendedField field = Hills(0.4);
  ExtendedGreedy in_steps(field);
  for (const double bound : {50.0, 20.0, 7.0, 2.0}) in_steps.Run({.max_error = bound});
  const ColoredMesh once = MeshOf(field, {.max_error = 2});
  EXPECT_EQ(in_steps.Mesh().tin.vertices, once.tin.vertices);
  EXPECT_EQ(in_steps.Mesh().tin.triangles, once.tin.triangles);
  EXPECT_EQ(in_steps.Mesh().colors, once.colors);
}

TEST(ExtendedGreedy, StopsAtThePointsAskedFor) {
  const ExtendedField field = Hills(0.5);
  for (const std::size_t points : {4, 5, 100}) EXPECT_EQ(MeshOf(field, {.max_points = points}).colors.size(), points);
  std::stop_source stop;
  stop.request_stop();
  ExtendedGreedy greedy(field);
  EXPECT_FALSE(greedy.Run({}, stop.get_token()));
  EXPECT_EQ(greedy.vertex_count(), 4u);
}

TEST(ExtendedGreedy, TakesEverySampleForNoError) {
  const auto noise = [](int x, int y) {
    const auto level = [](int value) { return static_cast<std::uint8_t>((value * 7919) % 251); };
    return Rgba{level(x + 31 * y), level(3 * x + y), level(x * y), 255};
  };
  const ExtendedField field = Make(NoiseField(17, 13, 5), noise, 0.5);
  const ColoredMesh mesh = MeshOf(field, {});
  EXPECT_EQ(mesh.tin.vertices.size(), 17u * 13u);
  EXPECT_EQ(Measure(field, mesh).combined, 0);
}

TEST(ExtendedGreedy, LeavesAConstantFieldAlone) {
  const ExtendedField field = Make(
      Flat(30, 20),
      [](int, int) {
        return Rgba{10, 200, 30, 255};
      },
      0.5);
  const ColoredMesh mesh = MeshOf(field, {});
  EXPECT_EQ(mesh.tin.vertices.size(), 4u);
  EXPECT_EQ(mesh.colors, (std::vector<Rgb>(4, Rgb{10, 200, 30})));
}

TEST(ExtendedGreedy, FollowsColorsOverFlatGround) {
  const ExtendedField field = Make(Flat(61, 43), Picture, 0.5);
  EXPECT_DOUBLE_EQ(field.Error(0, 3 * 255), 0.5);
  const ColoredMesh mesh = MeshOf(field, {.max_error = 0.05});
  EXPECT_GT(mesh.tin.vertices.size(), 20u);
  EXPECT_LE(Measure(field, mesh).combined, 0.05 * (1 + 1e-12));
}

TEST(ExtendedGreedy, KeepsItsBoundAroundVoidsAndUnknownColors) {
  const auto is_void = [](int x, int y) { return x < 12 && y < 9; };
  const auto is_clear = [](int x, int y) { return x > 35 && y > 20; };
  const HeightField heights =
      MakeField(61, 43, [&](int x, int y) { return is_void(x, y) ? kVoid : HillHeight(x, y, 3); });
  const auto picture = [&](int x, int y) {
    // The values of voids and transparent samples must have no effect.
    if (is_clear(x, y)) return Rgba{255, 0, 255, 0};
    return is_void(x, y) ? Rgba{255, 255, 0, 255} : Picture(x, y);
  };
  const ExtendedField field = Make(heights, picture, 0.5);
  const ColoredMesh mesh = MeshOf(field, {.max_error = 4});
  EXPECT_LE(Measure(field, mesh).combined, 4 * (1 + 1e-12));
  EXPECT_EQ(MeasureExtendedError(field, mesh).height.samples, 61u * 43u - 12u * 9u);
  EXPECT_EQ(MeasureExtendedError(field, mesh).color_samples, 61u * 43u - 12u * 9u - 25u * 22u);
  bool has_clear = false;
  for (std::size_t i = 0; i < mesh.colors.size(); ++i) {
    const SamplePosition p = mesh.tin.vertices[i];
    EXPECT_TRUE(i < 4 || !is_void(p.x, p.y));
    EXPECT_NE(mesh.colors[i], (Rgb{255, 0, 255}));
    has_clear = has_clear || is_clear(p.x, p.y);
  }
  EXPECT_TRUE(has_clear);
  // The corner at (60, 42): its nearest known colour.
  const Rgba east = field.ColorAt(60, 20);
  EXPECT_EQ(field.NearestColor(60, 42), (Rgb{east[0], east[1], east[2]}));
}

TEST(ExtendedGreedy, KeepsItsBoundForExtremeHeights) {
  for (const float scale : {1e-30F, 1e30F}) {
    const ExtendedField field =
        Make(MakeField(40, 30, [&](int x, int y) { return scale * HillHeight(x, y, 9); }), Picture, 0.5);
    const double bound = 5 * static_cast<double>(scale);
    EXPECT_LE(Measure(field, MeshOf(field, {.max_error = bound})).combined, bound * (1 + 1e-9));
  }
}

TEST(ExtendedGreedy, KeepsItsBoundOnRandomFields) {
  Random random(11);
  for (int run = 0; run < 300; ++run) {
    const int width = 2 + random.Below(14), height = 2 + random.Below(14), voids = random.Below(3),
              clear = random.Below(3);
    const float scale = std::ldexp(1.0F, random.Below(40) - 20);
    const HeightField heights = MakeField(width, height, [&](int x, int y) {
      const bool is_void = x + y > 0 && random.Below(8) < voids;
      return is_void ? kVoid : scale * static_cast<float>(random.Below(1000));
    });
    const auto noise = [&](int x, int y) {
      const auto level = [&] { return static_cast<std::uint8_t>(random.Below(256)); };
      return Rgba{level(), level(), level(), static_cast<std::uint8_t>(x + y > 0 && random.Below(8) < clear ? 0 : 255)};
    };
    const ExtendedField field = Make(heights, noise, random.Unit());
    const double bound = static_cast<double>(scale) * 1000 * random.Unit();
    const ColoredMesh mesh = MeshOf(field, {.max_error = bound});
    EXPECT_LE(Measure(field, mesh).combined, bound * (1 + 1e-12)) << run;
  }
}

TEST(ExtendedField, RefusesWhatHasNoMeaning) {
  const auto opaque = Colors(8, 6, [](int, int) { return Rgba{1, 2, 3, 255}; });
  const auto fails = [&](std::vector<Rgba> colors, double weight, const char* words) {
    const auto field = ExtendedField::Make(Flat(8, 6), std::move(colors), weight);
    ASSERT_FALSE(field.has_value());
    EXPECT_EQ(field.error().code, ErrorCode::kInvalidArgument);
    EXPECT_NE(field.error().message.find(words), std::string::npos) << field.error().message;
  };
  fails({}, 0.5, "48 colours, not 0");
  for (const double weight : {-0.1, 1.1, std::nan("")}) fails(opaque, weight, "weight");
  fails(std::vector<Rgba>(48), 0.5, "transparent");
}

}  // namespace
}  // namespace terrace::tin
