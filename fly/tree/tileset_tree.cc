// The tree of a tileset.json: explicit tiles, and below them implicit quadtrees that grow with their subtrees.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "fly/scene/json_reason.h"
#include "fly/tree/subtree.h"
#include "fly/tree/tile_tree.h"

namespace terrace::fly {

struct ImplicitTree {
  std::string content_uri, subtree_uri;  // content_uri: empty if no tile has content
  int subtree_levels = 1, available_levels = 1;
  Region region;
  std::map<std::tuple<int, std::int64_t, std::int64_t>, Subtree3d> subtrees;  // by level, x, y of their roots
};

namespace {

using Json = nlohmann::json;

constexpr int kMaxDepth = 64;   // of explicit tiles
constexpr int kMaxLevels = 31;  // of an implicit tiling: columns and rows have 32 bits
constexpr int kMaxSubtreeLevels = 12;

[[noreturn]] void Fail(const std::string& what) { throw std::runtime_error(what); }

[[noreturn]] void Refuse(const std::string& feature) { Fail("it uses " + feature + ", which fly does not read"); }

// `json`: a tile or a volume.
void RefuseExtensions(const Json& json) {
  if (!json.contains("extensions")) return;
  for (const char* name : {"3DTILES_implicit_tiling", "3DTILES_multiple_contents", "3DTILES_bounding_volume_S2",
                           "3DTILES_bounding_volume_cylinder"}) {
    if (json.at("extensions").contains(name)) Refuse(name);
  }
}

Volume ParseVolume(const Json& json) {
  if (json.contains("region")) {
    const auto r = json.at("region").get<std::vector<double>>();
    if (r.size() != 6) Fail("a region has not 6 numbers");
    Rectangle rectangle{geo::ToDegrees(r[0]), geo::ToDegrees(r[1]), geo::ToDegrees(r[2]), geo::ToDegrees(r[3])};
    if (rectangle.east < rectangle.west) rectangle.east += 360;  // across the antimeridian
    return Region(rectangle, r[4], r[5]);
  }
  if (json.contains("sphere")) {
    const auto s = json.at("sphere").get<std::vector<double>>();
    if (s.size() != 4) Fail("a sphere has not 4 numbers");
    return Sphere{{s[0], s[1], s[2]}, s[3]};
  }
  if (!json.contains("box")) RefuseExtensions(json);
  const auto b = json.at("box").get<std::vector<double>>();
  if (b.size() != 12) Fail("a box has not 12 numbers");
  return OrientedBox{{b[0], b[1], b[2]}, {geo::Vec3{b[3], b[4], b[5]}, {b[6], b[7], b[8]}, {b[9], b[10], b[11]}}};
}

// The key of the quadtree's tile that the region is; nothing if it is none.
std::optional<geo::TileKey> KeyOf(const Volume& volume) {
  const auto* region = std::get_if<Region>(&volume);
  if (region == nullptr) return std::nullopt;
  const Rectangle& r = region->rectangle();
  const double side = r.east - r.west;
  if (!(side > 0)) return std::nullopt;
  const int level = static_cast<int>(std::lround(std::log2(180 / side)));
  if (level < 0 || level > geo::kMaxLevel) return std::nullopt;
  const double width = 180.0 / static_cast<double>(geo::TileRows(level));
  const std::int64_t columns = geo::TileColumns(level), column = std::llround((r.west + 180) / width) % columns;
  const geo::TileKey key{level, (column + columns) % columns, std::llround((r.south + 90) / width)};
  const Rectangle exact = RectangleOf(key);
  const double slack = width / 1e6;
  const bool same = std::abs(std::remainder(exact.west - r.west, 360)) < slack &&
                    std::abs(exact.south - r.south) < slack && std::abs(exact.north - r.north) < slack;
  return same ? std::optional(key) : std::nullopt;
}

std::tuple<int, std::int64_t, std::int64_t> SubtreeOf(const geo::TileKey& local, int subtree_levels) {
  const int below = local.level % subtree_levels;
  return {local.level - below, local.x >> below, local.y >> below};
}

Tile& AddTile(Tile& parent) {
  parent.children.push_back(std::make_unique<Tile>());
  parent.children.back()->parent = &parent;
  return *parent.children.back();
}

// The region of a descendant of the implicit root, with the root's heights.
Region PartOf(const Region& root, const geo::TileKey& local) {
  const Rectangle& r = root.rectangle();
  const auto parts = static_cast<double>(std::int64_t{1} << local.level);
  const double width = (r.east - r.west) / parts, height = (r.north - r.south) / parts;
  const double west = r.west + width * static_cast<double>(local.x),
               south = r.south + height * static_cast<double>(local.y);
  return {{west, south, west + width, south + height}, root.min_height_m(), root.max_height_m()};
}

std::string UriOf(const Json& content) {
  const bool is_of_1_0 = content.contains("url") && !content.contains("uri");
  auto uri = content.at(is_of_1_0 ? "url" : "uri").get<std::string>();
  const std::string path = uri.substr(0, uri.find_first_of("?#"));
  if (path.ends_with(".json")) Refuse("an external tileset, " + path);
  return uri;
}

void AddImplicitRoot(const Json& json, Tile& place) {
  const Json& tiling = json.at("implicitTiling");
  if (tiling.at("subdivisionScheme") != "QUADTREE") Fail("an implicit tiling is no QUADTREE");
  const auto* region = std::get_if<Region>(&place.volume);
  if (region == nullptr) Fail("an implicit tiling without a region");
  auto tree = std::make_shared<ImplicitTree>();
  if (json.contains("content")) tree->content_uri = UriOf(json.at("content"));
  tree->subtree_uri = tiling.at("subtrees").at("uri").get<std::string>();
  tree->subtree_levels = tiling.at("subtreeLevels").get<int>();
  tree->available_levels = tiling.at("availableLevels").get<int>();
  if (tree->subtree_levels < 1 || tree->subtree_levels > kMaxSubtreeLevels || tree->available_levels < 1 ||
      tree->available_levels > kMaxLevels) {
    Fail(fmt::format(
        "an implicit tiling has \"availableLevels\": {} and \"subtreeLevels\": {}; fly reads 1 to {} and 1 to {}",
        tree->available_levels, tree->subtree_levels, kMaxLevels, kMaxSubtreeLevels));
  }
  tree->region = *region;
  place.content = Content::kStructure;
  place.always_refine = true;
  place.state = LoadState::kReady;
  Tile& root = AddTile(place);
  root.volume = place.volume;
  root.key = place.key;
  root.geometric_error_m = place.geometric_error_m;
  root.tree = std::move(tree);
  root.children_unknown = root.tree->available_levels > 1;
}

void ParseTile(const Json& json, double enclosing_error_m, int depth, Tile& tile) {
  if (depth > kMaxDepth) Fail("tiles are nested too deeply");
  if (json.contains("transform")) Fail("a tile has a transform, which terrain does not need");
  if (const std::string refine = json.value("refine", "REPLACE"); refine != "REPLACE" && refine != "replace") {
    Fail("a tile does not REPLACE its parent");
  }
  RefuseExtensions(json);
  if (json.contains("contents")) Refuse("\"contents\", several for one tile");
  tile.volume = ParseVolume(json.at("boundingVolume"));
  tile.key = KeyOf(tile.volume);
  tile.geometric_error_m = json.at("geometricError").get<double>();
  if (json.contains("implicitTiling")) return AddImplicitRoot(json, tile);
  if (json.contains("content")) {
    tile.uri = UriOf(json.at("content"));
  } else {
    // Without content. It only groups its children if its error is not below the parent's; else it is drawn as nothing.
    tile.content = Content::kEmpty;
    tile.state = LoadState::kReady;
    tile.always_refine = tile.geometric_error_m >= enclosing_error_m;
  }
  if (!json.contains("children")) return;
  for (const Json& child : json.at("children")) ParseTile(child, tile.geometric_error_m, depth + 1, AddTile(tile));
}

bool HasFinerLevels(const Tile& tile) {
  return tile.children_unknown || (tile.key && tile.key->level > 0) ||
         std::any_of(tile.children.begin(), tile.children.end(),
                     [](const auto& child) { return HasFinerLevels(*child); });
}

class TilesetTree : public TileTree {
 public:
  explicit TilesetTree(const Json& json) {
    root_.content = Content::kStructure;
    root_.always_refine = true;
    root_.state = LoadState::kReady;
    const Json& top = json.at("root");
    root_.volume = ParseVolume(top.at("boundingVolume"));
    ParseTile(top, top.at("geometricError").get<double>() * 2, 0, AddTile(root_));
    version_ = first_version_ = VersionOf(json);
    has_finer_levels_ = HasFinerLevels(root_);
  }

