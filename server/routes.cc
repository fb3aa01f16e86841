#include "server/routes.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "proto/documents/implicit_tree.h"
#include "server/api/caching.h"
#include "server/api/tile_formats.h"
#include "server/handlers/handlers.h"
#include "server/http/http_error.h"
#include "server/http/text.h"
#include "server/openapi/openapi_document.h"
#include "server/openapi/operations.h"
#include "tiler/tile/tile_bounds.h"

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

// Without sign and leading zeros, so that a tile has one URL.
std::optional<std::int64_t> TileNumber(std::string_view text) { return PlainDecimal(text, /*max_digits=*/9); }

std::optional<geo::TileKey> ParseTileKey(std::string_view z, std::string_view x, std::string_view y, bool is_mercator) {
  const auto level = TileNumber(z), column = TileNumber(x), row = TileNumber(y);
  if (!level || !column || !row || *level > geo::kMaxLevel) return std::nullopt;
  const geo::TileKey key{static_cast<int>(*level), *column, *row};
  return tiler::IsInScheme(key, is_mercator) ? std::optional(key) : std::nullopt;
}

// "9-272-359": level, column and row of an implicit tree's root.
std::optional<geo::TileKey> ParseRoot(std::string_view name) {
  const std::size_t first = name.find('-'), second = name.find('-', first + 1);
  if (first == std::string_view::npos || second == std::string_view::npos) return std::nullopt;
  return ParseTileKey(name.substr(0, first), name.substr(first + 1, second - first - 1), name.substr(second + 1),
                      /*is_mercator=*/false);
}

// Removes ".7.subtree" from the last segment of a subtree's URL and returns 7; nothing if the segment does not end like
// this.
std::optional<int> TakeSubtreeLevels(std::string_view& row) {
  constexpr std::string_view kSuffix = ".subtree";
  if (!row.ends_with(kSuffix)) return std::nullopt;
  const std::string_view rest = row.substr(0, row.size() - kSuffix.size());
  const std::size_t dot = rest.find('.');
  if (dot == std::string_view::npos) return std::nullopt;
  const auto levels = TileNumber(rest.substr(dot + 1));
  if (!levels || *levels < 1 || *levels > proto::kMaxServedSubtreeLevels) return std::nullopt;
  row = rest.substr(0, dot);
  return static_cast<int>(*levels);
}

// Segment 2 names a tree's root. Segments 3 to 5 are a tile's level, x and y relative to that root; `row` is segment 5
// without its suffix.
bool ReadInTree(const Segments& segments, std::string_view row, Route& route) {
  const auto root = ParseRoot(segments[2]);
  const auto level = TileNumber(segments[3]), x = TileNumber(segments[4]), y = TileNumber(row);
  if (!root || !level || !x || !y || root->level + *level > geo::kMaxLevel) return false;
  const std::int64_t side = std::int64_t{1} << *level;
  if (*x >= side || *y >= side) return false;
  route.root = *root;
  route.key = {root->level + static_cast<int>(*level), root->x * side + *x, root->y * side + *y};
  return true;
}

// The following functions are values of RouteRow::read.

// For tiles: /{dataset}/{z}/{x}/{y}.terrain, .glb and so on.
bool ReadTile(const Segments& segments, Route& route) {
  std::string_view last = segments[3];
  route.format = TakeFormat(last);
  if (route.format == nullptr) return false;
  const auto key = ParseTileKey(segments[1], segments[2], last, route.format->is_mercator());
  if (!key) return false;
  route.key = *key;
  return true;
}

// For tiles for maps: /{dataset}/hillshade/{z}/{x}/{y}.png and so on. `kAt`: the segment of the level.
template <std::size_t kAt>
bool ReadTileInFolder(const Segments& segments, Route& route) {
  std::string_view last = segments[kAt + 2];
  const std::string folder = kAt == 2 ? std::string(segments[1]) : fmt::format("{}/{}", segments[1], segments[2]);
  route.format = TakeFormat(last, folder);
  if (route.format == nullptr) return false;
  const auto key = ParseTileKey(segments[kAt], segments[kAt + 1], last, route.format->is_mercator());
  if (!key) return false;
  route.key = *key;
  return true;
}

bool ReadMapLayer(const Segments& segments, Route& route) {
  route.format = FirstFormatIn(segments[1]);
  return route.format != nullptr;
}

