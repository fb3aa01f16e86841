#include "server/api/gate.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "server/http/http_error.h"
#include "server/telemetry/shown_target.h"

namespace terrace::server {
namespace {

bool ShowsDatasets(const Call& call) { return call.route.row->shows != Shows::kNothing; }

bool NeedsGrant(const Route& route, const Grant& grant) {
  switch (route.row->shows) {
    case Shows::kOneDataset:
      return !grant.Sees(route.dataset);
    case Shows::kAllDatasets:
      return !grant.sees_all;
    case Shows::kNothing:
    case Shows::kSeenDatasets:
      break;
  }
  return false;
}

bool HasName(const Call& call) { return call.grant && !call.grant->name.empty(); }

// The key of a client for rate limits: a token's name after a slash, with which no address begins, or the block of the
// address.
std::string Who(const Call& call, const Caller& caller) {
  return HasName(call) ? "/" + call.grant->name : caller.block;
}

Response Unauthorized(bool has_token, std::string_view request_id) {
  Response response = ProblemResponse(
      401,
      has_token ? "this token is not known here" : "a token is needed: Authorization: Bearer, or ?token=", request_id);
  response.headers.emplace_back(
      "WWW-Authenticate", has_token ? R"(Bearer realm="terrace", error="invalid_token")" : R"(Bearer realm="terrace")");
  return response;
}

}  // namespace

Caller Gate::Identify(Request& request, const Caller& peer, Call& call) const {
  std::optional<std::string> in_query = TakeToken(request.target);
  const RequestFields& fields = *request.fields;
  // Returns false if the request has no Authorization header, no token in the query, and nothing that may be a token in
  // another spelling.
  request.is_private = fields.has_authorization || in_query || !IsPlainTarget(request.target);
  call.token_in_query = !fields.bearer && in_query.has_value();
  call.token = fields.bearer ? *fields.bearer : std::move(in_query).value_or("");
  call.grant = nullptr;
  call.has_bad_token = false;
  const AccessPolicy& access = options_.access;
  if (access.has_tokens()) {
    call.grant = call.token.empty() ? access.anonymous() : access.Find(call.token);
    call.has_bad_token = !call.grant;
    if (!call.grant) call.grant = access.anonymous();
  }
  const asio::ip::address client = ResolveClient(request, peer.address, options_.proxies);
  Caller caller = client == peer.address ? peer : Caller(client);
  request.client = HasName(call) ? std::hash<std::string>{}(Who(call, caller)) | 1 : caller.number;
  return caller;
}

RateLimiter::Turn Gate::TakeTurn(const Call& call, const Caller& caller, std::chrono::milliseconds longest_wait) {
  if (call.route.row != nullptr && call.route.row->is_probe) return {};
  RateLimiter::Rate rate = options_.rate;
  if (HasName(call) && call.grant->requests_per_second > 0) {
    rate.per_second = call.grant->requests_per_second;
    rate.burst = 2 * rate.per_second;
  }
  if (rate.per_second <= 0) return {};
  return limiter_.Take(Who(call, caller), rate, RateLimiter::Clock::now(), longest_wait);
}

Response Gate::TooManyRequests(const RateLimiter::Turn& turn, const Call& call) {
  Response response = ProblemResponse(429, "too many requests", call.request->id);
  const std::int64_t seconds = (turn.wait.count() + 999) / 1000;
  response.headers.emplace_back("Retry-After", fmt::to_string(std::max<std::int64_t>(seconds, 1)));
  if (call.route.row != nullptr) response.labels.route = call.route.row->label;
  return response;
}

std::optional<Response> Gate::Refuse(const Call& call) const {
  if (!options_.access.has_tokens() || !ShowsDatasets(call)) return std::nullopt;
  if (call.has_bad_token) return Unauthorized(true, call.request->id);
  if (!NeedsGrant(call.route, *call.grant)) return std::nullopt;
  // The reply must not reveal whether the dataset exists.
  if (call.grant->name.empty()) return Unauthorized(false, call.request->id);
  return ProblemResponse(403, "this token is for other datasets", call.request->id);
}

bool Gate::IsForGrant(const Call& call) const {
  const RouteRow& row = *call.route.row;
  if (!options_.access.has_tokens() || !ShowsDatasets(call)) return false;
  return row.shows == Shows::kSeenDatasets || (row.has_templates && call.token_in_query) ||
         NeedsGrant(call.route, *options_.access.anonymous());
}

}  // namespace terrace::server
