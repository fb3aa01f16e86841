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
  // `tiles`, whose workers read the heights, must outlive this.
  HeightsHandler(CatalogPtr catalog, TileService& tiles, HandlerOptions options);

  Answer Handle(const Call& call) const;

 private:
  // One job's answer.
  struct Made {
    std::string bytes;  // in its coding
    tiler::StageTimes times;
  };

  asio::awaitable<Response> Read(const Call& call, std::uint32_t dataset) const;
  // On a worker, unless it is certain to be quick.
  asio::awaitable<Result<HeightsQuery>> ParseAside(const Call& call, TileService::Clock::time_point deadline) const;
  // The errors of the points' tiles, one after the other, from the cache or by building them.
  asio::awaitable<Result<CertifiedPoints>> Certify(std::uint32_t dataset, const HeightsQuery& query,
                                                   TileService::Clock::time_point deadline, std::uint64_t client) const;
  asio::awaitable<Result<ServedTile>> TileOf(tiler::TileRequest tile, TileService::Clock::time_point deadline,
                                             std::uint64_t client) const;

  const CatalogPtr catalog_;
  TileService& tiles_;
  const HandlerOptions options_;
};

// {"results":[{"elevation","location":{"lat","lng"},"dataset"}],"status":"OK"}, as Open Topo Data replies; points of a
// path have their "distance" as well. Metres; null where there is no height, and "filled": true where a void was filled
// in. Orthometric ones say so: "datum".
// `certified`, unless it is null: "certified_error" and "tile" of each point that has a height. Empty: a stop was
// requested.
std::string HeightsJson(const HeightsQuery& query, const PointHeights& known, std::string_view dataset,
                        const CertifiedPoints* certified = nullptr, const std::stop_token& stop = {});

}  // namespace terrace::server
