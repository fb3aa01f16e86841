// One request for a handler: the request, the meaning of its URL, and what its client may see.
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
  std::string token;            // from the Authorization header, else from the query; secret: never logged or cached
  bool token_in_query = false;  // the token came in the query
  GrantPtr grant;               // what the client may see; null: everything
  bool has_bad_token = false;

  bool sees_all() const { return !grant || grant->sees_all; }
};

}  // namespace terrace::server
