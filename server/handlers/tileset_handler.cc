#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/geo/error_ladder.h"
#include "engine/geo/tile_cover.h"
#include "engine/geo/tile_key.h"
#include "proto/documents/implicit_tree.h"
#include "proto/documents/subtree.h"
#include "proto/documents/tileset.h"
#include "proto/height_span.h"
#include "proto/mesh/skirt.h"
#include "server/api/caching.h"
#include "server/api/tile_formats.h"
#include "server/handlers/handlers.h"
#include "server/http/http_error.h"
#include "server/http/text.h"
#include "server/tiles/catalog.h"

namespace terrace::server {
namespace {

dem::HeightRange RangeOf(const DatasetView& dataset, const geo::TileKey& key) {
  if (dataset.range_bound) return dataset.range_bound(key);
  return {std::min(dataset.min_height_m, dataset.floor_m), std::max(dataset.max_height_m, dataset.floor_m)};
}

double SkirtDepth(const DatasetView& dataset, const RequestedError& requested, int level) {
  const bool is_deepest = level == dataset.deepest_level();
  const int step = ErrorStepOf(requested, level, dataset);
  return proto::SkirtDepth(level, proto::SkirtError(level, step, is_deepest, dataset.error_fraction));
}

// Returns a range that contains the heights of all vertices, including skirts, of the tile and its descendants at this
// error. It is the bound on the tile's samples, widened by skirts and rounding, and then outwards to multiples of a
// power of two, which is at most a quarter of the error and at least 2^-6 m: such numbers are short and often equal.
// Reads no raster. Thread-safe. Precondition: a valid key.
proto::HeightSpan TileHeightSpan(const DatasetView& dataset, const RequestedError& requested, const geo::TileKey& key) {
  const int step = ErrorStepOf(requested, key.level, dataset);
  const double error_m = geo::LadderError(key.level, step, dataset.error_fraction);
  // Skirts are shorter on each deeper level, except on the deepest level at a small `fraction`.
  const double skirt_m =
      std::max(SkirtDepth(dataset, requested, key.level), SkirtDepth(dataset, requested, dataset.deepest_level()));
  // Positions are rounded to a grid of at most a 32nd of the error; the lower rims of skirts are rounded twice.
  const double rounding_m = error_m / 32;
  const dem::HeightRange range = RangeOf(dataset, key);
  constexpr int kFinestStep = -6;
  const double unit_m = std::ldexp(1, std::max(std::ilogb(error_m / 4), kFinestStep));
  return {std::floor((range.min - skirt_m - 2 * rounding_m) / unit_m) * unit_m,
          std::ceil((range.max + rounding_m) / unit_m) * unit_m};
}

// The query of the content templates for a request. The values of `compression` and `texture` have been checked.
std::string ContentQuery(const RequestedError& requested, std::string_view query) {
  std::string content = TileQuery(requested);
  const QueryParameters parameters = ParseQuery(query).value_or(QueryParameters());
  for (const std::string_view wanted : {"compression", "texture"}) {
    const auto sent = std::ranges::find(parameters, wanted, &QueryParameters::value_type::first);
    if (sent != parameters.end()) content += (content.empty() ? "" : "&") + sent->first + "=" + sent->second;
  }
  return content;
}

// The ranges of one level that touch the columns west .. east, in degrees, and the dataset's rows.
std::vector<geo::TileRange> TilesWithin(const DatasetView& dataset, int level, double west, double east) {
  const double tile = std::ldexp(180, -level);
  const auto first = [&](double degrees) { return static_cast<std::int64_t>(std::floor(degrees / tile)); };
  const auto last = [&](double degrees) { return static_cast<std::int64_t>(std::ceil(degrees / tile)) - 1; };
  geo::TileRange box{first(west + 180), first(dataset.south + 90), last(east + 180), last(dataset.north + 90)};
  box.end_x = std::max(box.start_x, box.end_x);
  box.end_y = std::max(box.start_y, box.end_y);
  std::vector<geo::TileRange> tiles;
  for (const geo::TileRange& range : dataset.available[static_cast<std::size_t>(level)]) {
    if (const geo::TileRange common = geo::Common(range, box); !geo::IsEmpty(common)) tiles.push_back(common);
  }
  return tiles;
}

// The available tiles that touch the dataset's bounds. Other tiles are available only so that parents have four
// children.
std::vector<std::vector<geo::TileRange>> TilesWithData(const DatasetView& dataset) {
  std::vector<std::vector<geo::TileRange>> levels;
  const bool crosses = dataset.west > dataset.east;
  for (int level = 0; level <= dataset.max_level(); ++level) {
    auto& tiles = levels.emplace_back(TilesWithin(dataset, level, dataset.west, crosses ? 180 : dataset.east));
    if (!crosses) continue;
    for (const geo::TileRange& range : TilesWithin(dataset, level, -180, dataset.east)) tiles.push_back(range);
    tiles = geo::Disjoint(std::move(tiles));
  }
  return levels;
}

std::string WriteTileset(const DatasetView& dataset, const std::vector<proto::TreeRoot>& roots,
                         RequestedError requested, std::string content_query, std::string subtree_query) {
  requested.at_least = requested.error_m.has_value();  // as TileQuery writes it into the templates
  proto::TilesetDescription tileset;
  tileset.version = dataset.version();
  tileset.attribution = dataset.attribution;
  tileset.roots = roots;
  tileset.heights = [&](const geo::TileKey& key) { return TileHeightSpan(dataset, requested, key); };
  tileset.content_query = std::move(content_query);
  tileset.subtree_query = std::move(subtree_query);
  return proto::EncodeTileset(tileset);
}

std::string WriteSubtree(const DatasetView& dataset, const RequestedError& requested, const geo::TileKey& top,
                         int levels) {
  proto::Subtree subtree;
  subtree.levels = levels;
  subtree.tiles = proto::BlocksBelow(dataset.available, top, levels);
  subtree.heights = [&](const geo::TileKey& below) {
    return TileHeightSpan(dataset, requested, proto::TileUnder(top, below.level, below.x, below.y));
  };
  return proto::EncodeSubtree(subtree);
}

}  // namespace

void AddTileset(const DatasetView& dataset, Handlers::OfDataset& made) {
  if (!CheckHasFormat(dataset, tiler::TileFormat::kGlb)) return;
  const std::vector<geo::TileKey> roots = proto::ImplicitRoots(TilesWithData(dataset));
  made.roots = std::make_shared<const std::vector<proto::TreeRoot>>(proto::ImplicitTrees(dataset.available, roots));
  made.tileset = Document::Make(WriteTileset(dataset, *made.roots, {}, "", ""), "application/json");
}

DocumentAnswer DescribeTileset(const Handlers& from, const RequestContext& context) {
  const Result<std::uint32_t> dataset = FindDataset(context.route.dataset, from.catalog->datasets);
  if (!dataset) return ClientErrorResponse(dataset.error(), context.request->id);
  if (const auto has = CheckHasFormat(from.catalog->datasets[*dataset], tiler::TileFormat::kGlb); !has) {
    return ClientErrorResponse(has.error(), context.request->id);
  }
  const Result<TileParameters> parameters =
      ParseTileParameters(context.route.query, /*allow_at_least=*/false, /*allow_compression=*/true);
  if (!parameters) return ClientErrorResponse(parameters.error(), context.request->id);
  const std::string content_parameters = ContentQuery(parameters->requested, context.route.query);
  std::string content_query = WithToken(content_parameters, context);
  if (content_query.empty()) return Serve(from.of_datasets[*dataset].tileset, *context.request, kRevalidate);
  std::string subtree_query = WithToken(TileQuery(parameters->requested), context);
  DocumentPlan plan;
  plan.key = fmt::format("tileset {} {} {}", *dataset, content_parameters, fmt::ptr(GrantInQuery(context)));
  plan.content_type = "application/json";
  plan.cache_control = kRevalidate;
  plan.write = [&view = from.catalog->datasets[*dataset], roots = from.of_datasets[*dataset].roots,
                requested = parameters->requested, content_query = std::move(content_query),
                subtree_query = std::move(subtree_query)](const std::stop_token&) {
    return WriteTileset(view, *roots, requested, content_query, subtree_query);
  };
  return plan;
}

DocumentAnswer DescribeSubtree(const Handlers& from, const RequestContext& context) {
  const Result<std::uint32_t> index = FindDataset(context.route.dataset, from.catalog->datasets);
  if (!index) return ClientErrorResponse(index.error(), context.request->id);
  const Result<TileParameters> parameters =
      ParseTileParameters(context.route.query, /*allow_at_least=*/true, /*allow_compression=*/true);
  if (!parameters) return ClientErrorResponse(parameters.error(), context.request->id);
  const DatasetView& dataset = from.catalog->datasets[*index];
  if (const auto has = CheckHasFormat(dataset, tiler::TileFormat::kGlb); !has) {
    return ClientErrorResponse(has.error(), context.request->id);
  }
  if (!IsAvailable(dataset, context.route.key) ||
      (context.route.key.level - context.route.root.level) % context.route.subtree_levels != 0) {
    return ProblemResponse(404, "the dataset has no such subtree; its tileset.json says where they begin",
                           context.request->id);
  }
  const RequestedError& requested = parameters->requested;
  DocumentPlan plan;
  plan.key = fmt::format("subtree {} {} {} {}{}", *index, geo::ToString(context.route.key),
                         context.route.subtree_levels, TileQuery(requested), requested.at_least ? "" : " alone");
  plan.content_type = "application/octet-stream";
  plan.cache_control = CacheControlOf(context.route.query, dataset, from.cache_control);
  plan.write = [&dataset, requested, top = context.route.key, levels = context.route.subtree_levels](
                   const std::stop_token&) { return WriteSubtree(dataset, requested, top, levels); };
  return plan;
}

}  // namespace terrace::server
