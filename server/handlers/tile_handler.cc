#include "server/handlers/tile_handler.h"

#include <fmt/format.h>

#include <iterator>
#include <memory>
#include <utility>

#include "server/handlers/backend_failure.h"
#include "server/http/http_error.h"
#include "server/http/negotiate.h"

namespace terrace::server {
namespace {

std::string_view Name(CacheStatus cache) {
  switch (cache) {
    case CacheStatus::kHit:
      return "hit";
    case CacheStatus::kDisk:
      return "disk";
    case CacheStatus::kMiss:
      return "miss";
    case CacheStatus::kJoined:
      break;
  }
  return "join";
}

}  // namespace

TileHandler::TileHandler(CatalogPtr catalog, TileService& tiles, TileHandlerOptions options)
    : catalog_(std::move(catalog)), tiles_(tiles), options_(std::move(options)) {}

std::optional<Response> TileHandler::HandleNow(const Route& route, const Request& request) const {
  const Result<tiler::TileRequest> tile = Negotiate(route, request, catalog_->datasets);
  if (!tile) return ClientErrorResponse(tile.error(), request.id);
  const std::optional<ServedTile> found = tiles_.Find(*catalog_, *tile);
  if (!found) return std::nullopt;
  return Reply(*found, *tile, request);
}

asio::awaitable<Response> TileHandler::Handle(Route route, Request request) const {
  const Result<tiler::TileRequest> tile = Negotiate(route, request, catalog_->datasets);
  if (!tile) co_return ClientErrorResponse(tile.error(), request.id);
  const auto deadline = TileService::Clock::now() + options_.deadline;
  const Result<ServedTile> served = co_await tiles_.Get(catalog_, *tile, deadline, request.client);
  if (served) co_return Reply(*served, *tile, request);
  co_return co_await BackendFailure(served.error(), std::string(request.id), options_.refusal_delay);
}

Response TileHandler::Reply(const ServedTile& served, const tiler::TileRequest& tile, const Request& request) const {
  Response response;
  response.lines = std::shared_ptr<const tiler::HeadLines>(served.tile, &served.tile->head);
  response.cache_control = options_.cache_control;
  response.vary = tile.format != tiler::TileFormat::kHeightPng;  // which has one form
  if (served.cache == CacheStatus::kHit) {
    response.more_lines = "Server-Timing: cache;desc=hit\r\n";
  } else {
    response.headers.emplace_back("Server-Timing", FormatServerTiming(served.cache, served.tile->times));
  }
  response.cache = Name(served.cache);
  if (MatchesEtag(request.fields->if_none_match, served.tile->etag)) {
    response.status = 304;
  } else {
    response.body = Body(served.tile, &served.tile->bytes);
  }
  return response;
}

std::string FormatServerTiming(CacheStatus cache, const tiler::StageTimes& times) {
  std::string text = fmt::format("cache;desc={}", Name(cache));
  if (cache == CacheStatus::kHit) return text;
  const std::pair<const char*, std::chrono::microseconds> steps[] = {{"queue", times.queue},
                                                                     {"read", times.read},
                                                                     {"refine", times.refine},
                                                                     {"encode", times.encode},
                                                                     {"compress", times.compress}};
  for (const auto& [name, time] : steps) {
    fmt::format_to(std::back_inserter(text), ", {};dur={:.3f}", name, static_cast<double>(time.count()) / 1000);
  }
  return text;
}

}  // namespace terrace::server
