// Access to datasets: tokens, and datasets that are public.
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

// What a request with a certain token may see. Immutable.
struct Grant {
  std::string name;  // empty: the grant of requests without a token
  bool sees_all = false;
  std::unordered_set<std::string> datasets;
  double requests_per_second = 0;

  bool Sees(const std::string& dataset) const { return sees_all || datasets.contains(dataset); }
};
using GrantPtr = std::shared_ptr<const Grant>;

// Immutable. Tokens are stored and compared as hashes, so that the time of a comparison reveals nothing about a token.
class AccessPolicy {
 public:
  // Without tokens every dataset is public. With tokens only `public_datasets` are. kInvalidArgument: a text is not a
  // hash, or a token occurs twice.
  static Result<AccessPolicy> Make(const std::vector<config::TokenConfig>& tokens,
                                   const std::vector<std::string>& public_datasets);

  bool has_tokens() const { return !grants_.empty(); }

  // The grant of requests without a token.
  const GrantPtr& anonymous() const { return anonymous_; }

  // Returns null if the token is unknown.
  GrantPtr Find(std::string_view token) const;

 private:
  std::unordered_map<std::string, GrantPtr> grants_;  // by SHA-256
  GrantPtr anonymous_;
};

// Removes every `token` parameter from the query of `target` and returns its decoded value; nothing if there is none.
// Clients append the parameter each time they follow a link, so it may be repeated; if the values differ, the result is
// a token that does not exist. Other spellings of the name are kept; they are refused with the request
// (RouteTable::Match) or ignored.
std::optional<std::string> TakeToken(std::string& target);

}  // namespace terrace::server
