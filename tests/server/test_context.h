// A call for a target, as the router makes it, without tokens.
#pragma once

#include <string>
#include <utility>

#include "server/api/request_context.h"
#include "server/routes.h"

namespace terrace::server {

struct TestContext {
  // Precondition: the target is a URL of the server.
  explicit TestContext(const std::string& target, Request r = {}) : request(std::move(r)) {
    context.request = &request;
    context.route = Routes().Match(target).value();
  }
  TestContext(const TestContext&) = delete;
  TestContext& operator=(const TestContext&) = delete;

  Request request;
  RequestContext context;
};

}  // namespace terrace::server
