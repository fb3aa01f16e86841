// What the client of a request may see.
#pragma once

#include <memory>
#include <string>
#include <unordered_set>

namespace terrace::server {

// What a request with a certain token may see. Immutable.
struct Grant {
  std::string name;  // empty: the grant of requests without a token
  bool sees_all = false;
  std::unordered_set<std::string> datasets;
  double requests_per_second = 0;  // 0: the limit of the server

  bool Sees(const std::string& dataset) const { return sees_all || datasets.contains(dataset); }
};
using GrantPtr = std::shared_ptr<const Grant>;

}  // namespace terrace::server
