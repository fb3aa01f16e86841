#include "server/access/admission_control.h"

#include <gtest/gtest.h>

#include <string>

#include "config/common/token_hash.h"
#include "server/routes.h"

namespace terrace::server {
namespace {

AdmissionControl AdmissionControlWith(const std::vector<config::TokenConfig>& tokens,
                                      const std::vector<std::string>& open = {}) {
  AdmissionOptions options;
  options.access = AccessPolicy::Make(tokens, open);
  return AdmissionControl(std::move(options));
}

// One request that passes a gate.
struct Visit {
  explicit Visit(const AdmissionControl& admission_control, const std::string& target, RequestFields fields = {}) {
    request.target = target;
    request.fields = SharedFields(std::move(fields));
    context.request = &request;
    caller = admission_control.Identify(request, ClientIdentity(asio::ip::make_address("192.0.2.1")), context);
    if (const Result<Route> route = Routes().Match(request.target)) context.route = *route;
  }

  Request request;
  RequestContext context;
  ClientIdentity caller;
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

TEST(AdmissionControl, TakesTheTokenOutOfTheTarget) {
  const AdmissionControl admission_control = AdmissionControlWith({});
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
      {"/a?token=s&token=t", "/a", "s t"},  // matches no token
  };
  for (const auto& c : cases) {
    const Visit visit(admission_control, c.sent);
    EXPECT_EQ(visit.request.target, c.kept);
    EXPECT_EQ(visit.context.token, c.token) << c.sent;
  }
  const Visit both(admission_control, "/?token=q", Bearing("h"));
  EXPECT_EQ(both.context.token, "h") << "the header counts before the query";
  EXPECT_EQ(both.request.target, "/");
  EXPECT_FALSE(both.context.token_in_query);
}

TEST(AdmissionControl, KeepsRepliesPrivateWhereASecretMayBe) {
  const AdmissionControl admission_control = AdmissionControlWith({});
  for (const char* target : {"/a?token=s", "/a?%74oken=s", "/a?Token=s", "/a;token=s", "/a?v=1;token=s"}) {
    EXPECT_TRUE(Visit(admission_control, target).request.is_private) << target;
  }
  EXPECT_FALSE(Visit(admission_control, "/a?v=1&error=5").request.is_private);
  RequestFields basic;
  basic.has_authorization = true;
  EXPECT_TRUE(Visit(admission_control, "/a", basic).request.is_private);
}

TEST(AdmissionControl, ForgetsTheRequestBefore) {
  const AdmissionControl admission_control = AdmissionControlWith({TokenOf("team", kGateToken, {})});
  Visit visit(admission_control, "/maui/layer.json?token=" + std::string(kGateToken));
  EXPECT_EQ(visit.context.grant->name, "team");
  EXPECT_TRUE(visit.context.token_in_query);
  const std::uint64_t named = visit.request.client;
  visit.request.target = "/maui/layer.json";
  visit.caller =
      admission_control.Identify(visit.request, ClientIdentity(asio::ip::make_address("192.0.2.1")), visit.context);
  EXPECT_EQ(visit.context.grant->name, "");
  EXPECT_EQ(visit.context.token, "");
  EXPECT_FALSE(visit.context.token_in_query);
  EXPECT_FALSE(visit.context.has_bad_token);
  EXPECT_NE(visit.request.client, named);
}

TEST(AdmissionControl, RefusesByWhatTheRowShows) {
  const AdmissionControl admission_control = AdmissionControlWith({TokenOf("one", kGateToken, {"maui"})}, {"open"});
  const auto refused = [&](const std::string& target, RequestFields fields = {}) {
    const auto refusal = admission_control.Refuse(Visit(admission_control, target, std::move(fields)).context);
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

TEST(AdmissionControl, KnowsWhichRepliesDependOnTheGrant) {
  const AdmissionControl admission_control = AdmissionControlWith({TokenOf("one", kGateToken, {})}, {"open"});
  const std::string token = std::string("?token=") + kGateToken;
  EXPECT_TRUE(admission_control.DependsOnToken(Visit(admission_control, "/datasets").context));
  EXPECT_TRUE(admission_control.DependsOnToken(Visit(admission_control, "/maui/0/0/0.terrain" + token).context));
  EXPECT_FALSE(admission_control.DependsOnToken(Visit(admission_control, "/open/0/0/0.terrain" + token).context));
  EXPECT_TRUE(admission_control.DependsOnToken(Visit(admission_control, "/open/layer.json" + token).context))
      << "the token is in its templates";
  EXPECT_FALSE(
      admission_control.DependsOnToken(Visit(admission_control, "/open/layer.json", Bearing(kGateToken)).context));
  EXPECT_FALSE(admission_control.DependsOnToken(Visit(admission_control, "/livez").context));
  EXPECT_FALSE(AdmissionControlWith({}).DependsOnToken(Visit(admission_control, "/datasets").context))
      << "everybody sees everything";
}

TEST(AdmissionControl, CountsAllButProbes) {
  AdmissionOptions options;
  options.access = AccessPolicy::Make({}, {});
  options.rate.per_second = 1;
  options.rate.burst = 1;
  AdmissionControl admission_control(std::move(options));
  const auto granted = [&](const char* target) {
    const Visit visit(admission_control, target);
    return admission_control.TakeTurn(visit.context, visit.caller, std::chrono::milliseconds(0)).granted;
  };
  EXPECT_TRUE(granted("/nothing/here/at/all"));
  EXPECT_FALSE(granted("/maui/layer.json")) << "the URL that does not exist counts";
  EXPECT_TRUE(granted("/livez"));
  EXPECT_TRUE(granted("/readyz"));
}

}  // namespace
}  // namespace terrace::server
