#include "server/edge/gate.h"

#include <gtest/gtest.h>

#include <string>

#include "config/common/token_hash.h"
#include "server/routes.h"

namespace terrace::server {
namespace {

Gate GateWith(const std::vector<config::TokenConfig>& tokens, const std::vector<std::string>& open = {}) {
  GateOptions options;
  options.access = *AccessPolicy::Make(tokens, open);
  return Gate(std::move(options));
}

// One request on its way past a gate.
struct Visit {
  explicit Visit(const Gate& gate, const std::string& target, RequestFields fields = {}) {
    request.target = target;
    request.fields = SharedFields(std::move(fields));
    call.request = &request;
    caller = gate.Identify(request, Caller(asio::ip::make_address("192.0.2.1")), call);
    if (const Result<Route> route = Routes().Match(request.target)) call.route = *route;
  }

  Request request;
  Call call;
  Caller caller;
};

RequestFields Bearing(const std::string& token) {
  RequestFields fields;
  fields.has_authorization = true;
  fields.bearer = token;
  return fields;
}

config::TokenConfig TokenOf(const std::string& name, const std::string& token, std::vector<std::string> datasets) {
  config::TokenConfig options;
  options.name = name;
  options.sha256 = config::TokenHash(token);
  options.datasets = std::move(datasets);
  return options;
}

constexpr const char* kGateToken = "0123456789abcdef";

TEST(Gate, TakesTheTokenOutOfTheTarget) {
  const Gate gate = GateWith({});
  const struct {
    const char *sent, *kept, *token;
  } cases[] = {
      {"/a?token=s", "/a", "s"},
      {"/a?token=s&error=5", "/a?error=5", "s"},
      {"/a?error=5&token=s", "/a?error=5", "s"},
      {"/a?error=5&token=s&v=1&token=s", "/a?error=5&v=1", "s"},
      {"/a?token=s%2Fx", "/a", "s/x"},
      {"/a?%74ok%65n=s", "/a?%74ok%65n=s", ""},
      {"/a?token", "/a", ""},
      {"/a?tokens=s", "/a?tokens=s", ""},
      {"/a?error=%zz&x=token", "/a?error=%zz&x=token", ""},
      {"/token=s", "/token=s", ""},
      {"/a?token=s&token=t", "/a", "s t"},  // fits nobody
  };
  for (const auto& c : cases) {
    const Visit visit(gate, c.sent);
    EXPECT_EQ(visit.request.target, c.kept);
    EXPECT_EQ(visit.call.token, c.token) << c.sent;
  }
  const Visit both(gate, "/?token=q", Bearing("h"));
  EXPECT_EQ(both.call.token, "h") << "the header counts before the query";
  EXPECT_EQ(both.request.target, "/");
  EXPECT_FALSE(both.call.token_in_query);
}

TEST(Gate, KeepsRepliesPrivateWhereASecretMayBe) {
  const Gate gate = GateWith({});
  for (const char* target : {"/a?token=s", "/a?%74oken=s", "/a?Token=s", "/a;token=s", "/a?v=1;token=s"}) {
    EXPECT_TRUE(Visit(gate, target).request.is_private) << target;
  }
  EXPECT_FALSE(Visit(gate, "/a?v=1&error=5").request.is_private);
  RequestFields basic;
  basic.has_authorization = true;
  EXPECT_TRUE(Visit(gate, "/a", basic).request.is_private);
}

TEST(Gate, ForgetsTheRequestBefore) {
  const Gate gate = GateWith({TokenOf("team", kGateToken, {})});
  Visit visit(gate, "/maui/layer.json?token=" + std::string(kGateToken));
  EXPECT_EQ(visit.call.grant->name, "team");
  EXPECT_TRUE(visit.call.token_in_query);
  const std::uint64_t named = visit.request.client;
  visit.request.target = "/maui/layer.json";
  visit.caller = gate.Identify(visit.request, Caller(asio::ip::make_address("192.0.2.1")), visit.call);
  EXPECT_EQ(visit.call.grant->name, "");
  EXPECT_EQ(visit.call.token, "");
  EXPECT_FALSE(visit.call.token_in_query);
  EXPECT_FALSE(visit.call.has_bad_token);
  EXPECT_NE(visit.request.client, named);
}

TEST(Gate, RefusesByWhatTheRowShows) {
  const Gate gate = GateWith({TokenOf("one", kGateToken, {"maui"})}, {"open"});
  const auto refused = [&](const std::string& target, RequestFields fields = {}) {
    const auto refusal = gate.Refuse(Visit(gate, target, std::move(fields)).call);
    return refusal ? refusal->status : 0;
  };
  EXPECT_EQ(refused("/maui/layer.json"), 401);
  EXPECT_EQ(refused("/open/layer.json"), 0);
  EXPECT_EQ(refused("/maui/layer.json", Bearing(kGateToken)), 0);
  EXPECT_EQ(refused("/other/0/0/0.terrain", Bearing(kGateToken)), 403);
  EXPECT_EQ(refused("/open/layer.json", Bearing("nobody's token....")), 401);
  EXPECT_EQ(refused("/metrics", Bearing(kGateToken)), 403) << "metrics tell of all datasets";
  EXPECT_EQ(refused("/metrics"), 401);
  for (const char* open : {"/", "/viewer/app.js", "/livez", "/readyz", "/datasets"})
    EXPECT_EQ(refused(open), 0) << open;
}

TEST(Gate, KnowsWhichRepliesDependOnTheGrant) {
  const Gate gate = GateWith({TokenOf("one", kGateToken, {})}, {"open"});
  const std::string token = std::string("?token=") + kGateToken;
  EXPECT_TRUE(gate.IsForGrant(Visit(gate, "/datasets").call));
  EXPECT_TRUE(gate.IsForGrant(Visit(gate, "/maui/0/0/0.terrain" + token).call));
  EXPECT_FALSE(gate.IsForGrant(Visit(gate, "/open/0/0/0.terrain" + token).call));
  EXPECT_TRUE(gate.IsForGrant(Visit(gate, "/open/layer.json" + token).call)) << "the token is in its templates";
  EXPECT_FALSE(gate.IsForGrant(Visit(gate, "/open/layer.json", Bearing(kGateToken)).call));
  EXPECT_FALSE(gate.IsForGrant(Visit(gate, "/livez").call));
  EXPECT_FALSE(GateWith({}).IsForGrant(Visit(gate, "/datasets").call)) << "everybody sees everything";
}

TEST(Gate, CountsAllButProbes) {
  GateOptions options;
  options.access = *AccessPolicy::Make({}, {});
  options.rate.per_second = 1;
  options.rate.burst = 1;
  Gate gate(std::move(options));
  const auto granted = [&](const char* target) {
    const Visit visit(gate, target);
    return gate.TakeTurn(visit.call, visit.caller, std::chrono::milliseconds(0)).granted;
  };
  EXPECT_TRUE(granted("/nothing/here/at/all"));
  EXPECT_FALSE(granted("/maui/layer.json")) << "the URL that does not exist counts";
  EXPECT_TRUE(granted("/livez"));
  EXPECT_TRUE(granted("/readyz"));
}

}  // namespace
}  // namespace terrace::server
