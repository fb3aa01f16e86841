// A call for a target, as the router makes it, without tokens.
#pragma once

#include <string>
#include <utility>

#include "server/api/call.h"
#include "server/routes.h"

namespace terrace::server {

struct TestCall {
  // Precondition: the target is a URL of the server.
  explicit TestCall(const std::string& target, Request r = {}) : request(std::move(r)) {
    call.request = &request;
    call.route = Routes().Match(target).value();
  }
  TestCall(const TestCall&) = delete;
  TestCall& operator=(const TestCall&) = delete;

  Request request;
  Call call;
};

}  // namespace terrace::server
