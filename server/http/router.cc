#include "server/http/router.h"

#include <algorithm>
#include <forward_list>
#include <optional>
#include <utility>
#include <vector>

#include "proto/documents/implicit_tree.h"
#include "server/http/query.h"
#include "server/http/text.h"
#include "server/tiles/dataset_view.h"

namespace terrace::server {
namespace {

tl::unexpected<Error> NotFound() {
  return MakeError(ErrorCode::kNotFound, "no such URL; /datasets lists those of each dataset");
}

// A path without scheme and authority, or nothing.
std::optional<std::string_view> OriginForm(std::string_view target) {
  if (target.starts_with('/')) return target;
  const std::optional<std::string_view> rest = AfterScheme(target);
  if (!rest) return std::nullopt;
  const std::size_t path = rest->find_first_of("/?");
  if (path == std::string_view::npos) return "/";
  return (*rest)[path] == '/' ? rest->substr(path) : std::optional<std::string_view>();
}

// One tile has one URL.
std::optional<std::int64_t> TileNumber(std::string_view text) { return PlainDecimal(text, /*max_digits=*/9); }

// Web Mercator has one root, TMS geodetic two side by side.
bool IsInScheme(const geo::TileKey& key, tiler::TileFormat format) {
  return geo::IsValid(key) && (format != tiler::TileFormat::kHeightPng || key.x < geo::TileRows(key.level));
}

// Cuts the extension of a tile URL off its last segment.
std::optional<tiler::TileFormat> CutFormat(std::string_view& name) {
  constexpr std::pair<std::string_view, tiler::TileFormat> kSuffixes[] = {
      {".terrain", tiler::TileFormat::kQuantizedMesh},
      {".glb", tiler::TileFormat::kGlb},
      {".png", tiler::TileFormat::kHeightPng}};
  for (const auto& [suffix, format] : kSuffixes) {
    if (!name.ends_with(suffix)) continue;
    name.remove_suffix(suffix.size());
    return format;
  }
  return std::nullopt;
}

std::optional<geo::TileKey> ParseTileKey(std::string_view z, std::string_view x, std::string_view y,
                                         tiler::TileFormat format) {
  const auto level = TileNumber(z), column = TileNumber(x), row = TileNumber(y);
  if (!level || !column || !row || *level > geo::kMaxLevel) return std::nullopt;
  const geo::TileKey key{static_cast<int>(*level), *column, *row};
  return IsInScheme(key, format) ? std::optional(key) : std::nullopt;
}

// "9-272-359": level, column and row of an implicit tree's root.
std::optional<geo::TileKey> ParseRoot(std::string_view name) {
  const std::size_t first = name.find('-'), second = name.find('-', first + 1);
  if (first == std::string_view::npos || second == std::string_view::npos) return std::nullopt;
  return ParseTileKey(name.substr(0, first), name.substr(first + 1, second - first - 1), name.substr(second + 1),
                      tiler::TileFormat::kGlb);
}

// Cuts ".7.subtree" off the last segment of a subtree's URL, and gives the 7; nothing where it is not there.
std::optional<int> CutSubtreeLevels(std::string_view& row) {
  constexpr std::string_view kSuffix = ".subtree";
  if (!row.ends_with(kSuffix)) return std::nullopt;
  const std::string_view rest = row.substr(0, row.size() - kSuffix.size());
  const std::size_t dot = rest.find('.');
  if (dot == std::string_view::npos) return std::nullopt;
  const auto levels = TileNumber(rest.substr(dot + 1));
  if (!levels || *levels < 1 || *levels > proto::kTallestSubtree) return std::nullopt;
  row = rest.substr(0, dot);
  return static_cast<int>(*levels);
}

// The decoded segments of a path; an encoded '/' does not separate.
class Segments {
 public:
  // Nothing: malformed percent-encoding. `path` has to outlive the segments.
  static std::optional<Segments> Of(std::string_view path) {
    Segments segments;
    segments.pieces_.reserve(kUsual);
    for (std::size_t at = 0; at != std::string_view::npos;) {
      const std::size_t next = path.find('/', at + 1);
      std::string_view piece = path.substr(at + 1, next == std::string_view::npos ? next : next - at - 1);
      if (piece.find('%') != std::string_view::npos) {
        std::optional<std::string> decoded = PercentDecode(piece);
        if (!decoded) return std::nullopt;
        piece = segments.decoded_.emplace_front(*std::move(decoded));
      }
      segments.pieces_.push_back(piece);
      at = next;
    }
    return segments;
  }

  std::size_t size() const { return pieces_.size(); }
  std::string_view operator[](std::size_t i) const { return pieces_[i]; }

 private:
  static constexpr std::size_t kUsual = 6;  // the longest of the fixed forms

