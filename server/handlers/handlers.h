// The handlers, one function for each kind of URL (server/routes.cc), and HandlerState, which they share.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "config/config.h"
#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "engine/edits/edit_effects.h"
#include "engine/geo/tile_key.h"
#include "proto/documents/implicit_tree.h"
#include "server/api/request_context.h"
#include "server/asio/asio.h"
#include "server/documents/document.h"
#include "server/documents/static_files.h"
#include "server/http/application.h"
#include "server/jobs/worker_pool.h"
#include "server/query/heights_query.h"
#include "server/query/tile_query.h"
#include "server/tiles/catalog.h"
#include "server/tiles/tile_service.h"

namespace terrace::server {

// The key in ServerStatus::problems of the folder of the statistics cache. No dataset has such a name.
inline constexpr const char* kCacheProblem = "/cache_dir";

// A dataset that is configured and not open yet.
struct PendingDataset {
  std::string name;
  int percent = 0;          // of its sources that are read
  bool has_failed = false;  // it cannot be opened as it is now
};

// The current state of the process. Thread-safe.
class ServerStatus {
 public:
  virtual ~ServerStatus() = default;
  virtual bool draining() const = 0;
  virtual bool opening() const = 0;  // the first catalog has not been opened yet
  // Problems by dataset; "" is the configuration, kCacheProblem the cache folder.
  virtual std::map<std::string, std::string> problems() const = 0;
  // The pending datasets of a catalog, in its order.
  virtual std::vector<PendingDataset> PendingOf(const Catalog& catalog) const = 0;
  virtual asio::awaitable<std::shared_ptr<const std::string>> MetricsText() const = 0;
};

// What handlers answer from: one for each catalog. Thread-safe. A request keeps it alive until it is answered.
struct HandlerState {
  // `workers` run all work that may block. What is passed by reference must outlive this object, except `config`.
  HandlerState(CatalogPtr catalog, WorkerPool& workers, TileService& tiles, DocumentFlights& document_flights,
               std::shared_ptr<const StaticFiles> viewer, const config::Config& config, const ServerStatus& process);

  const CatalogPtr catalog;
  WorkerPool& workers;
  TileService& tiles;
  const ServerStatus& process;
  const std::shared_ptr<const StaticFiles> viewer;

  // From the configuration.
  const std::string cache_control;  // for requests without a version
  // A literal: the headers in which a trusted proxy reports the origin; empty: no proxy is trusted.
  const std::string_view origin_headers;
  const std::size_t max_locations, max_mesh_samples;

  // Documents for requests without parameters.
  struct DatasetDocuments {
    Document layer;
    Document tileset;                                           // null bodies: it is written for each request
    std::shared_ptr<const std::vector<proto::TreeRoot>> roots;  // of its implicit trees
  };
  const std::vector<DatasetDocuments> dataset_documents;  // by index
  const Document list, index;                             // of all datasets: /datasets, and `/` without a viewer

