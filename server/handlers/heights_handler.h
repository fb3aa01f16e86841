// GET and POST /{dataset}/heights
#pragma once

#include <cstdint>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>

#include "server/api/call.h"
#include "server/api/handler_options.h"
#include "server/asio.h"
#include "server/handlers/certified_points.h"
#include "server/http/application.h"
#include "server/http/response.h"
#include "server/query/heights_query.h"
#include "server/tiles/catalog.h"
#include "server/tiles/tile_service.h"

namespace terrace::server {

class HeightsHandler {
 public:
  // `tiles`: its workers read the heights; must outlive this object.
  HeightsHandler(CatalogPtr catalog, TileService& tiles, HandlerOptions options);

  Answer Handle(const Call& call) const;

 private:
  // The result of a job.
  struct Made {
    std::string bytes;  // in the reply's coding
    tiler::StageTimes times;
  };

  asio::awaitable<Response> Read(const Call& call, std::uint32_t dataset) const;
  // Parses on a worker, unless the input is small.
  asio::awaitable<Result<HeightsQuery>> ParseAside(const Call& call, TileService::Clock::time_point deadline) const;
  // Gets the certified errors of the points' tiles one after the other, from the cache or by building the tiles.
  asio::awaitable<Result<CertifiedPoints>> Certify(std::uint32_t dataset, const HeightsQuery& query,
                                                   TileService::Clock::time_point deadline, std::uint64_t client) const;
  asio::awaitable<Result<ServedTile>> TileOf(tiler::TileRequest tile, TileService::Clock::time_point deadline,
                                             std::uint64_t client) const;

  const CatalogPtr catalog_;
  TileService& tiles_;
  const HandlerOptions options_;
};

// {"results":[{"elevation","location":{"lat","lng"},"dataset"}],"status":"OK"}, the format of Open Topo Data. Points of
// a path also have "distance". Metres; null if there is no height; "filled": true if a void was filled. Orthometric
// heights have "datum". `certified`: adds "certified_error" and "tile" to each point with a height; null: nothing is
// added. Returns an empty string if a stop was requested.
std::string HeightsJson(const HeightsQuery& query, const PointHeights& known, std::string_view dataset,
                        const CertifiedPoints* certified = nullptr, const std::stop_token& stop = {});

}  // namespace terrace::server
