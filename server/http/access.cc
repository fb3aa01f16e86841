#include "server/http/access.h"

#include <algorithm>
#include <string>

#include "config/token_hash.h"
#include "server/http/text.h"

namespace terrace::server {
namespace {

bool IsHash(std::string_view text) {
  return text.size() == 64 && std::all_of(text.begin(), text.end(), [](char c) { return HexDigit(c) >= 0; });
}

}  // namespace

Result<AccessPolicy> AccessPolicy::Make(const std::vector<TokenOptions>& tokens,
                                        const std::vector<std::string>& public_datasets) {
  AccessPolicy policy;
  for (const TokenOptions& options : tokens) {
    const std::string hash = options.sha256.empty() ? config::TokenHash(options.token) : Lower(options.sha256);
    if (!IsHash(hash)) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "token \"{}\": sha256 must be 64 hexadecimal digits, as sha256sum prints them", options.name);
    }
    Grant grant;
    grant.name = options.name;
    grant.sees_all = options.datasets.empty();
    grant.datasets = {options.datasets.begin(), options.datasets.end()};
    grant.datasets.insert(public_datasets.begin(), public_datasets.end());
    grant.requests_per_second = options.requests_per_second;
    if (!policy.grants_.emplace(hash, std::make_shared<const Grant>(std::move(grant))).second) {
      return MakeError(ErrorCode::kInvalidArgument, "token \"{}\": another token is the same; make a new one",
                       options.name);
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

}  // namespace terrace::server
