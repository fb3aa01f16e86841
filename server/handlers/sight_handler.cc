#include <fmt/format.h>

#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "engine/core/elapsed_time.h"
#include "server/api/caching.h"
#include "server/handlers/handlers.h"
#include "server/handlers/point_reply.h"
#include "server/query/sight_query.h"
#include "tiler/tile/strong_etag.h"

namespace terrace::server {
namespace {

// Above this number of rays, or above this length of all of them, looking along them is long work, which never occupies
// all workers.
constexpr std::size_t kFewRays = 16;
constexpr double kShortRays_m = 100'000;
// A query of at most this many bytes has a few rays and is parsed in microseconds.
constexpr std::size_t kQuickQuery = 512;
// Rays written between two checks of the stop token.
constexpr std::size_t kRayStopPeriod = 1024;

bool IsLong(const SightQuery& query) {
  if (query.drawn || query.rays.size() > kFewRays) return true;
  double length_m = 0;
  for (const dem::SightRay& ray : query.rays) length_m += dem::LengthOf(ray);
  return length_m > kShortRays_m;
}

// Replaces heights above the surface by heights above the ellipsoid.
Result<void> RaiseFromGround(const tiler::TilePipeline& pipeline, std::uint32_t dataset, SightQuery& query,
                             const std::stop_token& stop) {
  std::vector<dem::GeoPosition> ends;
  for (const dem::SightRay& ray : query.rays) {
    ends.push_back({ray.from.longitude, ray.from.latitude});
    ends.push_back({ray.to.longitude, ray.to.latitude});
  }
  const Result<tiler::PointHeights> ground =
      query.drawn ? pipeline.ReadDrawnPoints(dataset, *query.drawn, ends, /*normals=*/false, stop)
                  : pipeline.ReadPoints(dataset, ends, dem::HeightDatum::kEllipsoid, stop);
  if (!ground) return tl::unexpected(ground.error());
  for (std::size_t i = 0; i < ends.size(); ++i) {
    const float height_m = ground->heights[i];
    if (std::isnan(height_m)) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "heights=ground: ray {}: the dataset has no height where it {}; use heights=ellipsoid",
                       i / 2 + 1, i % 2 == 0 ? "begins" : "ends");
    }
    (i % 2 == 0 ? query.rays[i / 2].from : query.rays[i / 2].to).height_m += height_m;
  }
  return {};
}

std::string SightBytes(const SightQuery& query, const std::vector<dem::SightAnswer>& answers) {
  std::string bytes;
  bytes.reserve(answers.size() * 2 * sizeof(float));
  for (std::size_t i = 0; i < answers.size(); ++i) {
    const dem::SightAnswer& answer = answers[i];
    const double blocked_m = answer.blocked_at ? *answer.blocked_at * dem::LengthOf(query.rays[i])
                                               : std::numeric_limits<double>::quiet_NaN();
    for (const double number : {answer.clearance_m, blocked_m}) {
      const auto value = static_cast<float>(number);
      bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
    }
  }
  return bytes;
}

// {"lat","lng","height","distance"} of a place on a ray.
void AppendPlace(std::string& json, const char* name, const dem::SightRay& ray, double share, double length_m,
                 const dem::SightOptions& options) {
  const dem::SightPoint place = dem::PointAt(ray, share, options);
  fmt::format_to(std::back_inserter(json),
                 ",\"{}\":{{\"lat\":{:.9f},\"lng\":{:.9f},\"height\":{:.3f},\"distance\":{:.3f}}}", name,
                 place.latitude, place.longitude, place.height_m, share * length_m);
}

// A remark for the client on an answer; empty: none.
const char* RemarkOn(const dem::SightAnswer& answer, double length_m) {
  if (std::isnan(answer.clearance_m)) return "the dataset has no height along the ray";
  if (answer.blocked_at && *answer.blocked_at <= 0) return "the ray begins below the surface";
  if (length_m == 0) return "the ray has no length";
  if (answer.has_gaps) return "the dataset has no height under parts of the ray";
  return "";
}