// For implicit tiles: /{dataset}/3dtiles/{root}/{level}/{x}/{y}.glb, counted from the root.
bool ReadImplicitTile(const Segments& segments, Route& route) {
  std::string_view last = segments[5];
  route.format = TakeFormat(last);
  return route.format != nullptr && route.format->format == tiler::TileFormat::kGlb &&
         ReadInTree(segments, last, route);
}

bool ReadSubtree(const Segments& segments, Route& route) {
  std::string_view last = segments[5];
  const std::optional<int> levels = TakeSubtreeLevels(last);
  if (!levels || !ReadInTree(segments, last, route)) return false;
  route.subtree_levels = *levels;
  return true;
}

bool ReadViewerFile(const Segments& segments, Route& route) {
  for (std::size_t i = 1; i < segments.size(); ++i) route.file.append(i > 1 ? "/" : "").append(segments[i]);
  if (route.file.empty()) route.file = "index.html";
  return true;
}

// Logs and caches that do not decode names would not recognize `%74oken=` or `token%3D` as the token, and would store
// it. No parameter's name needs percent-encoding.
bool HasEncodedName(std::string_view query) {
  if (query.find('%') == std::string_view::npos) return false;
  while (!query.empty()) {
    const std::string_view piece = NextPiece(query, '&');
    if (piece.substr(0, piece.find('=')).find('%') != std::string_view::npos) return true;
  }
  return false;
}

// The text that a pattern's segment requires; empty: any.
std::string_view LiteralOf(std::string_view segment) {
  return segment.find('{') == std::string_view::npos ? segment : std::string_view();
}

// Limit of a body with a list of locations: a fixed number of bytes, and 64 for each location. 64 bytes hold two
// numbers with all digits and their separators, also where an HTML form percent-encodes these.
std::size_t MaxLocationsBytes(std::size_t max_locations) { return 4096 + 64 * max_locations; }

// The same for rays of six numbers.
std::size_t MaxRaysBytes(std::size_t max_rays) { return 4096 + 192 * max_rays; }

// RouteRow::handle of documents.
template <DocumentAnswer (*describe)(const HandlerState&, const RequestContext&)>
Answer Write(const HandlerState& state, const RequestContext& context) {
  return state.documents.Make(describe(state, context), context);
}

DocumentAnswer DescribeUrls(const HandlerState& state, const RequestContext& context);

