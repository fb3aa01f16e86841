#include <fmt/format.h>

#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "engine/core/escape_html.h"
#include "server/api/caching.h"
#include "server/handlers/handlers.h"
#include "server/http/http_error.h"
#include "server/http/text.h"

namespace terrace::server {
namespace {

using WriteDatasets = std::string (*)(std::span<const DatasetView>, const IsSeen&, const std::stop_token&,
                                      std::span<const PendingDataset>);

struct NamedUrl {
  std::string_view name;  // in /datasets; a literal
  std::string url;
};

// What the dataset serves. An archive alone has the formats that were baked, and heights if these have quantized-mesh.
std::vector<NamedUrl> UrlsOf(const DatasetView& dataset) {
  const auto has = [&](tiler::TileFormat format) { return CheckHasFormat(dataset, format).has_value(); };
  const bool has_terrain = has(tiler::TileFormat::kQuantizedMesh), has_sources = !dataset.only_archive;
  const std::string base = "/" + PercentEncode(dataset.name), version = "?v=" + dataset.version();
  std::vector<NamedUrl> urls;
  const auto add = [&](bool is_served, std::string_view name, const std::string& path) {
    if (is_served) urls.push_back({name, base + path});
  };
  add(has_terrain, "layer", "/layer.json");
  add(has(tiler::TileFormat::kGlb), "tileset", "/tileset.json");
  add(has_terrain, "tiles", "/{z}/{x}/{y}.terrain" + version);
  add(has(tiler::TileFormat::kHeightPng), "tiles_json", "/tiles.json");
  add(has_terrain, "heights", "/heights");
  add(has_terrain, "grid", "/grid");
  add(has_terrain, "sight", "/sight");
  add(has_sources, "mesh", "/mesh");
  add(dataset.edits_hash != nullptr, "edits", "/edits.geojson");
  add(has(tiler::TileFormat::kHillshade), "hillshade", "/hillshade/tiles.json");
  add(has(tiler::TileFormat::kSlope), "slope", "/slope/tiles.json");
  add(has(tiler::TileFormat::kContours), "contours", "/contours/tiles.json");
  add(dataset.imagery && has(tiler::TileFormat::kImagery), "imagery", "/imagery/tiles.json");
  add(dataset.imagery.has_value(), "imagery_geodetic", "/imagery/geodetic/{z}/{x}/{y}.webp" + version);
  return urls;
}

// The pending datasets that the client may see.
std::vector<PendingDataset> PendingOfSeen(const HandlerState& state, const RequestContext& context) {
  std::vector<PendingDataset> pending = state.process.PendingOf(*state.catalog);
  std::erase_if(pending,
                [&](const PendingDataset& one) { return !context.sees_all() && !context.grant->Sees(one.name); });
  return pending;
}

// A plan to call `write` for the datasets that the client may see. `all`: the document of all datasets. `pending`: what
// PendingOfSeen returns.
DocumentPlan PlanOfSeen(const HandlerState& state, const Document& all, const RequestContext& context,
                        WriteDatasets write, std::vector<PendingDataset> pending) {
  DocumentPlan plan;
  // Each token has one Grant as long as the server runs.
  plan.key = fmt::format("{} {}", all.identity_etag, fmt::ptr(context.grant.get()));
  for (const PendingDataset& one : pending) plan.key += fmt::format(" {}:{}:{}", one.name, one.percent, one.has_failed);
  plan.content_type = all.content_type;
  plan.cache_control = kRevalidate;
  const GrantPtr limited = context.sees_all() ? nullptr : context.grant;
  plan.write = [datasets = std::span<const DatasetView>(state.catalog->datasets), limited, write,
                pending = std::move(pending)](const std::stop_token& stop) {
    const auto is_seen = limited ? IsSeen([&](const DatasetView& view) { return limited->Sees(view.name); }) : IsSeen();
    return write(datasets, is_seen, stop, pending);
  };
  return plan;
}

}  // namespace

std::string DatasetsJson(std::span<const DatasetView> datasets, const IsSeen& is_seen, const std::stop_token& stop,
                         std::span<const PendingDataset> pending) {
  using Json = nlohmann::ordered_json;
  const auto json_of = [](const dem::GeoBounds& box) {
    return Json::array({box.west, box.south, box.east, box.north});
  };
  Json list = Json::array();
  for (const DatasetView& dataset : datasets) {
    if (stop.stop_requested()) return {};
    if (is_seen && !is_seen(dataset)) continue;
    Json entry;
    entry["name"] = dataset.name;
    entry["version"] = dataset.version();
    entry["attribution"] = dataset.attribution;
    entry["bounds"] = json_of(dataset.bounds);
    entry["finest_bounds"] = json_of(FinestBounds(dataset));
    entry["sources"] = dataset.sources;
    entry["min_level"] = 0;
    entry["max_level"] = dataset.max_level();
    entry["heights"]["min"] = dataset.heights.min;
    entry["heights"]["max"] = dataset.heights.max;
    for (const auto& [name, url] : UrlsOf(dataset)) entry["urls"][std::string(name)] = url;
    if (dataset.imagery) {
      Json& imagery = entry["imagery"];
      imagery["attribution"] = dataset.imagery_attribution;
      imagery["bounds"] = json_of(dataset.imagery->bounds);
      imagery["max_level"] = dataset.imagery->max_mercator_depth;
      imagery["geodetic_max_level"] = dataset.imagery->max_geodetic_level;
    }
    list.push_back(std::move(entry));
  }
  Json document;
  document["datasets"] = std::move(list);
  for (const PendingDataset& one : pending) {
    Json entry{{"name", one.name}, {"percent", one.percent}};
    if (one.has_failed) entry["failed"] = true;
    document["preparing"].push_back(std::move(entry));
  }
  if (is_seen) document["more_with_token"] = true;
  // Attributions are the operator's text: invalid UTF-8 must not make the whole list fail.
  return document.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string IndexHtml(std::span<const DatasetView> datasets, const IsSeen& is_seen, const std::stop_token& stop,
                      std::span<const PendingDataset> pending) {
  std::string items;
  for (const DatasetView& dataset : datasets) {
    if (stop.stop_requested()) return {};
    if (is_seen && !is_seen(dataset)) continue;
    std::string links;
    for (const auto& [name, url] : UrlsOf(dataset)) {
      if (name != "layer" && name != "tileset" && name != "tiles_json") continue;
      links += fmt::format("{}<a href=\"{}\">{}</a>", links.empty() ? "" : ", ", url, url.substr(url.rfind('/') + 1));
    }
    items += fmt::format("<li>{}: {}</li>\n", EscapeHtml(dataset.name), links);
  }
  for (const PendingDataset& one : pending) {
    fmt::format_to(std::back_inserter(items), "<li>{}: {}</li>\n", EscapeHtml(one.name),
                   one.has_failed ? "cannot be opened as it is now" : fmt::format("being prepared, {} %", one.percent));
  }
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>terrace</title>{}</head>\n"
      "<body><h1>terrace</h1>\n<p>Terrain as quantized-mesh, 3D Tiles and raster-dem. Datasets "
      "(<a href=\"/datasets\">as JSON</a>):</p>\n<ul>\n{}</ul>\n</body></html>\n",
      pending.empty() ? "" : "<meta http-equiv=\"refresh\" content=\"5\">", items);
}

DocumentAnswer DescribeDatasets(const HandlerState& state, const RequestContext& context) {
  if (const Result<void> none = RefuseParameters(context.route.query); !none) {
    return ClientErrorResponse(none.error(), context.request->id);
  }
  std::vector<PendingDataset> pending = PendingOfSeen(state, context);
  if (context.sees_all() && pending.empty()) return Serve(state.list, *context.request, kRevalidate);
  return PlanOfSeen(state, state.list, context, DatasetsJson, std::move(pending));
}

// Pages keep their state in the query, so any query is allowed.
DocumentAnswer DescribeViewerFile(const HandlerState& state, const RequestContext& context) {
  if (const Document* file = state.viewer->Find(context.route.file)) return Serve(*file, *context.request, kRevalidate);
  if (state.viewer->empty() && context.route.file == "index.html") {
    std::vector<PendingDataset> pending = PendingOfSeen(state, context);
    if (context.sees_all() && pending.empty()) {
      Response index = Serve(state.index, *context.request, kRevalidate);
      index.depends_on_token = context.grant != nullptr;
      return index;
    }
    DocumentPlan index = PlanOfSeen(state, state.index, context, IndexHtml, std::move(pending));
    index.depends_on_token = context.grant != nullptr;
    return index;
  }
  return ProblemResponse(404, "no such URL; /datasets lists those of each dataset", context.request->id);
}

}  // namespace terrace::server