std::string SightJson(const SightQuery& query, const std::vector<dem::SightAnswer>& answers,
                      const std::stop_token& stop) {
  std::string json = "{\"results\":[";
  const auto out = std::back_inserter(json);
  for (std::size_t i = 0; i < answers.size(); ++i) {
    if (i % kRayStopPeriod == 0 && stop.stop_requested()) return {};
    const dem::SightAnswer& answer = answers[i];
    const double length_m = dem::LengthOf(query.rays[i]);
    if (i > 0) json += ',';
    const bool is_known = !std::isnan(answer.clearance_m);
    fmt::format_to(out, "{{\"visible\":{},\"length\":{:.3f},\"clearance\":", answer.is_visible, length_m);
    if (is_known) {
      fmt::format_to(out, "{:.3f}", answer.clearance_m);
      AppendPlace(json, "lowest", query.rays[i], answer.clearance_at, length_m, query.options);
    } else {
      json += "null";
    }
    if (answer.blocked_at) AppendPlace(json, "blocked", query.rays[i], *answer.blocked_at, length_m, query.options);
    if (answer.has_gaps) json += ",\"gaps\":true";
    if (const char* const remark = RemarkOn(answer, length_m); *remark != '\0') {
      fmt::format_to(out, ",\"remark\":\"{}\"", remark);
    }
    json += '}';
  }
  return json + "],\"status\":\"OK\"}";
}

asio::awaitable<Response> LookAlong(const HandlerState& state, const RequestContext& context, std::uint32_t dataset) {
  const Request& request = *context.request;
  const DatasetView& view = state.catalog->datasets[dataset];
  const auto deadline = context.request->deadline;
  const bool is_quick = context.route.query.size() <= kQuickQuery;
  Result<SightQuery> parsed = co_await ParsePoints(state, context, ParseSight, is_quick, deadline);
  if (!parsed) co_return co_await FailedPointReply(parsed.error(), view, request.id);
  // Archives have only the heights of their meshes.
  if (view.only_archive && !parsed->drawn && !parsed->names_source) parsed->drawn.emplace();
  PointReply reply = StartPointReply(request, parsed->is_binary);
  const tiler::Coding coding = reply.coding;
  Response& response = reply.response;
  if (request.method != Method::kPost) {
    response.cache_control = CacheControlOf(context.route.query, view, state.cache_control);
    response.etag = tiler::RequestETag("sight", view.name, view.generation, context.route.query, coding);
    if (NamesEtag(request.fields->if_none_match, response.etag)) co_return Conditional(std::move(response), request);
  }
  const bool is_long = IsLong(*parsed);
  auto query = std::make_shared<SightQuery>(*std::move(parsed));
  Work<MadeReply> work = [catalog = state.catalog, dataset, coding, query,
                          requested_at = JobClock::now()](const std::stop_token& stop) -> Result<MadeReply> {
    MadeReply made;
    made.times.queue = MicrosecondsSince(requested_at);
    const auto begun = JobClock::now();
    const tiler::TilePipeline& pipeline = *catalog->pipeline;
    if (query->from_ground) {
      const Result<void> raised = RaiseFromGround(pipeline, dataset, *query, stop);
      if (!raised) return tl::unexpected(raised.error());
    }
    const auto answers = pipeline.LookAlong(dataset, query->drawn, query->rays, query->options, stop);
    if (!answers) return tl::unexpected(answers.error());
    made.times.read = MicrosecondsSince(begun);
    made.bytes = query->is_binary ? SightBytes(*query, *answers) : SightJson(*query, *answers, stop);
    made.bytes = tiler::Compress(std::move(made.bytes), coding, stop);
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the rays any more");
    return made;
  };
  const JobTerms terms = (is_long ? LongTerms : ShortTerms)(deadline, request.client);
  Result<MadeReply> made = co_await state.workers.Run(std::move(work), terms);
  co_return Conditional(co_await FinishPointReply(std::move(response), std::move(made), view, request.id), request);
}

}  // namespace

Answer AnswerSight(const HandlerState& state, const RequestContext& context) {
  return AnswerPoints(state, context, LookAlong);
}

}  // namespace terrace::server
