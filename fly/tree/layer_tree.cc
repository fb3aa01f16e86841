// The tree of a layer.json: the quadtree of EPSG:4326 as far as "available" reaches.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "fly/scene/json_reason.h"
#include "fly/tree/tile_tree.h"

namespace terrace::fly {
namespace {

using Json = nlohmann::json;

// Clients assume these heights in metres until a tile has stated its own.
constexpr double kLowestGround = -1000, kHighestGround = 9000;
// Error of a root, metres. CesiumJS assumes a quarter of the width of a sample, with 65 samples over a root's half of
// the equator, and refines above 2 pixels. With the factor 8, 16 pixels refine at the same distances.
constexpr double kRootError = 8 * geo::kSemiMajorAxis * 0.25 / 65 * 3.14159265358979323846;

// Tiles of one level, as rectangles.
class LevelRanges {
 public:
  explicit LevelRanges(std::vector<geo::TileRange> ranges) : ranges_(std::move(ranges)) {
    std::sort(ranges_.begin(), ranges_.end(), [](const auto& a, const auto& b) { return a.start_y < b.start_y; });
    std::int64_t end = -1;
    for (const geo::TileRange& range : ranges_) ends_.push_back(end = std::max(end, range.end_y));
  }

  bool Contains(const geo::TileKey& key) const {
    auto i = std::upper_bound(ranges_.begin(), ranges_.end(), key.y,
                              [](std::int64_t y, const geo::TileRange& range) { return y < range.start_y; }) -
             ranges_.begin();
    // Goes back through the ranges that begin at or below the row, until none of the earlier ones reaches it.
    while (i-- > 0 && ends_[static_cast<std::size_t>(i)] >= key.y) {
      if (ranges_[static_cast<std::size_t>(i)].Contains(key)) return true;
    }
    return false;
  }

 private:
  std::vector<geo::TileRange> ranges_;
  std::vector<std::int64_t> ends_;  // highest end_y of the ranges up to each
};

struct Layer {
  std::string version, tile_template, note;
  std::vector<LevelRanges> available;
  bool has_finer_levels = false;
};

Result<Layer> ParseLayer(std::string_view text) {
  try {
    const Json json = Json::parse(text);
    if (!json.contains("tiles")) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "this is no layer.json: it has no \"tiles\"; give the URL of a layer.json, or fly over a "
                       "tileset with --format 3dtiles");
    }
    if (json.contains("tilejson") && !json.contains("available") &&
        !json.value("format", "").starts_with("quantized-mesh")) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "this is the TileJSON of a map; give the URL of a layer.json or tileset.json");
    }
    if (json.value("projection", "EPSG:4326") != "EPSG:4326") {
      return MakeError(ErrorCode::kInvalidArgument,
                       "layer.json: \"projection\" is {}; only EPSG:4326 can be flown over",
                       json.at("projection").dump());
    }
    if (json.value("scheme", Json("tms")) != "tms") {
      return MakeError(ErrorCode::kInvalidArgument, "layer.json: \"scheme\" is {}; only \"tms\" can be flown over",
                       json.at("scheme").dump());
    }
    if (const Json parent = json.value("parentUrl", Json("")); parent.is_string() && parent != "") {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "layer.json has a \"parentUrl\"; fly does not read parent layers; give the URL of a layer.json without one");
    }
    Layer layer;
    layer.version = json.value("version", "");
    layer.tile_template = json.at("tiles").at(0).get<std::string>();
    bool has_tiles = false;
    const Json none;
    for (const Json& level : json.contains("available") ? json.at("available") : none) {
      std::vector<geo::TileRange> ranges;
      for (const Json& range : level) {
        ranges.push_back({range.at("startX").get<std::int64_t>(), range.at("startY").get<std::int64_t>(),
                          range.at("endX").get<std::int64_t>(), range.at("endY").get<std::int64_t>()});
      }
      has_tiles |= !ranges.empty();
      layer.has_finer_levels |= !ranges.empty() && !layer.available.empty();
      layer.available.emplace_back(std::move(ranges));
      if (layer.available.size() > geo::kMaxLevel) break;
    }
    if (!has_tiles) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "layer.json lists no tiles in \"available\"; fly needs them there, because it does not read the "
                       "availability in tiles' metadata");
    }
    if (const Json period = json.value("metadataAvailability", Json()); period.is_number_integer() && period > 0) {
      layer.note = fmt::format(
          "layer.json has \"metadataAvailability\": {}, so cesium-native finds tiles by the metadata "
          "of others; this flight uses \"available\" alone",
          period.dump());
    }
    return layer;
  } catch (const std::exception& error) {
    return MakeError(ErrorCode::kInvalidArgument, "layer.json cannot be read: {}", JsonReason(error));
  }
}

