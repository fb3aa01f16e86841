#include "server/edge/gate.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "config/common/token_hash.h"
#include "server/http/http_error.h"
#include "server/http/text.h"
#include "server/telemetry/shown_target.h"

namespace terrace::server {
namespace {

bool IsHash(std::string_view text) {
  return text.size() == 64 && std::all_of(text.begin(), text.end(), [](char c) { return HexDigit(c) >= 0; });
}

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

Result<AccessPolicy> AccessPolicy::Make(const std::vector<config::TokenConfig>& tokens,
                                        const std::vector<std::string>& public_datasets) {
  AccessPolicy policy;
  for (const config::TokenConfig& token : tokens) {
    const std::string hash = Lower(token.sha256);
    if (!IsHash(hash)) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "token \"{}\": sha256 must be 64 hexadecimal digits, as sha256sum prints them", token.name);
    }
    Grant grant;
    grant.name = token.name;
    grant.sees_all = token.datasets.empty();
    grant.datasets = {token.datasets.begin(), token.datasets.end()};
    grant.datasets.insert(public_datasets.begin(), public_datasets.end());
    grant.requests_per_second = token.requests_per_second;
    if (!policy.grants_.emplace(hash, std::make_shared<const Grant>(std::move(grant))).second) {
      return MakeError(ErrorCode::kInvalidArgument, "token \"{}\": another token is the same; make a new one",
                       token.name);
    }
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
  const asio::ip::address client =
      options_.proxies.trusted.empty() ? peer.address : ResolveClient(request, peer.address, options_.proxies);
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
