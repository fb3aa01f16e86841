// Compares the heights in a tileset with the GLB tiles themselves, as a client gets both.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "proto/height_span.h"
#include "server/api/tile_formats.h"
#include "server/handlers/handlers.h"
#include "server/tiles/catalog.h"
#include "tests/proto/glb_decoder.h"
#include "tests/proto/subtree_reader.h"
#include "tests/server/handlers/at_once.h"
#include "tests/support/source_dir.h"
#include "tests/tiler/fetched_tile.h"

namespace terrace::server {
namespace {

using Json = nlohmann::json;
using proto::HeightSpan;

// The globe at 5', and 30 m of Tennessee in it.
CatalogPtr Mosaic() {
  const std::string folder = test_support::SourceDir() / "config/samples";
  auto source = dem::ElevationModel::Open({{folder + "/jacksboro.tif", 0}, {folder + "/etopo5.tif", 0}});
  if (!source) return nullptr;
  tiler::Dataset dataset;
  dataset.name = "earth";
  dataset.model = *std::move(source);
  return MakeCatalog(std::make_shared<const tiler::TilePipeline>(std::vector<tiler::Dataset>{std::move(dataset)}));
}

struct Geodetic {
  double longitude, latitude, height;
};

// Degrees and metres, by iteration (Bowring).
Geodetic ToGeodetic(const geo::Vec3& p) {
  const double e2 = geo::kEccentricitySquared, a = geo::kSemiMajorAxis, across = std::hypot(p.x, p.y);
  double latitude = std::atan2(p.z, across * (1 - e2));
  for (int i = 0; i < 8; ++i) {
    const double sine = std::sin(latitude), radius = a / std::sqrt(1 - e2 * sine * sine);
    latitude = std::atan2(p.z + e2 * radius * sine, across);
  }
  const double sine = std::sin(latitude);
  return {geo::ToDegrees(std::atan2(p.y, p.x)), geo::ToDegrees(latitude),
          across * std::cos(latitude) + p.z * sine - a * std::sqrt(1 - e2 * sine * sine)};
}

class TilesetBoundsTest : public testing::Test {
 protected:
  void SetUp() override {
    static const CatalogPtr mosaic = Mosaic();
    catalog_ = mosaic;
    ASSERT_NE(catalog_, nullptr);
    state_.emplace(catalog_);
  }

  std::string Get(const std::string& target) {
    const TestContext sent("/earth/" + target);
    const bool is_subtree = sent.context.route.row->label == "subtree";
    const HandlerState& from = state_->all;
    const Response response =
        AtOnce(is_subtree ? DescribeSubtree(from, sent.context) : DescribeTileset(from, sent.context), sent.request);
    EXPECT_EQ(response.status, 200) << target;
    return *response.body;
  }

  proto::DecodedGlb Glb(const std::string& target) {
    const Result<tiler::TileRequest> tile = NegotiateTile(TestContext("/earth/" + target).context, catalog_->datasets);
    EXPECT_TRUE(tile) << target;
    const auto built = catalog_->pipeline->Build(*tile, {});
    EXPECT_TRUE(built) << target;
    auto glb = proto::DecodeGlb(built->bytes);
    EXPECT_TRUE(glb) << target;
    return glb.value_or(proto::DecodedGlb{});
  }

  // `box`: west, south, east and north in radians. Sideways a vertex may be off by the rounding of positions: the steps
  // of large tiles are a metre.
  void ExpectHolds(const HeightSpan& heights, const std::array<double, 4>& box, const std::string& content) {
    ++checked_;
    constexpr double kStep = 1.0 / 6371000;
    for (const geo::Vec3& position : Glb(content).positions) {
      const Geodetic at = ToGeodetic(position);
      ASSERT_GE(at.height, heights.min_m) << content;
      ASSERT_LE(at.height, heights.max_m) << content;
      const double latitude = geo::ToRadians(at.latitude), cosine = std::cos(latitude);
      ASSERT_GE(latitude, box[1] - kStep) << content;
      ASSERT_LE(latitude, box[3] + kStep) << content;
      if (cosine < 1e-3) continue;
      const double off = std::remainder(geo::ToRadians(at.longitude) - (box[0] + box[2]) / 2, geo::ToRadians(360));
      ASSERT_LE(std::abs(off), (box[2] - box[0]) / 2 + kStep / cosine) << content;
    }
  }

  void CheckTree(const Json& tile, const HeightSpan& heights, bool builds);
  HeightSpan CheckTile(const Json& tile, bool builds);

