// Who may see which dataset: tokens, and datasets that need none.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "config/config.h"
#include "engine/core/result.h"

namespace terrace::server {

// What the bearer of a token may see. Immutable.
struct Grant {
  std::string name;  // empty: of those without a token
  bool sees_all = false;
  std::unordered_set<std::string> datasets;
  double requests_per_second = 0;

  bool Sees(const std::string& dataset) const { return sees_all || datasets.contains(dataset); }
};
using GrantPtr = std::shared_ptr<const Grant>;

// Immutable. Tokens are kept and compared as hashes: how long a comparison takes tells nothing about a token.
class AccessPolicy {
 public:
  // Without tokens everybody sees everything. With tokens, `public_datasets` are seen by everybody.
  // kInvalidArgument: a hash that is none, or a token given twice.
  static Result<AccessPolicy> Make(const std::vector<config::TokenConfig>& tokens,
                                   const std::vector<std::string>& public_datasets);

  bool has_tokens() const { return !grants_.empty(); }

  // What is seen without a token.
  const GrantPtr& anonymous() const { return anonymous_; }

  // Null: nobody has such a token.
  GrantPtr Find(std::string_view token) const;

 private:
  std::unordered_map<std::string, GrantPtr> grants_;  // by SHA-256
  GrantPtr anonymous_;
};

// Cuts every `token` parameter out of the query of `target` and returns its value, decoded; nothing where there is
// none. Clients append it on their own, as often as they follow a link; different values are none that fits. Other
// spellings of the name stay, and are refused with the request (RouteTable::Match) or ignored.
std::optional<std::string> TakeToken(std::string& target);

}  // namespace terrace::server