class LayerTree : public TileTree {
 public:
  explicit LayerTree(Layer layer) : layer_(std::move(layer)) {
    version_ = layer_.version;
    note_ = layer_.note;
    has_finer_levels_ = layer_.has_finer_levels;
    root_.content = Content::kStructure;
    root_.always_refine = true;
    root_.state = LoadState::kReady;
    root_.volume = Region({-180, -90, 180, 90}, kLowestGround, kHighestGround);
    for (std::int64_t x = 0; x < 2; ++x) {
      const geo::TileKey key{0, x, 0};
      AddTile(root_, key, true, {kLowestGround, kHighestGround}, kRootError);
      if (IsAvailable(key)) continue;
      // cesium-native makes the tile too, and does not request it.
      root_.children.back()->content = Content::kEmpty;
      root_.children.back()->state = LoadState::kReady;
    }
  }

  // Adds all four children or none. The client upsamples the parent where the server has no child.
  void AddChildren(Tile& tile) override {
    if (!std::exchange(tile.children_unknown, false) || !tile.key || tile.key->level >= geo::kMaxLevel) return;
    const geo::TileKey& key = *tile.key;
    std::array<geo::TileKey, 4> keys;
    std::array<bool, 4> available{};
    for (int i = 0; i < 4; ++i) {
      const auto at = static_cast<std::size_t>(i);
      keys[at] = {key.level + 1, 2 * key.x + i % 2, 2 * key.y + i / 2};  // SW, SE, NW, NE
      available[at] = IsAvailable(keys[at]);
    }
    if (std::none_of(available.begin(), available.end(), [](bool is) { return is; })) return;
    const Region& region = std::get<Region>(tile.volume);
    for (std::size_t i = 0; i < 4; ++i) {
      AddTile(tile, keys[i], available[i], {region.min_height_m(), region.max_height_m()}, tile.geometric_error_m / 2);
    }
  }

  NextRequest RequestFor(const Tile& tile) const override {
    if (tile.content != Content::kMesh) return {};
    std::string uri = layer_.tile_template;
    Replace(uri, "{z}", std::to_string(tile.key->level));
    Replace(uri, "{x}", std::to_string(tile.key->x));
    Replace(uri, "{y}", std::to_string(tile.key->y));
    Replace(uri, "{version}", layer_.version);
    return {NextRequest::Kind::kMesh, std::move(uri), true};
  }

  Result<void> TakeSubtree(Tile& /*tile*/, std::string_view /*bytes*/) override { return {}; }

  void TakeContent(Tile& tile, const TileContent& content) override {
    if (!content.heights) return;
    tile.volume = Region(RectangleOf(*tile.key), content.heights->min_m, content.heights->max_m);
  }

  Result<void> TakeDocument(std::string_view json) override {
    Result<Layer> layer = ParseLayer(json);
    if (!layer) return tl::unexpected(std::move(layer).error());
    layer_ = *std::move(layer);
    version_ = layer_.version;
    has_finer_levels_ = layer_.has_finer_levels;
    return {};
  }

 private:
  bool IsAvailable(const geo::TileKey& key) const {
    const auto level = static_cast<std::size_t>(key.level);
    return level < layer_.available.size() && layer_.available[level].Contains(key);
  }

  static void AddTile(Tile& parent, const geo::TileKey& key, bool available, const HeightSpan& heights,
                      double error_m) {
    auto tile = std::make_unique<Tile>();
    tile->parent = &parent;
    tile->key = key;
    tile->content = available ? Content::kMesh : Content::kUpsampled;
    tile->children_unknown = available;
    tile->volume = Region(RectangleOf(key), heights.min_m, heights.max_m);
    tile->geometric_error_m = error_m;
    parent.children.push_back(std::move(tile));
  }

  Layer layer_;
};

}  // namespace

Result<std::unique_ptr<TileTree>> MakeLayerTree(std::string_view layer_json) {
  Result<Layer> layer = ParseLayer(layer_json);
  if (!layer) return tl::unexpected(std::move(layer).error());
  return std::make_unique<LayerTree>(*std::move(layer));
}

}  // namespace terrace::fly
