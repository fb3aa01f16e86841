// One secret in many spellings of requests: it is in no log, no metric, and no reply that a shared cache may store.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "config/common/token_hash.h"
#include "tests/server/server_fixture.h"

namespace terrace::server {
namespace {

constexpr const char* kSecret = "Vk3tSecretMarker42xyz";  // a token that opens "maui"

bool Holds(std::string text) {
  std::string secret = kSecret;
  for (std::string* each : {&text, &secret}) {
    std::transform(each->begin(), each->end(), each->begin(), [](unsigned char c) { return std::tolower(c); });
  }
  return text.find(secret) != std::string::npos;
}

// Replaces each "$" by the secret.
std::string FieldsWith(std::string text) {
  for (std::size_t at = 0; (at = text.find('$', at)) != std::string::npos;) text.replace(at, 1, kSecret);
  return text;
}

std::string Line(const std::string& target, const std::string& fields = "") {
  return FieldsWith("GET " + target + " HTTP/1.1\r\nHost: x\r\n" + fields + "\r\n");
}

// Texts after a path.
constexpr const char* kSpellings[] = {"?token=$",
                                      "?token=$&token=$",
                                      "?token=$&token=x",
                                      "?Token=$",
                                      "?TOKEN=$",
                                      "?%54oken=$",
                                      "?%74oken=$",
                                      "?tok%65n=$",
                                      "?token%3D$",
                                      "?token%3d$",
                                      "?%2574oken=$",
                                      "?;token=$",
                                      "?v=1;token=$",
                                      "?error=5;token=$",
                                      "?extensions=metadata;token=$",
                                      "?error=$",
                                      "?access_token=$",
                                      "?apikey=$",
                                      "?key=$",
                                      "?token[]=$",
                                      "?token+=$",
                                      "?amp;token=$",
                                      "?error=5&amp;token=$",
                                      "?$",
                                      "?$=1",
                                      "?token$",
                                      "?token=$%zz",
                                      "?token=$%00",
                                      "?%74%6f%6b%65%6e=$",
                                      "?t=%74oken%3D$",
                                      "?v=1?token=$",
                                      "??token=$",
                                      "#token=$",
                                      "?x#token=$",
                                      ";token=$",
                                      "%3Ftoken=$",
                                      "%3Ftoken%3D$",
                                      "&token=$",
                                      "/token=$",
                                      "/$",
                                      "?v=1&TOKEN=$",
                                      "?locations=1,2&Token=$"};

// Requests with the secret after the path, and in the header.
std::vector<std::string> Requests(const std::string& path) {
  std::vector<std::string> requests;
  for (const std::string spelling : kSpellings) requests.push_back(Line(path + spelling));
  for (const std::string field :
       {"Authorization: Bearer $", "Authorization: bearer  $ ", "Authorization: Bearer=$", "Authorization: Basic $",
        "Authorization: $", "Authorization: Token $", "Authorization: Bearer x\r\nAuthorization: Bearer $"}) {
    requests.push_back(Line(path, field + "\r\n"));
  }
  return requests;
}

// The same in other forms, and in other parts of a request.
std::vector<std::string> OtherForms(const std::string& path) {
  std::vector<std::string> requests;
  for (const std::string spelling : kSpellings) {
    const std::string target = path + spelling;
    requests.push_back(Line("http://x" + target));
    requests.push_back(FieldsWith("HEAD " + target + " HTTP/1.0\r\n\r\n"));
    requests.push_back(FieldsWith("OPTIONS " + target + " HTTP/1.1\r\nHost: x\r\n\r\n"));
    requests.push_back(FieldsWith("DELETE " + target + " HTTP/1.1\r\nHost: x\r\n\r\n"));
    requests.push_back(FieldsWith("GET " + target + " HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n"));  // refused
    requests.push_back(FieldsWith("GET " + target + " x HTTP/1.1\r\nHost: x\r\n\r\n"));           // likewise
  }
  requests.push_back(Line("http://u:$@x" + path));
  requests.push_back(Line("http://$" + path));
  requests.push_back(Line("$"));
  requests.push_back(FieldsWith("$ / HTTP/1.1\r\nHost: x\r\nAuthorization: x\r\n\r\n"));
  requests.push_back(FieldsWith("CONNECT $:443 HTTP/1.1\r\nHost: x\r\n\r\n"));
  for (const std::string referer : {"https://maps.example/globe?token=$", "https://u:$@maps.example/$;$#$", "$"}) {
    requests.push_back(Line("/livez", "Referer: " + referer + "\r\nAuthorization: x\r\n"));
  }
  const auto post = [&](const char* type, const std::string& body) {
    const std::string text = FieldsWith(body);
    requests.push_back(
        FieldsWith(fmt::format("POST /maui/heights HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer $\r\n"
                               "Content-Type: application/{}\r\nContent-Length: {}\r\n\r\n{}",
                               type, text.size(), text)));
  };
  for (const char* body : {"token=$", "Token=$", "token%3D$", "locations=$", "datum=$", "$"}) {
    post("x-www-form-urlencoded", body);
  }
  for (const char* body : {R"({"token": "$"})", R"({"$": 1})", R"({"locations": "$"})", R"({"step": $)", "$"}) {
    post("json", body);
  }
  return requests;
}

class Secrets : public ServerFixture {
 protected:
  Secrets() {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    old_logger_ = spdlog::default_logger();
    auto logger = std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::ostream_sink_mt>(log_));
    logger->set_level(spdlog::level::trace);
    spdlog::set_default_logger(std::move(logger));
  }
  ~Secrets() override {
    server_.reset();
    spdlog::set_default_logger(old_logger_);
    std::filesystem::remove_all(folder_);
  }

