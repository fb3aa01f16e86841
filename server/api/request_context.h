// One request for a handler: the request, the row of the URL table that it matches, what its URL names, and what its
// client may see.
#pragma once

#include <string>

#include "server/api/grant.h"
#include "server/api/route.h"
#include "server/http/request.h"

namespace terrace::server {

// Belongs to one connection, as its request does. Both outlive the answer.
struct RequestContext {
  const Request* request = nullptr;  // never null in a handler
  Route route;
  std::string token;            // from the Authorization header, else from the query; secret: never logged or cached
  bool token_in_query = false;  // the token came in the query
  GrantPtr grant;               // what the client may see; null: everything
  bool has_bad_token = false;   // a token was sent that the server does not know; `grant` is the anonymous one

  bool sees_all() const { return !grant || grant->sees_all; }
};

}  // namespace terrace::server
