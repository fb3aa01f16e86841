#include "server/routes.h"

#include <utility>

namespace terrace::server {
namespace {

// Limit of a body with a list of locations: a fixed number of bytes, and this number per location: two numbers with all
// digits, and three bytes per separator in a form.
std::size_t MaxLocationsBytes(std::size_t max_locations) { return 4096 + 64 * max_locations; }

// Most frequent routes first.
constexpr RouteRow kRows[] = {
    {.label = "tile",
     .pattern = "/{dataset}/{z}/{x}/{y}.{suffix}",
     .handle = [](const Handlers& from, const Call& call) { return from.tiles.Handle(call); },
     .read = ReadTile},
    {.label = "tile",
     .pattern = "/{dataset}/3dtiles/{root}/{level}/{x}/{y}.glb",
     .handle = [](const Handlers& from, const Call& call) { return from.tiles.Handle(call); },
     .read = ReadImplicitTile},
    {.label = "subtree",
     .pattern = "/{dataset}/3dtiles/{root}/{level}/{x}/{y}.{levels}.subtree",
     .handle = [](const Handlers& from,
                  const Call& call) { return from.documents.Make(from.tilesets.HandleSubtree(call), call); },
     .read = ReadSubtree},
    {.label = "layer",
     .pattern = "/{dataset}/layer.json",
     .handle = [](const Handlers& from,
                  const Call& call) { return from.documents.Make(from.layers.Handle(call), call); },
     .has_templates = true},
    {.label = "tileset",
     .pattern = "/{dataset}/tileset.json",
     .handle = [](const Handlers& from,
                  const Call& call) { return from.documents.Make(from.tilesets.Handle(call), call); },
     .has_templates = true},
    {.label = "tilejson",
     .pattern = "/{dataset}/tiles.json",
     .handle = [](const Handlers& from, const Call& call) -> Answer { return from.tile_json.Handle(call); },
     .has_templates = true},
    {.label = "heights",
     .pattern = "/{dataset}/heights",
     .handle = [](const Handlers& from, const Call& call) { return from.heights.Handle(call); },
     .max_body_bytes = MaxLocationsBytes},
    {.label = "mesh",
     .pattern = "/{dataset}/mesh",
     .handle = [](const Handlers& from, const Call& call) { return from.areas.Handle(call); }},
    {.label = "datasets",
     .pattern = "/datasets",
     .handle = [](const Handlers& from,
                  const Call& call) { return from.documents.Make(from.viewer.Datasets(call), call); },
     .shows = Shows::kSeenDatasets},
    {.label = "viewer",
     .pattern = "/",
     .handle = [](const Handlers& from, const Call& call) { return from.documents.Make(from.viewer.File(call), call); },
     .read = ReadViewerFile,
     .shows = Shows::kNothing,
     .takes_any_query = true},
    {.label = "viewer",
     .pattern = "/viewer/{file}...",
     .handle = [](const Handlers& from, const Call& call) { return from.documents.Make(from.viewer.File(call), call); },
     .read = ReadViewerFile,
     .shows = Shows::kNothing,
     .takes_any_query = true},
    {.label = "livez",
     .pattern = "/livez",
     .handle = [](const Handlers& from, const Call& call) -> Answer { return from.state.Live(call); },
     .shows = Shows::kNothing,
     .is_probe = true,
     .is_of_process = true},
    {.label = "readyz",
     .pattern = "/readyz",
     .handle = [](const Handlers& from, const Call& call) -> Answer { return from.state.Ready(call); },
     .shows = Shows::kNothing,
     .is_probe = true,
     .is_of_process = true},
    {.label = "metrics",
     .pattern = "/metrics",
     .handle = [](const Handlers& from, const Call& call) { return from.state.Metrics(call); },
     .shows = Shows::kAllDatasets,
     .is_of_process = true},
};

}  // namespace

Handlers::Handlers(CatalogPtr c, TileService& tile_service, std::shared_ptr<const StaticFiles> files,
                   const HandlerOptions& options, const ProcessState& process)
    : catalog(std::move(c)),
      tiles(catalog, tile_service, options),
      heights(catalog, tile_service, options),
      areas(catalog, tile_service, options),
      layers(catalog->datasets),
      tilesets(catalog->datasets, options.cache_control),
      tile_json(catalog->datasets, options.origin_headers),
      viewer(catalog->datasets, std::move(files)),
      state(process),
      documents(catalog, tile_service, options) {}

const RouteTable& Routes() {
  static const RouteTable table(kRows);
  return table;
}

}  // namespace terrace::server
