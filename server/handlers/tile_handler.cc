#include "server/handlers/tile_handler.h"

#include <fmt/format.h>

#include <iterator>
#include <memory>
#include <optional>
#include <utility>

#include "server/api/backend_failure.h"
#include "server/api/caching.h"
#include "server/api/negotiate.h"
#include "server/http/http_error.h"

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

TileHandler::TileHandler(CatalogPtr catalog, TileService& tiles, HandlerOptions options)
    : catalog_(std::move(catalog)), tiles_(tiles), options_(std::move(options)) {}

Answer TileHandler::Handle(const Call& call) const {
  const Result<tiler::TileRequest> tile = Negotiate(call, catalog_->datasets);
  if (!tile) return ClientErrorResponse(tile.error(), call.request->id);
  if (const std::optional<ServedTile> found = tiles_.Find(*catalog_, *tile)) return Reply(*tile, *found, call);
  return Build(call, *tile);
}

asio::awaitable<Response> TileHandler::Build(const Call& call, tiler::TileRequest tile) const {
  const auto deadline = TileService::Clock::now() + options_.deadline;
  const Result<ServedTile> served = co_await tiles_.Build(catalog_, tile, deadline, call.request->client);
  if (served) co_return Reply(tile, *served, call);
  co_return co_await BackendFailure(served.error(), call.request->id, options_.refusal_delay);
}

Response TileHandler::Reply(const tiler::TileRequest& tile, const ServedTile& served, const Call& call) const {
  Response response;
  response.lines = std::shared_ptr<const std::string>(served.tile, &served.tile->head.text);
  response.lines_of_body = served.tile->head.of_body;
  response.cache_control = CacheControlOf(call.route.query, catalog_->datasets[tile.dataset], options_.cache_control);
  response.vary = call.route.format->vary(tile);
  if (served.cache == CacheStatus::kHit) {
    response.more_lines = "Server-Timing: cache;desc=hit\r\n";
  } else {
    response.headers.emplace_back("Server-Timing", FormatServerTiming(served.cache, served.tile->times));
  }
  response.labels.cache = Name(served.cache);
  if (MatchesEtag(call.request->fields->if_none_match, served.tile->etag)) {
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