// Most frequent routes first.
constexpr RouteRow kRows[] = {
    {.label = "tile", .pattern = "/{dataset}/{z}/{x}/{y}.{suffix}", .handle = AnswerTile, .read = ReadTile},
    {.label = "tile",
     .pattern = "/{dataset}/3dtiles/{root}/{level}/{x}/{y}.glb",
     .handle = AnswerTile,
     .operation = &kImplicitTileOperation,
     .read = ReadImplicitTile},
    {.label = "subtree",
     .pattern = "/{dataset}/3dtiles/{root}/{level}/{x}/{y}.{levels}.subtree",
     .handle = Write<DescribeSubtree>,
     .operation = &kSubtreeOperation,
     .read = ReadSubtree},
    {.label = "layer",
     .pattern = "/{dataset}/layer.json",
     .handle = Write<DescribeLayer>,
     .operation = &kLayerOperation,
     .has_templates = true},
    {.label = "tileset",
     .pattern = "/{dataset}/tileset.json",
     .handle = Write<DescribeTileset>,
     .operation = &kTilesetOperation,
     .has_templates = true},
    {.label = "tilejson",
     .pattern = "/{dataset}/tiles.json",
     .handle = AnswerTileJson,
     .operation = &kTileJsonOperation,
     .has_templates = true},
    {.label = "edits",
     .pattern = "/{dataset}/edits.geojson",
     .handle = Write<DescribeEdits>,
     .operation = &kEditsOperation},
    {.label = "hillshade",
     .pattern = "/{dataset}/hillshade/{z}/{x}/{y}.{suffix}",
     .handle = AnswerTile,
     .read = ReadTileInFolder<2>},
    {.label = "slope",
     .pattern = "/{dataset}/slope/{z}/{x}/{y}.{suffix}",
     .handle = AnswerTile,
     .read = ReadTileInFolder<2>},
    {.label = "contours",
     .pattern = "/{dataset}/contours/{z}/{x}/{y}.{suffix}",
     .handle = AnswerTile,
     .read = ReadTileInFolder<2>},
    {.label = "imagery",
     .pattern = "/{dataset}/imagery/{z}/{x}/{y}.{suffix}",
     .handle = AnswerTile,
     .read = ReadTileInFolder<2>},
    {.label = "imagery",
     .pattern = "/{dataset}/imagery/geodetic/{z}/{x}/{y}.{suffix}",
     .handle = AnswerTile,
     .read = ReadTileInFolder<3>},
    {.label = "hillshade",
     .pattern = "/{dataset}/hillshade/tiles.json",
     .handle = AnswerMapTileJson,
     .operation = &kHillshadeTileJsonOperation,
     .read = ReadMapLayer,
     .has_templates = true},
    {.label = "slope",
     .pattern = "/{dataset}/slope/tiles.json",
     .handle = AnswerMapTileJson,
     .operation = &kSlopeTileJsonOperation,
     .read = ReadMapLayer,
     .has_templates = true},
    {.label = "contours",
     .pattern = "/{dataset}/contours/tiles.json",
     .handle = AnswerMapTileJson,
     .operation = &kContoursTileJsonOperation,
     .read = ReadMapLayer,
     .has_templates = true},
    {.label = "imagery",
     .pattern = "/{dataset}/imagery/tiles.json",
     .handle = AnswerMapTileJson,
     .operation = &kImageryTileJsonOperation,
     .read = ReadMapLayer,
     .has_templates = true},
    {.label = "heights",
     .pattern = "/{dataset}/heights",
     .handle = AnswerHeights,
     .operation = &kHeightsOperation,
     .max_body_bytes = MaxLocationsBytes},
    {.label = "grid", .pattern = "/{dataset}/grid", .handle = AnswerGrid, .operation = &kGridOperation},
    {.label = "sight",
     .pattern = "/{dataset}/sight",
     .handle = AnswerSight,
     .operation = &kSightOperation,
     .max_body_bytes = MaxRaysBytes},
    {.label = "mesh", .pattern = "/{dataset}/mesh", .handle = AnswerArea, .operation = &kAreaOperation},
    {.label = "datasets",
     .pattern = "/datasets",
     .handle = Write<DescribeDatasets>,
     .operation = &kDatasetsOperation,
     .scope = DatasetScope::kVisibleDatasets},
    {.label = "openapi",
     .pattern = "/openapi.json",
     .handle = Write<DescribeUrls>,
     .operation = &kOpenApiOperation,
     .scope = DatasetScope::kNothing,
     .needs_no_catalog = true},
    {.label = "viewer",
     .pattern = "/",
     .handle = Write<DescribeViewerFile>,
     .operation = &kViewerOperation,
     .read = ReadViewerFile,
     .scope = DatasetScope::kNothing,
     .takes_any_query = true},
    {.label = "viewer",
     .pattern = "/viewer/{file}...",
     .handle = Write<DescribeViewerFile>,
     .operation = &kViewerFileOperation,
     .read = ReadViewerFile,
     .scope = DatasetScope::kNothing,
     .takes_any_query = true},
    {.label = "livez",
     .pattern = "/livez",
     .handle = AnswerLive,
     .operation = &kLiveOperation,
     .scope = DatasetScope::kNothing,
     .is_probe = true,
     .needs_no_catalog = true},
    {.label = "readyz",
     .pattern = "/readyz",
     .handle = AnswerReady,
     .operation = &kReadyOperation,
     .scope = DatasetScope::kNothing,
     .is_probe = true,
     .needs_no_catalog = true},
    {.label = "metrics",
     .pattern = "/metrics",
     .handle = AnswerMetrics,
     .operation = &kMetricsOperation,
     .scope = DatasetScope::kAllDatasets,
     .needs_no_catalog = true},
    {.label = "version",
     .pattern = "/version",
     .handle = AnswerVersion,
     .operation = &kVersionOperation,
     .scope = DatasetScope::kAllDatasets,
     .needs_no_catalog = true},
};

DocumentAnswer DescribeUrls(const HandlerState&, const RequestContext& context) {
  if (const Result<void> none = RefuseParameters(context.route.query); !none) {
    return ClientErrorResponse(none.error(), context.request->id);
  }
  DocumentPlan plan;
  plan.key = "openapi";
  plan.content_type = "application/json";
  plan.cache_control = kRevalidate;
  plan.write = [](const std::stop_token&) { return WriteOpenApi(DocumentedUrls()); };
  return plan;
}

}  // namespace

