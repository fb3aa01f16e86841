// A call as the router makes it of a target, without tokens.
#pragma once

#include <string>
#include <utility>

#include "server/api/request_context.h"
#include "server/routes.h"

namespace terrace::server {

struct TestContext {
  // The target names a URL of the server.
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
