// A call as the router makes it of a target, without tokens.
#pragma once

#include <string>
#include <utility>

#include "server/api/call.h"
#include "server/routes.h"

namespace terrace::server {

struct TestCall {
  // The target names a URL of the server.
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