std::vector<DocumentedUrl> DocumentedUrls() {
  constexpr std::string_view kSuffix = ".{suffix}", kMore = "...";
  std::vector<DocumentedUrl> urls;
  for (const RouteRow& row : kRows) {
    DocumentedUrl url{.pattern = std::string(row.pattern),
                      .operation = row.operation,
                      .takes_post = row.takes_post(),
                      .takes_any_query = row.takes_any_query,
                      .needs_grant = row.scope != DatasetScope::kNothing};
    if (row.pattern.ends_with(kMore)) url.pattern.resize(url.pattern.size() - kMore.size());
    if (!row.pattern.ends_with(kSuffix)) {
      urls.push_back(std::move(url));
      continue;
    }
    url.pattern.resize(url.pattern.size() - kSuffix.size());
    // "/{dataset}/hillshade/{z}/{x}/{y}": the folder of the formats is between the dataset and the level.
    const std::size_t begin = std::string_view("/{dataset}/").size(), end = url.pattern.find("{z}");
    const std::string folder = url.pattern.substr(begin, end > begin ? end - 1 - begin : 0);
    for (const TileFormatRow& format : TileFormatRows()) {
      if (format.folder != folder) continue;
      DocumentedUrl of_format = url;
      of_format.pattern.append(format.suffix);
      of_format.operation = format.operation;
      urls.push_back(std::move(of_format));
    }
  }
  return urls;
}

const RouteTable& Routes() {
  static const RouteTable table(kRows);
  return table;
}

std::optional<Segments> Segments::Of(std::string_view path) {
  constexpr std::size_t kUsual = 6;  // the longest of the fixed forms
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

RouteTable::RouteTable(std::span<const RouteRow> rows) {
  for (const RouteRow& row : rows) {
    Entry entry{&row, {}};
    std::string_view rest = row.pattern.substr(1);
    if (rest.ends_with("...")) {
      entry.has_rest = true;
      rest.remove_suffix(3);
    }
    for (bool more = true; more;) {
      const std::size_t slash = rest.find('/');
      more = slash != std::string_view::npos;
      entry.pattern.push_back(LiteralOf(rest.substr(0, slash)));
      if (more) rest.remove_prefix(slash + 1);
    }
    entries_.push_back(std::move(entry));
  }
}

bool RouteTable::Fits(const Entry& entry, const Segments& segments) {
  const std::size_t size = entry.pattern.size();
  if (segments.size() != size && (segments.size() < size || !entry.has_rest)) return false;
  for (std::size_t i = 0; i < size; ++i) {
    // An empty segment of a pattern stands for any, except the one of the pattern "/".
    const bool is_any = entry.pattern[i].empty() && size > 1;
    if (!is_any && entry.pattern[i] != segments[i]) return false;
  }
  return true;
}

bool RouteTable::IsReserved(std::string_view name) const {
  return !name.empty() &&
         std::ranges::any_of(entries_, [&](const Entry& entry) { return entry.pattern.front() == name; });
}

Result<Route> RouteTable::Match(std::string_view target) const {
  const std::optional<std::string_view> origin = OriginForm(target);
  if (!origin || origin->find('#') != std::string_view::npos) {
    return MakeError(ErrorCode::kInvalidArgument, "malformed request target");
  }
  const std::size_t question = std::min(origin->find('?'), origin->size());
  const std::optional<Segments> segments = Segments::Of(origin->substr(0, question));
  if (!segments) return MakeError(ErrorCode::kInvalidArgument, "malformed percent-encoding in the path");

  Route route;
  for (const Entry& entry : entries_) {
    if (!Fits(entry, *segments)) continue;
    route = Route();
    if (entry.pattern.size() > 1 && entry.pattern.front().empty()) route.dataset = (*segments)[0];
    if (IsReserved(route.dataset)) continue;  // "viewer" is not a dataset
    if (entry.row->read != nullptr && !entry.row->read(*segments, route)) continue;
    route.row = entry.row;
    break;
  }
  if (route.row == nullptr) return NotFound();
  route.query = std::string(origin->substr(std::min(question + 1, origin->size())));
  if (!route.row->takes_any_query && HasEncodedName(route.query)) {
    return MakeError(ErrorCode::kInvalidArgument, "a parameter's name has a percent sign; write it plainly");
  }
  return route;
}

}  // namespace terrace::server
