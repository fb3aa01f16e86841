#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "engine/geo/tile_key.h"
#include "proto/documents/implicit_tree.h"
#include "server/api/caching.h"
#include "server/api/tile_formats.h"
#include "server/handlers/handlers.h"
#include "server/http/http_error.h"
#include "server/http/text.h"
#include "server/tiles/catalog.h"
#include "tiler/tileset_documents.h"

namespace terrace::server {
namespace {

// Sets `is_known` to false if the range of the tile cannot be read; the range of the dataset contains it.
dem::HeightRange RangeOf(const DatasetView& dataset, const geo::TileKey& key, bool& is_known) {
  if (dataset.range_bound) {
    if (const Result<dem::HeightRange> range = dataset.range_bound(key)) return *range;
    is_known = false;
  }
  return {std::min(dataset.heights.min, dataset.floor_m), std::max(dataset.heights.max, dataset.floor_m)};
}

// The query of the content templates for a request. The values of `compression` and `texture` have been checked.
std::string ContentQuery(const geo::RequestedError& requested, std::string_view query) {
  std::string content = TileQuery(requested);
  const QueryParameters parameters = ParseQuery(query).value_or(QueryParameters());
  for (const std::string_view wanted : {"compression", "texture"}) {
    const auto sent = std::ranges::find(parameters, wanted, &QueryParameters::value_type::first);
    if (sent != parameters.end()) content += (content.empty() ? "" : "&") + sent->first + "=" + sent->second;
  }
  return content;
}

// `requested`: as TileQuery writes it into the templates. `are_ranges_known`: set by TileTree::range, as RangeOf does;
// must outlive the tree.
tiler::TileTree TreeOf(const DatasetView& dataset, geo::RequestedError requested, bool& are_ranges_known) {
  return {dataset.version(),
          dataset.attribution,
          dataset.available,
          dataset.bounds,
          dataset.error_scale.fraction,
          dataset.error_scale.max_source_level,
          [&](const geo::TileKey& key) { return RangeOf(dataset, key, are_ranges_known); },
          [&dataset, requested](int level) { return geo::ErrorStep(requested, level, dataset.error_scale); }};
}

DocumentText WriteTileset(const DatasetView& dataset, const std::vector<proto::TreeRoot>& roots,
                          geo::RequestedError requested, const std::string& content_query,
                          const std::string& subtree_query) {
  requested.at_least = requested.error_m.has_value();
  DocumentText tileset;
  tileset.bytes = tiler::TilesetJson(TreeOf(dataset, requested, tileset.is_final), roots, content_query, subtree_query);
  return tileset;
}

}  // namespace

void AddTileset(const DatasetView& dataset, HandlerState::DatasetDocuments& made) {
  if (!CheckHasFormat(dataset, tiler::TileFormat::kGlb)) return;
  bool are_ranges_known = true;  // not used: roots have no ranges
  made.roots =
      std::make_shared<const std::vector<proto::TreeRoot>>(tiler::TreesOf(TreeOf(dataset, {}, are_ranges_known)));
  DocumentText tileset = WriteTileset(dataset, *made.roots, {}, "", "");
  // Else each request writes it, until every range can be read.
  if (tileset.is_final) made.tileset = Document::Make(std::move(tileset.bytes), "application/json");
}

DocumentAnswer DescribeTileset(const HandlerState& state, const RequestContext& context) {
  const Result<std::uint32_t> dataset = FindDataset(context.route.dataset, state.catalog->datasets);
  if (!dataset) return ClientErrorResponse(dataset.error(), context.request->id);
  if (const auto has = CheckHasFormat(state.catalog->datasets[*dataset], tiler::TileFormat::kGlb); !has) {
    return ClientErrorResponse(has.error(), context.request->id);
  }
  const Result<TileParameters> parameters =
      ParseTileParameters(context.route.query, /*allow_at_least=*/false, /*allow_compression=*/true);
  if (!parameters) return ClientErrorResponse(parameters.error(), context.request->id);
  const std::string content_parameters = ContentQuery(parameters->requested, context.route.query);
  const auto has_kind =
      CheckHasQueriedTiles(state.catalog->datasets[*dataset], tiler::TileFormat::kGlb, content_parameters);
  if (!has_kind) return ClientErrorResponse(has_kind.error(), context.request->id);
  std::string content_query = WithToken(content_parameters, context);
  const Document& kept = state.dataset_documents[*dataset].tileset;
  if (content_query.empty() && kept.identity) return Serve(kept, *context.request, kRevalidate);
  std::string subtree_query = WithToken(TileQuery(parameters->requested), context);
  DocumentPlan plan;
  plan.key = fmt::format("tileset {} {} {}", *dataset, content_parameters, fmt::ptr(GrantInQuery(context)));
  plan.content_type = "application/json";
  plan.cache_control = kRevalidate;
  plan.write = [&view = state.catalog->datasets[*dataset], roots = state.dataset_documents[*dataset].roots,
                requested = parameters->requested, content_query = std::move(content_query),
                subtree_query = std::move(subtree_query)](const std::stop_token&) {
    return WriteTileset(view, *roots, requested, content_query, subtree_query);
  };
  return plan;
}

DocumentAnswer DescribeSubtree(const HandlerState& state, const RequestContext& context) {
  const Result<std::uint32_t> index = FindDataset(context.route.dataset, state.catalog->datasets);
  if (!index) return ClientErrorResponse(index.error(), context.request->id);
  const Result<TileParameters> parameters =
      ParseTileParameters(context.route.query, /*allow_at_least=*/true, /*allow_compression=*/true);
  if (!parameters) return ClientErrorResponse(parameters.error(), context.request->id);
  const DatasetView& dataset = state.catalog->datasets[*index];
  if (const auto has = CheckHasFormat(dataset, tiler::TileFormat::kGlb); !has) {
    return ClientErrorResponse(has.error(), context.request->id);
  }
  if (!IsAvailable(dataset, context.route.key) ||
      (context.route.key.level - context.route.root.level) % context.route.subtree_levels != 0) {
    return ProblemResponse(404, "the dataset has no such subtree; its tileset.json says where they begin",
                           context.request->id);
  }
  const geo::RequestedError& requested = parameters->requested;
  DocumentPlan plan;
  plan.key = fmt::format("subtree {} {} {} {}{}", *index, geo::ToString(context.route.key),
                         context.route.subtree_levels, TileQuery(requested), requested.at_least ? "" : " alone");
  plan.content_type = "application/octet-stream";
  plan.cache_control = CacheControlOf(context.route.query, dataset, state.cache_control);
  plan.write = [&dataset, requested, top = context.route.key,
                levels = context.route.subtree_levels](const std::stop_token& stop) {
    DocumentText subtree;
    subtree.bytes = tiler::SubtreeOf(TreeOf(dataset, requested, subtree.is_final), top, levels, stop);
    return subtree;
  };
  return plan;
}

}  // namespace terrace::server