  void StartWith(config::AccessLogForm form, bool with_tokens) {
    ServerOptions options;
    options.config.access_log = form;
    if (form != config::AccessLogForm::kLog) options.config.access_log_file = folder_ / "access.log";
    if (with_tokens) options.config.tokens = {{"team", config::TokenHash(kSecret), {"maui"}, 0}};
    DatasetView open;
    open.name = "open";
    open.available = {{{0, 0, 1, 0}}};
    more_datasets_ = {open};
    options.config.datasets = {PublicDataset("open")};
    Start(options);
  }

  // Every reply must be private, or contain nothing about the request.
  void Ask(const std::string& request) {
    RawClient client(port());
    client.Send(request);
    const bool is_head = request.starts_with("HEAD");
    const std::optional<Reply> reply = client.Read(is_head);
    ASSERT_TRUE(reply) << request;
    EXPECT_GT(reply->status, 0) << request;
    const std::string cached = reply->Field("cache-control");
    // A part of a path is never used as a token, and there is no such URL.
    const bool is_part_of_path = request.find(std::string("/") + kSecret + ' ') != std::string::npos;
    EXPECT_TRUE(cached.starts_with("private") || is_part_of_path) << request << reply->status << ' ' << cached;
    if (reply->status >= 400) {
      EXPECT_FALSE(Holds(reply->body)) << request << reply->body;
    }
    for (const auto& [name, value] : reply->fields) EXPECT_FALSE(Holds(name + value)) << request << value;
    ++asked_;
  }

  std::string AccessLogText() const {
    std::ifstream in(folder_ / "access.log");
    return {std::istreambuf_iterator<char>(in), {}};
  }

  void ExpectNothingTold() {
    const std::string metrics =
        Fetch(port(), "/metrics", std::string("Authorization: Bearer ") + kSecret + "\r\n").body;
    EXPECT_FALSE(Holds(metrics));
    server_.reset();  // everything is written
    const std::string log = log_.str(), access_log = AccessLogText();
    EXPECT_FALSE(Holds(log)) << log.substr(std::min(log.size(), log.find(kSecret)) / 2, 2000);
    EXPECT_FALSE(Holds(access_log)) << access_log;
    EXPECT_GE(std::count(log.begin(), log.end(), '\n') + std::count(access_log.begin(), access_log.end(), '\n'), asked_)
        << "all were logged";
  }