  CatalogPtr catalog_;
  std::optional<TestHandlerState> state_;
  int checked_ = 0, named_ = 0, trees_ = 0;
  double flattest_tree_m = 1e9;
};

std::string Fill(std::string text, int level, std::int64_t x, std::int64_t y) {
  for (const auto& [name, value] : {std::pair("{level}", std::to_string(level)), std::pair("{x}", std::to_string(x)),
                                    std::pair("{y}", std::to_string(y))}) {
    text.replace(text.find(name), std::string_view(name).size(), value);
  }
  return text;
}

bool IsWithin(const HeightSpan& inner, const HeightSpan& outer) {
  return inner.min_m >= outer.min_m && inner.max_m <= outer.max_m;
}

// Builds the first and the last tile of each level of the first subtree.
void TilesetBoundsTest::CheckTree(const Json& tile, const HeightSpan& heights, bool builds) {
  ++trees_;
  flattest_tree_m = std::min(flattest_tree_m, heights.max_m - heights.min_m);
  const int levels = tile.at("implicitTiling").at("subtreeLevels");
  const std::string uri = tile.at("implicitTiling").at("subtrees").at("uri"), content = tile.at("content").at("uri");
  const Result<proto::ReadSubtree> read = proto::ParseSubtree(Get(Fill(uri, 0, 0, 0)), levels);
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_FALSE(read->min_heights.empty());
  const auto span = [&](std::size_t bit) {
    return HeightSpan{static_cast<double>(read->min_heights[bit]), static_cast<double>(read->max_heights[bit])};
  };
  const auto region = tile.at("boundingVolume").at("region").get<std::vector<double>>();
  std::size_t first = 0;
  for (int level = 0; level < levels; first = 4 * first + 1, ++level) {
    std::vector<std::size_t> there;
    for (std::size_t bit = first; bit < 4 * first + 1; ++bit) {
      if (!read->tiles[bit]) continue;
      there.push_back(bit);
      EXPECT_TRUE(IsWithin(span(bit), level > 0 ? span((bit - 1) / 4) : heights)) << uri << " " << bit;
    }
    if (there.empty() || !builds) continue;
    for (const std::size_t bit : {there.front(), there.back()}) {
      std::int64_t x = 0, y = 0;
      for (int k = 0; k < level; ++k) {
        x |= static_cast<std::int64_t>((bit - first) >> (2 * k) & 1) << k;
        y |= static_cast<std::int64_t>((bit - first) >> (2 * k + 1) & 1) << k;
      }
      const double side = (region[2] - region[0]) / (1 << level);
      const double west = region[0] + static_cast<double>(x) * side, south = region[1] + static_cast<double>(y) * side;
      ExpectHolds(span(bit), {west, south, west + side, south + side}, Fill(content, level, x, y));
    }
  }
}

// The heights that the tile states; if it has a sphere instead, those of the tiles below it.
HeightSpan TilesetBoundsTest::CheckTile(const Json& tile, bool builds) {
  const Json& bounds = tile.at("boundingVolume");
  HeightSpan stated;
  if (bounds.contains("region")) stated = {bounds.at("region")[4], bounds.at("region")[5]};
  if (tile.contains("implicitTiling")) {
    CheckTree(tile, stated, builds);
    return stated;
  }
  HeightSpan below{1e9, -1e9};
  int child = 0;
  for (const Json& next : tile.at("children")) {
    // Every ninth tile below the top, and all from level 4 down.
    const bool is_deep = next.at("geometricError").get<double>() < 5e4;
    below.Add(CheckTile(next, (builds || is_deep) && (is_deep || child++ % 9 == 4)));
  }
  if (!bounds.contains("region")) return below;
  EXPECT_TRUE(IsWithin(below, stated)) << bounds;
  if (!tile.contains("content")) return stated;
  ++named_;
  const auto region = bounds.at("region").get<std::vector<double>>();
  if (builds) ExpectHolds(stated, {region[0], region[1], region[2], region[3]}, tile.at("content").at("uri"));
  return stated;
}

TEST_F(TilesetBoundsTest, HoldEveryVertexAndFootAndLieInTheirParents) {
  for (const char* query : {"", "?error=300", "?fraction=0.1"}) {
    SCOPED_TRACE(query);
    named_ = trees_ = checked_ = 0;
    flattest_tree_m = 1e9;
    CheckTile(Json::parse(Get(std::string("tileset.json") + query)).at("root"), true);
    std::printf("%s: %d trees, %d named tiles, %d of all built, the flattest tree spans %.1f m\n", query, trees_,
                named_, checked_, flattest_tree_m);
    EXPECT_GE(trees_, 80);
    EXPECT_GE(named_, 4) << "tiles above Tennessee";
    EXPECT_GE(checked_, 10);
  }
}

}  // namespace
}  // namespace terrace::server
