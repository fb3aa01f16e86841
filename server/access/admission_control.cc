#include "server/access/admission_control.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "config/common/token_hash.h"
#include "engine/core/check.h"
#include "server/http/http_error.h"
#include "server/http/text.h"
#include "server/telemetry/redact.h"

namespace terrace::server {
namespace {

bool RevealsDatasets(const RequestContext& context) { return context.route.row->scope != DatasetScope::kNothing; }

bool IsOutside(const Grant& grant, const Route& route) {
  switch (route.row->scope) {
    case DatasetScope::kOneDataset:
      return !grant.Sees(route.dataset);
    case DatasetScope::kAllDatasets:
      return !grant.sees_all;
    case DatasetScope::kNothing:
    case DatasetScope::kVisibleDatasets:
      break;
  }
  return false;
}

bool HasToken(const RequestContext& context) { return context.grant && !context.grant->name.empty(); }

// The key of a client for rate limits: "/" and the name of its token, or ClientIdentity::counted_as if it has no known
// token. No address begins with "/".
std::string Who(const RequestContext& context, const ClientIdentity& client) {
  return HasToken(context) ? "/" + context.grant->name : client.counted_as;
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

AccessPolicy AccessPolicy::Make(const std::vector<config::TokenConfig>& tokens,
                                const std::vector<std::string>& public_datasets) {
  AccessPolicy policy;
  for (const config::TokenConfig& token : tokens) {
    Grant grant;
    grant.name = token.name;
    grant.sees_all = token.datasets.empty();
    grant.datasets = {token.datasets.begin(), token.datasets.end()};
    grant.datasets.insert(public_datasets.begin(), public_datasets.end());
    grant.requests_per_second = token.requests_per_second;
    const auto added = policy.grants_.emplace(token.sha256, std::make_shared<const Grant>(std::move(grant)));
    TERRACE_CHECK(added.second);
  }
  Grant anonymous;
  anonymous.sees_all = tokens.empty();
  anonymous.datasets = {public_datasets.begin(), public_datasets.end()};
  policy.anonymous_ = std::make_shared<const Grant>(std::move(anonymous));
  return policy;
}

GrantPtr AccessPolicy::Find(std::string_view token) const {
  const auto found = grants_.find(config::TokenHash(token));
  return found == grants_.end() ? nullptr : found->second;
}

std::optional<std::string> TakeToken(std::string& target) {
  const std::size_t question = target.find('?');
  if (question == std::string::npos) return std::nullopt;
  std::string_view rest = std::string_view(target).substr(question + 1);
  if (rest.find("token") == std::string_view::npos) return std::nullopt;
  std::optional<std::string> token;
  std::string kept;
  while (!rest.empty()) {
    const std::string_view piece = rest.substr(0, rest.find('&'));
    rest.remove_prefix(std::min(rest.size(), piece.size() + 1));
    const std::size_t equals = std::min(piece.find('='), piece.size());
    if (piece.substr(0, equals) == "token") {
      std::string value = PercentDecode(piece.substr(std::min(equals + 1, piece.size()))).value_or("");
      // Tokens contain no blanks.
      token = !token || *token == value ? std::move(value) : *token + " " + value;
    } else {
      kept.append(kept.empty() ? 0 : 1, '&').append(piece);
    }
  }
  if (!token) return std::nullopt;
  target.resize(question);
  if (!kept.empty()) target.append("?").append(kept);
  return token;
}

ClientIdentity AdmissionControl::Identify(Request& request, const ClientIdentity& peer, RequestContext& context) const {
  std::optional<std::string> in_query = TakeToken(request.target);
  const RequestFields& fields = *request.fields;
  // Not private: no Authorization header, no token in the query, and nothing that may be a token in another spelling.
  request.is_private = fields.has_authorization || in_query || !IsPlainTarget(request.target);
  context.token_in_query = !fields.bearer && in_query.has_value();
  context.token = fields.bearer ? *fields.bearer : std::move(in_query).value_or("");
  context.grant = nullptr;
  context.has_bad_token = false;
  const AccessPolicy& access = options_.access;
  if (access.has_tokens()) {
    context.grant = context.token.empty() ? access.anonymous() : access.Find(context.token);
    context.has_bad_token = !context.grant;
    if (!context.grant) context.grant = access.anonymous();
  }
  const asio::ip::address address =
      options_.proxies.trusted.empty() ? peer.address : ResolveClient(request, peer.address, options_.proxies);
  ClientIdentity client = address == peer.address ? peer : ClientIdentity(address);
  request.client = HasToken(context) ? std::hash<std::string>{}(Who(context, client)) | 1 : client.number;
  return client;
}

RateLimiter::Turn AdmissionControl::TakeTurn(const RequestContext& context, const ClientIdentity& client,
                                             std::chrono::milliseconds longest_wait) {
  if (context.route.row != nullptr && context.route.row->is_probe) return {};
  RateLimiter::Rate rate = options_.rate;
  if (HasToken(context) && context.grant->requests_per_second > 0) {
    rate.per_second = context.grant->requests_per_second;
    rate.burst = 2 * rate.per_second;
  }
  if (rate.per_second <= 0) return {};
  return limiter_.Take(Who(context, client), rate, RateLimiter::Clock::now(), longest_wait);
}

Response AdmissionControl::TooManyRequests(const RateLimiter::Turn& turn, const RequestContext& context) {
  Response response = ProblemResponse(
      429,
      "more requests than requests_per_second of this server or token allows; send fewer, and this one again after "
      "the seconds in Retry-After",
      context.request->id);
  const std::int64_t seconds = (turn.wait.count() + 999) / 1000;
  response.headers.emplace_back("Retry-After", fmt::to_string(std::max<std::int64_t>(seconds, 1)));
  return response;
}

std::optional<Response> AdmissionControl::Refuse(const RequestContext& context) const {
  if (!options_.access.has_tokens() || !RevealsDatasets(context)) return std::nullopt;
  if (context.has_bad_token) return Unauthorized(true, context.request->id);
  if (!IsOutside(*context.grant, context.route)) return std::nullopt;
  // The reply must not reveal whether the dataset exists.
  if (context.grant->name.empty()) return Unauthorized(false, context.request->id);
  return ProblemResponse(403, "this token is for other datasets", context.request->id);
}

bool AdmissionControl::DependsOnToken(const RequestContext& context) const {
  const RouteRow& row = *context.route.row;
  if (!options_.access.has_tokens() || !RevealsDatasets(context)) return false;
  return row.scope == DatasetScope::kVisibleDatasets || (row.has_templates && context.token_in_query) ||
         IsOutside(*options_.access.anonymous(), context.route);
}

}  // namespace terrace::server
