#include "server/http/gate.h"

#include <fmt/format.h>

#include "server/http/http_error.h"

namespace terrace::server {
namespace {

// Probes come from machines that must never be told to wait.
bool IsProbe(RouteKind kind) { return kind == RouteKind::kLive || kind == RouteKind::kReady; }

// Pages and probes show nothing of a dataset.
bool ShowsDatasets(RouteKind kind) { return kind != RouteKind::kViewer && !IsProbe(kind); }

// The list of datasets is open: it names what its reader may see.
bool NeedsGrant(const Route& route, const Grant& grant) {
  if (!ShowsDatasets(route.kind) || route.kind == RouteKind::kDatasets) return false;
  // Metrics tell of all datasets.
  return route.kind == RouteKind::kMetrics ? !grant.sees_all : !grant.Sees(route.dataset);
}

bool HasName(const Request& request) { return request.grant && !request.grant->name.empty(); }

Response Unauthorized(bool has_token, std::string_view request_id) {
  Response response = ProblemResponse(
      401,
      has_token ? "this token is not known here" : "a token is needed: Authorization: Bearer, or ?token=", request_id);
  response.headers.emplace_back(
      "WWW-Authenticate", has_token ? R"(Bearer realm="terrace", error="invalid_token")" : R"(Bearer realm="terrace")");
  return response;
}

}  // namespace

Caller Gate::Identify(Request& request, const Caller& peer) const {
  const AccessPolicy& access = options_.access;
  if (access.has_tokens()) {
    request.grant = request.token.empty() ? access.anonymous() : access.Find(request.token);
    request.has_bad_token = !request.grant;
    if (!request.grant) request.grant = access.anonymous();
  }
  const asio::ip::address client = ResolveClient(request, peer.address, options_.proxies);
  return client == peer.address ? peer : Caller(client);
}

std::string Gate::Who(const Request& request, const Caller& caller) {
  return HasName(request) ? "/" + request.grant->name : caller.block;  // no address begins with a slash
}

std::uint64_t Gate::NumberOf(const Request& request, const Caller& caller) {
  return HasName(request) ? std::hash<std::string>{}(Who(request, caller)) | 1 : caller.number;
}

RateLimiter::Turn Gate::TakeTurn(const Request& request, const Result<Route>& route, const Caller& caller,
                                 std::chrono::milliseconds longest_wait) {
  if (route && IsProbe(route->kind)) return {};
  const bool has_name = HasName(request);
  RateLimiter::Rate rate = options_.rate;
  if (has_name && request.grant->requests_per_second > 0) {
    rate.per_second = request.grant->requests_per_second;
    rate.burst = 2 * rate.per_second;
  }
  if (rate.per_second <= 0) return {};
  return limiter_.Take(Who(request, caller), rate, RateLimiter::Clock::now(), longest_wait);
}

Response Gate::TooManyRequests(const RateLimiter::Turn& turn, const Request& request, const Result<Route>& route) {
  Response response = ProblemResponse(429, "too many requests", request.id);
  const std::int64_t seconds = (turn.wait.count() + 999) / 1000;
  response.headers.emplace_back("Retry-After", fmt::to_string(std::max<std::int64_t>(seconds, 1)));
  if (route) response.route = ToString(route->kind);
  return response;
}

std::optional<Response> Gate::Refuse(const Request& request, const Route& route) const {
  if (!options_.access.has_tokens() || !ShowsDatasets(route.kind)) return std::nullopt;
  if (request.has_bad_token) return Unauthorized(true, request.id);
  if (!NeedsGrant(route, *request.grant)) return std::nullopt;
  // Whether there is such a dataset is none of the asker's business.
  if (request.grant->name.empty()) return Unauthorized(false, request.id);
  return ProblemResponse(403, "this token is for other datasets", request.id);
}

void Gate::Mark(const Request& request, const Route& route, Response& response) const {
  if (!options_.access.has_tokens() || !ShowsDatasets(route.kind)) return;
  const bool has_templates = route.kind == RouteKind::kLayer || route.kind == RouteKind::kTileset ||
                             route.kind == RouteKind::kTileJson;  // which have the token of the query
  response.for_grant = route.kind == RouteKind::kDatasets || (has_templates && request.token_in_query) ||
                       NeedsGrant(route, *options_.access.anonymous());
}

}  // namespace terrace::server
