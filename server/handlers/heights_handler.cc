#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <stop_token>
#include <utility>
#include <vector>

#include "engine/core/elapsed_time.h"
#include "engine/geo/ellipsoid.h"
#include "proto/format_error_up.h"
#include "server/api/caching.h"
#include "server/handlers/handlers.h"
#include "server/handlers/point_reply.h"
#include "server/http/http_error.h"
#include "tiler/surface/drawn_tiles.h"
#include "tiler/tile/strong_etag.h"

namespace terrace::server {
namespace {

// Thousands of points, and geodesics between them, take a tenth of a second, which would block the io thread. A query
// of at most this many bytes has a few points and is parsed in microseconds.
constexpr std::size_t kQuickQuery = 256;

// Above this number of points, reading is long work, which never occupies all workers: each point may lie in another
// block.
constexpr std::size_t kShortList = 1000;

// Points written between two checks of the stop token.
constexpr std::size_t kStopPeriod = 1024;

asio::awaitable<Result<ServedTile>> TileOf(const HandlerState& state, tiler::TileRequest tile,
                                           JobClock::time_point deadline, std::uint64_t client) {
  if (std::optional<ServedTile> found = state.tiles.Find(*state.catalog, tile)) co_return *std::move(found);
  co_return co_await state.tiles.Build(state.catalog, tile, deadline, client);
}

// Gets the certified errors of the points' tiles one after the other, from the cache or by building the tiles.
asio::awaitable<Result<CertifiedPoints>> Certify(const HandlerState& state, std::uint32_t dataset,
                                                 const HeightsQuery& query, JobClock::time_point deadline,
                                                 std::uint64_t client) {
  // On a worker, because finding the tiles of thousands of points in a large mosaic takes time.
  Work<CertifiedPoints> find = [catalog = state.catalog, dataset, wanted = query.points,
                                level = *query.certify_level](const std::stop_token& stop) {
    return CertifyingTilesOf(catalog->datasets[dataset], wanted, level, stop);
  };
  Result<CertifiedPoints> points = co_await state.workers.Run(std::move(find), ShortTerms(deadline, client));
  if (!points) co_return points;
  for (std::size_t i = 0; i < points->tiles.size(); ++i) {
    tiler::TileRequest tile;
    tile.dataset = dataset;
    tile.key = points->tiles[i];
    tile.coding = tiler::Coding::kGzip;  // the format that is most probably cached
    const Result<ServedTile> served = co_await TileOf(state, tile, deadline, client);
    if (!served) co_return tl::unexpected(served.error());
    points->errors_m[i] = served->tile->certified_error_m;
  }
  co_return points;
}

// Heights of the surface that the query names, with normals if it wants them.
Result<tiler::PointHeights> ReadSurface(const tiler::TilePipeline& pipeline, std::uint32_t dataset,
                                        const HeightsQuery& query, const std::stop_token& stop) {
  if (query.drawn) return pipeline.ReadDrawnPoints(dataset, *query.drawn, query.points, query.wants_normals, stop);
  Result<tiler::PointHeights> heights = pipeline.ReadPoints(dataset, query.points, query.datum, stop);
  if (!heights || !query.wants_normals) return heights;
  Result<std::vector<std::array<float, 3>>> normals = pipeline.ReadNormals(dataset, query.points, stop);
  if (!normals) return tl::unexpected(std::move(normals).error());
  heights->normals = *std::move(normals);
  return heights;
}

asio::awaitable<Response> ReadHeights(const HandlerState& state, const RequestContext& context, std::uint32_t dataset) {
  const Request& request = *context.request;
  const DatasetView& view = state.catalog->datasets[dataset];
  const auto deadline = context.request->deadline;
  // A path of two corners may have thousands of points.
  const bool is_quick =
      context.route.query.size() <= kQuickQuery && context.route.query.find("path") == std::string::npos;
  Result<HeightsQuery> parsed = co_await ParsePoints(state, context, ParseHeights, is_quick, deadline);
  if (!parsed) co_return co_await FailedPointReply(parsed.error(), view, request.id);
  if (const Result<void> datum = CheckDatum(parsed->datum, view); !datum) {
    co_return ClientErrorResponse(datum.error(), request.id);
  }

  PointReply reply = StartPointReply(request, parsed->is_binary);
  const tiler::Coding coding = reply.coding;
  Response& response = reply.response;
  if (request.method != Method::kPost) {
    // The generation covers neither the geoid grid that orthometric heights depend on, nor the program that certified
    // errors depend on.
    const bool is_versioned = !parsed->certify_level && parsed->datum == dem::HeightDatum::kEllipsoid;
    response.cache_control = CacheControlOf(context.route.query, view, state.cache_control, is_versioned);
    if (is_versioned) {
      response.etag = tiler::RequestETag("heights", view.name, view.generation, context.route.query, coding);
    }
    if (NamesEtag(request.fields->if_none_match, response.etag)) co_return Conditional(std::move(response), request);
  }

  std::shared_ptr<const CertifiedPoints> certified;
  if (parsed->certify_level) {
    Result<CertifiedPoints> known = co_await Certify(state, dataset, *parsed, deadline, request.client);
    if (!known) co_return co_await FailedPointReply(known.error(), view, request.id);
    certified = std::make_shared<const CertifiedPoints>(*std::move(known));
  }
  const bool is_long = parsed->points.size() > kShortList || (parsed->drawn && parsed->points.size() > 1);
  const JobTerms terms = (is_long ? LongTerms : ShortTerms)(deadline, request.client);
  auto query = std::make_shared<const HeightsQuery>(*std::move(parsed));
  Work<MadeReply> work = [catalog = state.catalog, dataset, coding, query, certified,
                          requested_at = JobClock::now()](const std::stop_token& stop) -> Result<MadeReply> {
    MadeReply made;
    made.times.queue = MicrosecondsSince(requested_at);
    const auto begun = JobClock::now();
    const Result<tiler::PointHeights> heights = ReadSurface(*catalog->pipeline, dataset, *query, stop);
    if (!heights) return tl::unexpected(heights.error());
    made.times.read = MicrosecondsSince(begun);
    made.bytes = query->is_binary
                     ? HeightsBytes(*heights)
                     : HeightsJson(*query, *heights, catalog->datasets[dataset].name, certified.get(), stop);
    made.bytes = tiler::Compress(std::move(made.bytes), coding, stop);
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the heights any more");
    return made;
  };
  Result<MadeReply> made = co_await state.workers.Run(std::move(work), terms);
  co_return Conditional(co_await FinishPointReply(std::move(response), std::move(made), view, request.id), request);
}

}  // namespace

Answer AnswerHeights(const HandlerState& state, const RequestContext& context) {
  return AnswerPoints(state, context, ReadHeights);
}

std::string HeightsBytes(const tiler::PointHeights& known) {
  const std::size_t columns = known.normals.empty() ? 1 : 4;
  std::string bytes(known.heights.size() * columns * sizeof(float), '\0');
  char* to = bytes.data();
  for (std::size_t i = 0; i < known.heights.size(); ++i) {
    std::memcpy(to, &known.heights[i], sizeof(float));
    if (columns > 1) std::memcpy(to + sizeof(float), known.normals[i].data(), 3 * sizeof(float));
    to += columns * sizeof(float);
  }
  return bytes;
}

std::string HeightsJson(const HeightsQuery& query, const tiler::PointHeights& known, std::string_view dataset,
                        const CertifiedPoints* certified, const std::stop_token& stop) {
  const std::vector<float>& heights = known.heights;
  const std::string name = nlohmann::json(dataset).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  std::string json = "{\"results\":[";
  const auto out = std::back_inserter(json);
  for (std::size_t i = 0; i < heights.size(); ++i) {
    if (i % kStopPeriod == 0 && stop.stop_requested()) return {};
    if (i > 0) json += ',';
    json += "{\"elevation\":";
    if (std::isnan(heights[i])) {
      json += "null";
    } else {
      fmt::format_to(out, "{}", heights[i]);
    }
    fmt::format_to(out, ",\"location\":{{\"lat\":{},\"lng\":{}}}", query.points[i].latitude, query.points[i].longitude);
    if (!query.distances_m.empty()) fmt::format_to(out, ",\"distance\":{}", query.distances_m[i]);
    const bool is_filled = !known.filled.empty() && known.filled[i] != 0 && !std::isnan(heights[i]);
    if (is_filled) json += ",\"filled\":true";
    if (!known.normals.empty() && !std::isnan(known.normals[i][2])) {
      const auto& [east, north, up] = known.normals[i];
      fmt::format_to(out, ",\"normal\":[{},{},{}],\"slope\":{:.3f}", east, north, up,
                     geo::ToDegrees(std::atan2(std::hypot(east, north), up)));
    }
    if (!known.tiles.empty()) {
      fmt::format_to(out, ",\"tile\":\"{}\"", geo::ToString(known.tiles[known.tile_of_point[i]]));
    }
    if (certified != nullptr && !std::isnan(heights[i])) {
      const std::size_t tile = certified->tile_of_point[i];
      const std::optional<double>& error_m = certified->errors_m[tile];
      // Filled voids have no certified error.
      const bool is_bounded = error_m && std::isfinite(*error_m) && !is_filled;
      fmt::format_to(out, ",\"certified_error\":{},\"tile\":\"{}\"",
                     is_bounded ? proto::FormatErrorUp(*error_m) : "null", geo::ToString(certified->tiles[tile]));
    }
    fmt::format_to(out, ",\"dataset\":{}}}", name);
  }
  if (query.datum == dem::HeightDatum::kOrthometric) return json + "],\"datum\":\"orthometric\",\"status\":\"OK\"}";
  return json + "],\"status\":\"OK\"}";
}

Result<CertifiedPoints> CertifyingTilesOf(const DatasetView& dataset, std::span<const dem::GeoPosition> points,
                                          int deepest, const std::stop_token& stop) {
  const tiler::HasTile has_tile = [&](const geo::TileKey& key) { return IsAvailable(dataset, key); };
  tiler::TileNumbers numbers(has_tile, std::min(deepest, dataset.max_level()), "certify: the points");
  CertifiedPoints certified;
  for (const dem::GeoPosition& point : points) {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the tiles any more");
    const Result<std::uint32_t> number = numbers.NumberAt(point);
    if (!number) return tl::unexpected(number.error());
    certified.tile_of_point.push_back(*number);
  }
  certified.tiles = numbers.keys();
  certified.errors_m.resize(certified.tiles.size());
  return certified;
}

}  // namespace terrace::server