  const std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) / ("secrets_" + std::to_string(::getpid()));
  std::ostringstream log_;
  std::shared_ptr<spdlog::logger> old_logger_;
  int asked_ = 0;
};

TEST_F(Secrets, AreInNoLogAndNoSharedReplyHoweverTheyAreSpelled) {
  StartWith(config::AccessLogForm::kLog, /*with_tokens=*/true);
  for (const char* path : {"/maui/0/0/0.terrain", "/open/0/0/0.terrain", "/open/layer.json", "/open/tileset.json",
                           "/open/tiles.json", "/open/heights", "/datasets", "/", "/livez", "/nothing/here"}) {
    for (const std::string& request : Requests(path)) Ask(request);
  }
  for (const std::string& request : OtherForms("/open/layer.json")) Ask(request);
  // The secret in place of a name, in paths of known URLs.
  for (const char* target : {"/$/layer.json", "/$/0/0/0.terrain", "/$/heights?locations=1,1", "/viewer/$", "/$"}) {
    EXPECT_GE(Fetch(port(), FieldsWith(target)).status, 400) << target;
    ++asked_;
  }
  ExpectNothingTold();
}

TEST_F(Secrets, AreInNoOtherFormOfTheAccessLog) {
  for (const config::AccessLogForm form : {config::AccessLogForm::kCombined, config::AccessLogForm::kJson}) {
    StartWith(form, /*with_tokens=*/true);
    for (const char* path : {"/open/layer.json", "/nothing/here"}) {
      for (const std::string& request : Requests(path)) Ask(request);
    }
    for (const std::string& request : OtherForms("/maui/0/0/0.terrain")) Ask(request);
    ExpectNothingTold();
  }
}

TEST_F(Secrets, AreKeptWhereNobodyNeedsThem) {
  StartWith(config::AccessLogForm::kLog, /*with_tokens=*/false);
  for (const char* path : {"/maui/0/0/0.terrain", "/maui/layer.json", "/", "/metrics"}) {
    for (const std::string& request : Requests(path)) Ask(request);
  }
  ExpectNothingTold();
}

TEST_F(Secrets, EncodedNamesAreRefused) {
  StartWith(config::AccessLogForm::kOff, /*with_tokens=*/true);
  for (const char* path : {"/maui/0/0/0.terrain", "/open/layer.json", "/open/tileset.json", "/open/tiles.json",
                           "/open/heights", "/open/mesh", "/datasets", "/livez", "/readyz", "/metrics"}) {
    for (const char* query : {"%54oken=", "%74oken=", "tok%65n=", "token%3D", "token%3d",
                              "%2574oken=", "v=1&%74oken=", "%74%6f%6b%65%6e=", "token%=", "token%"}) {
      EXPECT_EQ(Fetch(port(), std::string(path) + "?" + query + kSecret).status, 400) << path << '?' << query;
    }
  }
}

// Replies without a secret stay in shared caches.
TEST_F(Secrets, PlainRepliesStayPublic) {
  StartWith(config::AccessLogForm::kOff, /*with_tokens=*/true);
  const std::string tile = "/open/0/0/0.terrain", version = "v=" + tiler::VersionText(0);
  for (const std::string& target :
       {tile, tile + "?error=5&atleast=1", tile + "?extensions=octvertexnormals-metadata"}) {
    EXPECT_EQ(Fetch(port(), target).Field("cache-control"), "public, max-age=3600") << target;
  }
  for (const std::string& target : {tile + "?" + version, tile + "?" + version + "&error=5&atleast=1"}) {
    EXPECT_EQ(Fetch(port(), target).Field("cache-control"), "public, max-age=31536000, immutable") << target;
  }
  for (const char* target : {"/open/layer.json", "/open/tileset.json?error=50"}) {
    EXPECT_EQ(Fetch(port(), target).Field("cache-control"), "no-cache") << target;
  }
  EXPECT_EQ(Fetch(port(), tile + "?v=1.0.0").Field("cache-control"), "no-store");
}

}  // namespace
}  // namespace terrace::server