  const DocumentMaker documents;
};

// GET of all tiles: terrain, GLB, height images and tiles for maps (server/api/tile_formats.h). Replies that need no
// build (refusals and cached tiles) are returned at once. Precondition: the route has a format.
Answer AnswerTile(const HandlerState& state, const RequestContext& context);
// "cache;desc=miss, queue;dur=0.021, read;dur=1.234, ...": milliseconds of the stages of the build.
std::string FormatServerTiming(std::string_view cache, const tiler::StageTimes& times);

// GET and POST /{dataset}/heights
Answer AnswerHeights(const HandlerState& state, const RequestContext& context);

struct CertifiedPoints {
  std::vector<geo::TileKey> tiles;              // without duplicates
  std::vector<std::uint32_t> tile_of_point;     // index into `tiles`
  std::vector<std::optional<double>> errors_m;  // by tile; nothing: the tile states none
};

// Returns the deepest available tile of each point, down to level `deepest`. kInvalidArgument, with a message for the
// client: more than tiler::kMaxTilesRead. kCancelled: a stop was requested.
Result<CertifiedPoints> CertifyingTilesOf(const DatasetView& dataset, std::span<const dem::GeoPosition> points,
                                          int deepest, const std::stop_token& stop = {});

// {"results":[{"elevation","location":{"lat","lng"},"dataset"}],"status":"OK"}, the format of Open Topo Data. Points of
// a path also have "distance". Metres; null if there is no height; "filled": true if a void was filled. The
// document of orthometric heights has "datum". With normals: "normal" [east, north, up] and "slope" in degrees. Points
// of a drawn surface have its "tile". `certified`: adds "certified_error" and "tile" to each point with a height; null:
// nothing is added. Returns an empty string if a stop was requested.
std::string HeightsJson(const HeightsQuery& query, const tiler::PointHeights& known, std::string_view dataset,
                        const CertifiedPoints* certified = nullptr, const std::stop_token& stop = {});

// For each point its height as a little-endian 32-bit float, NaN where there is none, and its normal if there are
// normals: east, north, up.
std::string HeightsBytes(const tiler::PointHeights& known);

// GET /{dataset}/grid (server/query/grid_query.h). The Terrain-Grid header has the grid's size, place and scale.
Answer AnswerGrid(const HandlerState& state, const RequestContext& context);

// GET and POST /{dataset}/sight (server/query/sight_query.h)
Answer AnswerSight(const HandlerState& state, const RequestContext& context);

// GET /{dataset}/mesh
Answer AnswerArea(const HandlerState& state, const RequestContext& context);

// GET /{dataset}/layer.json. `?error=E` and `?fraction=F` go into the tile template.
DocumentAnswer DescribeLayer(const HandlerState& state, const RequestContext& context);
// The document for requests without parameters.
Document PlainLayer(const DatasetView& dataset);
// The query of the tile template for a requested error: "error=5&atleast=1", "fraction=0.25" or empty. Numbers are
// printed in their shortest form and without '+', which CesiumJS would convert to a space.
std::string TileQuery(const geo::RequestedError& requested);

// Adds the request's token to the query of a template if the token came in the query: such clients use templates
// unchanged.
std::string WithToken(std::string query, const RequestContext& context);

// Identifies that token in cache keys, which must not contain the token itself: each token has one Grant as long as the
// server runs. Null: WithToken adds none.
const Grant* GrantInQuery(const RequestContext& context);

// GET /{dataset}/edits.geojson: outlines of the dataset's edits. 404: it has none.
DocumentAnswer DescribeEdits(const HandlerState& state, const RequestContext& context);
// A FeatureCollection of MultiLineStrings, RFC 7946, in the order of the edits. Properties: `op`, `file` without its
// folder, `feature`, its index in the file, `area`: lines are closed rings. Returns an empty string if a stop was
// requested.
std::string EditsGeoJson(const std::vector<dem::EditOutline>& edits, const std::stop_token& stop = {});

// GET /{dataset}/tileset.json. `?error=E` and `?fraction=F` go into the templates.
DocumentAnswer DescribeTileset(const HandlerState& state, const RequestContext& context);
// Makes the document for requests without parameters, and the roots of the dataset's trees.
void AddTileset(const DatasetView& dataset, HandlerState::DatasetDocuments& made);
// The .subtree files of the tileset. Any available tile may be the root, so that an older tileset.json that a client
// has cached stays valid. The heights in a subtree depend on the requested error, because skirts do. 404: no subtree
// begins at this tile.
DocumentAnswer DescribeSubtree(const HandlerState& state, const RequestContext& context);

// GET /{dataset}/tiles.json. `?encoding` and `?size` go into the tile template.
Answer AnswerTileJson(const HandlerState& state, const RequestContext& context);

// GET /{dataset}/hillshade/tiles.json and those of slopes, contours and imagery. The parameters of the tiles go into
// the tile template; `?format` names the suffix of pictures. Precondition: the route has a format.
Answer AnswerMapTileJson(const HandlerState& state, const RequestContext& context);

// GET /datasets: the datasets that the client may see.
DocumentAnswer DescribeDatasets(const HandlerState& state, const RequestContext& context);
// GET / and /viewer/{file}. Without a viewer, `/` is a plain list of datasets.
DocumentAnswer DescribeViewerFile(const HandlerState& state, const RequestContext& context);
// Whether the client may see a dataset. Empty: it may see all.
using IsSeen = std::function<bool(const DatasetView&)>;

// {"datasets":[{"name","version","attribution","bounds":[w,s,e,n],"sources","finest_bounds":[w,s,e,n],"min_level","max_level",
//   "heights":{"min","max"},"urls":{"layer","tileset","tiles","tiles_json","heights","grid","sight",
//   "mesh","edits","hillshade","slope","contours","imagery","imagery_geodetic"},"imagery":{"attribution","bounds","max_level",
//   "geodetic_max_level"}}],"preparing":[{"name","percent","failed":true}],"more_with_token":true}
// Degrees, west > east across the antimeridian; metres; URLs are absolute paths on this server. `more_with_token` is
// present for every client that may not see all datasets, whether or not there are more, so that it reveals nothing.
// `preparing` lists `pending`, which are those that the client may see; it is absent if there are none.
// Returns an empty string if a stop was requested; so does IndexHtml.
std::string DatasetsJson(std::span<const DatasetView> datasets, const IsSeen& is_seen = {},
                         const std::stop_token& stop = {}, std::span<const PendingDataset> pending = {});

// The page at `/` if no viewer is installed.
std::string IndexHtml(std::span<const DatasetView> datasets, const IsSeen& is_seen = {},
                      const std::stop_token& stop = {}, std::span<const PendingDataset> pending = {});

// 503 for a URL of a pending dataset: what is being done, and how far.
Response PendingResponse(const PendingDataset& dataset, std::string_view request_id);

// A reply about the state of the server. `content_type`: a literal.
Response StateResponse(int status, std::string_view content_type, Body text);
// Prometheus's text format.
inline constexpr std::string_view kMetricsType = "text/plain; version=0.0.4; charset=utf-8";

// GET /livez, /readyz and /metrics: for operators of the server.
Answer AnswerLive(const HandlerState& state, const RequestContext& context);
Answer AnswerReady(const HandlerState& state, const RequestContext& context);
Answer AnswerMetrics(const HandlerState& state, const RequestContext& context);

// GET /version: which program answers, and what it serves, so that operators can compare the nodes of a fleet.
Answer AnswerVersion(const HandlerState& state, const RequestContext& context);
// {"product","version","build","encoder","libraries":{"GDAL":"3.6.2",...},"datasets":[{"name","version"}]}
std::string VersionJson(const Catalog& catalog);

}  // namespace terrace::server
