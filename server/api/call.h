// One request on its way to a handler: what was sent, what its URL names, and what its sender may see.
#pragma once

#include <string>

#include "server/api/access.h"
#include "server/api/route.h"
#include "server/http/request.h"

namespace terrace::server {

// Belongs to one connection, as its request does. Both outlive the answer.
struct Call {
  const Request* request = nullptr;  // never null in a handler
  Route route;
  std::string token;            // of the Authorization header, else of the query; a secret: never logged, never a key
  bool token_in_query = false;  // and not in the header
  GrantPtr grant;               // what the client may see; null: everything
  bool has_bad_token = false;

  bool sees_all() const { return !grant || grant->sees_all; }
};

}  // namespace terrace::server
