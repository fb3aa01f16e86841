#include <fmt/format.h>

#include <iterator>
#include <memory>
#include <optional>
#include <utility>

#include "server/api/caching.h"
#include "server/api/tile_formats.h"
#include "server/handlers/handlers.h"
#include "server/http/http_error.h"

namespace terrace::server {
namespace {

std::string_view Name(const ServedTile& served) {
  switch (served.cache) {
    case CacheStatus::kHit:
      return "hit";
    case CacheStatus::kStore:
      return served.tile->found_in;
    case CacheStatus::kMiss:
      return "miss";
    case CacheStatus::kJoined:
      break;
  }
  return "join";
}

Response Reply(const HandlerState& state, const tiler::TileRequest& tile, const ServedTile& served,
               const RequestContext& context) {
  Response response;
  response.lines = std::shared_ptr<const std::string>(served.tile, &served.tile->header_lines.text);
  response.bytes_about_body = served.tile->header_lines.bytes_about_body;
  response.cache_control =
      CacheControlOf(context.route.query, state.catalog->datasets[tile.dataset], state.cache_control);
  response.vary = context.route.format->vary(tile);
  if (served.cache == CacheStatus::kHit) {
    response.literal_lines = "Server-Timing: cache;desc=hit\r\n";
  } else {
    response.headers.emplace_back("Server-Timing", FormatServerTiming(Name(served), served.tile->times));
  }
  response.labels.cache = Name(served);
  if (MatchesEtag(context.request->fields->if_none_match, served.tile->etag)) {
    response.status = 304;
  } else {
    response.body = Body(served.tile, &served.tile->bytes);
  }
  return response;
}

asio::awaitable<Response> BuildTile(const HandlerState& state, const RequestContext& context, tiler::TileRequest tile) {
  const Result<ServedTile> served =
      co_await state.tiles.Build(state.catalog, tile, context.request->deadline, context.request->client);
  if (served) co_return Reply(state, tile, *served, context);
  const bool is_absent =
      served.error().code == ErrorCode::kNotFound && state.catalog->datasets[tile.dataset].only_archive;
  if (is_absent) co_return ClientErrorResponse(served.error(), context.request->id);
  co_return co_await DelayedBackendError(served.error(), context.request->id);
}

}  // namespace

Answer AnswerTile(const HandlerState& state, const RequestContext& context) {
  const Result<tiler::TileRequest> tile = NegotiateTile(context, state.catalog->datasets);
  if (!tile) return ClientErrorResponse(tile.error(), context.request->id);
  if (const std::optional<ServedTile> found = state.tiles.Find(*state.catalog, *tile))
    return Reply(state, *tile, *found, context);
  return BuildTile(state, context, *tile);
}

std::string FormatServerTiming(std::string_view cache, const tiler::StageTimes& times) {
  std::string text = fmt::format("cache;desc={}", cache);
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