  std::vector<std::string_view> pieces_;
  std::forward_list<std::string> decoded_;  // of pieces that had to be; their places do not change
};

// A content or a subtree of an implicit tree: 3dtiles/{root}/{level}/{x}/{y}.glb or .{levels}.subtree, counted from the
// root.
std::optional<Route> MatchImplicit(const Segments& segments) {
  if (segments.size() != 6 || segments[1] != "3dtiles") return std::nullopt;
  std::string_view row = segments[5];
  const std::optional<int> subtree_levels = CutSubtreeLevels(row);
  if (!subtree_levels && CutFormat(row) != tiler::TileFormat::kGlb) return std::nullopt;
  const auto root = ParseRoot(segments[2]);
  const auto level = TileNumber(segments[3]), x = TileNumber(segments[4]), y = TileNumber(row);
  if (!root || !level || !x || !y || root->level + *level > geo::kMaxLevel) return std::nullopt;
  const std::int64_t side = std::int64_t{1} << *level;
  if (*x >= side || *y >= side) return std::nullopt;
  Route route;
  route.root = *root;
  route.key = {root->level + static_cast<int>(*level), root->x * side + *x, root->y * side + *y};
  route.kind = subtree_levels ? RouteKind::kSubtree : RouteKind::kTile;
  route.subtree_levels = subtree_levels.value_or(0);
  route.format = tiler::TileFormat::kGlb;
  return route;
}

std::optional<Route> MatchFixed(const Segments& segments) {
  if (segments.size() > 1 && segments[0] != "viewer") return std::nullopt;
  Route route;
  if (segments.size() > 1) {
    for (std::size_t i = 1; i < segments.size(); ++i) route.file.append(i > 1 ? "/" : "").append(segments[i]);
    if (route.file.empty()) route.file = "index.html";
    return route;
  }
  if (segments[0].empty()) {
    route.file = "index.html";
    return route;
  }
  static constexpr std::pair<std::string_view, RouteKind> kFixed[] = {{"datasets", RouteKind::kDatasets},
                                                                      {"livez", RouteKind::kLive},
                                                                      {"readyz", RouteKind::kReady},
                                                                      {"metrics", RouteKind::kMetrics}};
  for (const auto& [name, kind] : kFixed) {
    if (segments[0] != name) continue;
    route.kind = kind;
    return route;
  }
  return std::nullopt;
}

// No parameter's name needs it, and who does not undo it does not know the parameter: in token%3D or %74oken= a token
// would be told to everybody who reads the URL.
bool HasEncodedName(std::string_view query) {
  if (query.find('%') == std::string_view::npos) return false;
  while (!query.empty()) {
    const std::string_view piece = NextPiece(query, '&');
    if (piece.substr(0, piece.find('=')).find('%') != std::string_view::npos) return true;
  }
  return false;
}

}  // namespace

std::string_view ToString(RouteKind kind) {
  switch (kind) {
    case RouteKind::kTile:
      return "tile";
    case RouteKind::kLayer:
      return "layer";
    case RouteKind::kTileset:
      return "tileset";
    case RouteKind::kSubtree:
      return "subtree";
    case RouteKind::kTileJson:
      return "tilejson";
    case RouteKind::kHeights:
      return "heights";
    case RouteKind::kMesh:
      return "mesh";
    case RouteKind::kDatasets:
      return "datasets";
    case RouteKind::kViewer:
      return "viewer";
    case RouteKind::kLive:
      return "livez";
    case RouteKind::kReady:
      return "readyz";
    case RouteKind::kMetrics:
      return "metrics";
  }
  return "none";
}

Result<Route> Match(std::string_view target) {
  const std::optional<std::string_view> origin = OriginForm(target);
  if (!origin || origin->find('#') != std::string_view::npos) {
    return MakeError(ErrorCode::kInvalidArgument, "malformed request target");
  }
  const std::size_t question = std::min(origin->find('?'), origin->size());
  const std::optional<Segments> segments = Segments::Of(origin->substr(0, question));
  if (!segments) return MakeError(ErrorCode::kInvalidArgument, "malformed percent-encoding in the path");

  std::optional<Route> route = MatchFixed(*segments);
  if (!route) {
    route = MatchImplicit(*segments).value_or(Route());
    route->dataset = (*segments)[0];
    if (route->kind != RouteKind::kViewer) {
      // An implicit tree's.
    } else if (segments->size() == 2 && (*segments)[1] == "tileset.json") {
      route->kind = RouteKind::kTileset;
    } else if (segments->size() == 2 && (*segments)[1] == "layer.json") {
      route->kind = RouteKind::kLayer;
    } else if (segments->size() == 2 && (*segments)[1] == "tiles.json") {
      route->kind = RouteKind::kTileJson;
    } else if (segments->size() == 2 && (*segments)[1] == "heights") {
      route->kind = RouteKind::kHeights;
    } else if (segments->size() == 2 && (*segments)[1] == "mesh") {
      route->kind = RouteKind::kMesh;
    } else if (segments->size() == 4) {
      std::string_view y = (*segments)[3];
      const auto format = CutFormat(y);
      const auto key = format ? ParseTileKey((*segments)[1], (*segments)[2], y, *format) : std::nullopt;
      if (!key) return NotFound();
      route->kind = RouteKind::kTile;
      route->key = *key;
      route->format = *format;
    } else {
      return NotFound();
    }
    if (IsReservedName(route->dataset)) return NotFound();
  }
  route->query = std::string(origin->substr(std::min(question + 1, origin->size())));
  // The viewer's pages keep their state in the query, which is nothing to the server.
  if (route->kind != RouteKind::kViewer && HasEncodedName(route->query)) {
    return MakeError(ErrorCode::kInvalidArgument, "a parameter's name has a percent sign; write it plainly");
  }
  return std::move(*route);
}

}  // namespace terrace::server