  void AddChildren(Tile& tile) override {
    if (!tile.children_unknown || !tile.tree) return;
    const ImplicitTree& tree = *tile.tree;
    const auto found = tree.subtrees.find(SubtreeOf(tile.local, tree.subtree_levels));
    if (found == tree.subtrees.end()) return;  // RequestFor requests the subtree first
    tile.children_unknown = false;
    const int level = tile.local.level % tree.subtree_levels + 1;
    for (int i = 0; i < 4; ++i) {
      const geo::TileKey local{tile.local.level + 1, 2 * tile.local.x + i % 2, 2 * tile.local.y + i / 2};
      const auto x = static_cast<std::uint32_t>(local.x & ((std::int64_t{1} << level) - 1));
      const auto y = static_cast<std::uint32_t>(local.y & ((std::int64_t{1} << level) - 1));
      const bool is_last = level == tree.subtree_levels;
      // Only its own subtree says whether the root of one has content.
      if (is_last ? found->second.HasSubtree(x, y) : found->second.HasTile(level, x, y)) {
        AddImplicit(tile, local, is_last || HasContent(tree, found->second, level, x, y));
      }
    }
  }

  NextRequest RequestFor(const Tile& tile) const override {
    if (tile.content != Content::kMesh) return {};
    if (!tile.tree) return {NextRequest::Kind::kMesh, WithVersion(tile.uri), true};
    const auto subtree = SubtreeOf(tile.local, tile.tree->subtree_levels);
    if (!tile.tree->subtrees.contains(subtree)) {
      const geo::TileKey root{std::get<0>(subtree), std::get<1>(subtree), std::get<2>(subtree)};
      return {NextRequest::Kind::kSubtree, WithVersion(Fill(tile.tree->subtree_uri, root))};
    }
    return {NextRequest::Kind::kMesh, WithVersion(Fill(tile.tree->content_uri, tile.local))};
  }

