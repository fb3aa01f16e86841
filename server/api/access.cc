#include "server/api/access.h"

#include <algorithm>
#include <string>
#include <utility>

#include "config/common/token_hash.h"
#include "server/http/text.h"
#include "server/query/query.h"

namespace terrace::server {
namespace {

bool IsHash(std::string_view text) {
  return text.size() == 64 && std::all_of(text.begin(), text.end(), [](char c) { return HexDigit(c) >= 0; });
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

}  // namespace terrace::server