  Result<void> TakeSubtree(Tile& tile, std::string_view bytes) override {
    ImplicitTree& tree = *tile.tree;
    Result<Subtree3d> subtree = Subtree3d::Parse(bytes, tree.subtree_levels);
    if (!subtree) return tl::unexpected(std::move(subtree).error());
    if (!HasContent(tree, *subtree, 0, 0, 0)) tile.content = Content::kEmpty;
    tree.subtrees.insert_or_assign(SubtreeOf(tile.local, tree.subtree_levels), *std::move(subtree));
    return {};
  }

  void TakeContent(Tile& /*tile*/, const TileContent& /*content*/) override {}  // the document states all volumes

  Result<void> TakeDocument(std::string_view text) override {
    try {
      version_ = VersionOf(Json::parse(text));
      return {};
    } catch (const std::exception& error) {
      return MakeError(ErrorCode::kInvalidArgument, "tileset.json cannot be read: {}", JsonReason(error));
    }
  }

 private:
  static std::string VersionOf(const Json& json) { return json.at("asset").value("tilesetVersion", ""); }

  static bool HasContent(const ImplicitTree& tree, const Subtree3d& subtree, int level, std::uint32_t x,
                         std::uint32_t y) {
    return !tree.content_uri.empty() && subtree.HasContent(level, x, y);
  }

  static void AddImplicit(Tile& parent, const geo::TileKey& local, bool has_content) {
    Tile& tile = AddTile(parent);
    tile.tree = parent.tree;
    tile.local = local;
    tile.volume = PartOf(parent.tree->region, local);
    tile.key = KeyOf(tile.volume);
    tile.geometric_error_m = parent.geometric_error_m / 2;
    tile.children_unknown = local.level + 1 < tile.tree->available_levels;
    if (has_content) return;
    tile.content = Content::kEmpty;
    tile.state = LoadState::kReady;
  }

  static std::string Fill(std::string uri, const geo::TileKey& local) {
    Replace(uri, "{level}", std::to_string(local.level));
    Replace(uri, "{x}", std::to_string(local.x));
    Replace(uri, "{y}", std::to_string(local.y));
    return uri;
  }

  // Where a parameter of the query is the version of the first document, replaces it by the current one.
  std::string WithVersion(std::string uri) const {
    if (first_version_.empty() || first_version_ == version_) return uri;
    for (std::size_t at = uri.find('?'); at != std::string::npos; at = uri.find('&', at + 1)) {
      const std::size_t value = uri.find('=', at) + 1, end = std::min(uri.find('&', at + 1), uri.size());
      if (value > at && value <= end && uri.compare(value, end - value, first_version_) == 0) {
        uri.replace(value, end - value, version_);
      }
    }
    return uri;
  }

  std::string first_version_;
};

}  // namespace

Result<std::unique_ptr<TileTree>> MakeTilesetTree(std::string_view tileset_json) {
  try {
    const Json json = Json::parse(tileset_json);
    for (const char* member : {"asset", "root"}) {
      if (json.contains(member)) continue;
      return MakeError(ErrorCode::kInvalidArgument,
                       "this is no tileset.json: it has no \"{}\"; give the URL of a tileset.json, or fly over a "
                       "layer.json without --format 3dtiles",
                       member);
    }
    return std::make_unique<TilesetTree>(json);
  } catch (const std::exception& error) {
    return MakeError(ErrorCode::kInvalidArgument, "tileset.json cannot be read: {}", JsonReason(error));
  }
}

}  // namespace terrace::fly
