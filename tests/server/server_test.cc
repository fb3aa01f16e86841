#include "server/server.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <latch>
#include <string>
#include <thread>
#include <vector>

#include "tests/server/server_fixture.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

class ServerTest : public ServerFixture {};

TEST_F(ServerTest, ServesATileWithEverythingClientsRead) {
  Start();
  const Reply reply = Fetch(port(), "/maui/1/2/1.terrain", "Origin: http://example.test\r\n");
  EXPECT_EQ(reply.status, 200);
  tiler::TileRequest request;
  request.key = geo::TileKey{1, 2, 1};
  EXPECT_EQ(reply.body, BodyOf(request));
  EXPECT_EQ(reply.Field("content-type"), "application/vnd.quantized-mesh");
  EXPECT_EQ(reply.Field("content-encoding"), "");
  EXPECT_EQ(reply.Field("vary"), "Accept, Accept-Encoding");
  EXPECT_EQ(reply.Field("cache-control"), "public, max-age=3600");
  EXPECT_EQ(reply.Field("terrain-max-error"), "3.87124");
  EXPECT_EQ(reply.Field("access-control-allow-origin"), "*");
  EXPECT_EQ(reply.Field("timing-allow-origin"), "*");
  EXPECT_NE(reply.Field("access-control-expose-headers").find("Terrain-Max-Error"), std::string::npos);
  EXPECT_TRUE(reply.Field("server-timing").starts_with("cache;desc=miss, queue;dur="));
  EXPECT_FALSE(reply.Field("etag").empty());
  EXPECT_EQ(Fetch(port(), "/maui/1/2/1.terrain").Field("server-timing"), "cache;desc=hit");
}

// A URL with the version of a dataset always has the same bytes. Replies to requests with another version are not
// cached.
TEST_F(ServerTest, TellsHowLongRepliesMayBeKept) {
  more_datasets_.emplace_back().name = "oahu";
  more_datasets_.back().available = {{{0, 0, 1, 0}}};
  read_points_ = [](std::uint32_t, std::span<const dem::GeoPosition> points, dem::HeightDatum, std::stop_token) {
    return Result<std::vector<float>>(std::vector<float>(points.size(), 7.0f));
  };
  Start();
  const std::string v = std::string("v=") + kMauiVersion, other = "v=0a1b2c3d4e50";
  constexpr const char* kForGood = "public, max-age=31536000, immutable";
  const struct {
    std::string target;
    const char* cache_control;
    const char* vary;
  } cases[] = {
      {"/maui/0/0/0.terrain?" + v, kForGood, "Accept, Accept-Encoding"},
      {"/maui/0/0/0.terrain?error=5&atleast=1&" + v, kForGood, "Accept, Accept-Encoding"},
      {"/maui/0/0/0.terrain?" + v + "&" + other, kForGood, "Accept, Accept-Encoding"},
      {"/maui/0/0/0.terrain?" + other + "&" + v, "no-store", "Accept, Accept-Encoding"},
      {"/maui/0/0/0.terrain?" + other, "no-store", "Accept, Accept-Encoding"},
      {"/maui/0/0/0.terrain?v", "no-store", "Accept, Accept-Encoding"},
      {"/maui/0/0/0.terrain", "public, max-age=3600", "Accept, Accept-Encoding"},
      {"/oahu/0/0/0.terrain?" + v, "no-store", "Accept, Accept-Encoding"},
      {"/maui/0/0/0.glb?" + v, kForGood, ""},
      {"/maui/0/0/0.glb?compression=meshopt&" + v, kForGood, "Accept-Encoding"},
      {"/maui/0/0/0.png?" + v, kForGood, ""},
      {"/maui/3dtiles/0-0-0/0/0/0.4.subtree?" + v, kForGood, "Accept-Encoding"},
      {"/maui/3dtiles/0-0-0/0/0/0.4.subtree?" + other, "no-store", "Accept-Encoding"},
      {"/maui/3dtiles/0-0-0/0/0/0.4.subtree", "public, max-age=3600", "Accept-Encoding"},
      {"/maui/heights?locations=1,2&" + v, kForGood, "Accept-Encoding"},
      {"/maui/heights?locations=1,2&" + other, "no-store", "Accept-Encoding"},
      {"/maui/heights?locations=1,2", "public, max-age=3600", "Accept-Encoding"},
      {"/maui/layer.json?" + v, "no-cache", "Accept-Encoding"},
      {"/maui/tileset.json", "no-cache", "Accept-Encoding"},
      {"/maui/tiles.json?" + other, "no-cache", "Accept-Encoding"},
      {"/datasets", "no-cache", "Accept-Encoding"},
  };
  for (const auto& c : cases) {
    const Reply reply = Fetch(port(), c.target);
    ASSERT_EQ(reply.status, 200) << c.target;
    EXPECT_EQ(reply.Field("cache-control"), c.cache_control) << c.target;
    EXPECT_EQ(reply.Field("vary"), c.vary) << c.target;
    const std::string etag = reply.Field("etag");
    ASSERT_FALSE(etag.empty()) << c.target;
    const Reply same = Fetch(port(), c.target, "If-None-Match: " + etag + "\r\n");
    EXPECT_EQ(same.status, 304) << c.target;
    EXPECT_EQ(same.Field("cache-control"), c.cache_control) << c.target;
    EXPECT_EQ(same.Field("vary"), c.vary) << c.target;
    EXPECT_EQ(same.Field("etag"), etag);
  }
  for (const std::string& target :
       {"/maui/9/0/0.terrain?" + v, "/maui/0/0/0.terrain?error=0&" + v, "/nope/0/0/0.glb?" + v}) {
    EXPECT_EQ(Fetch(port(), target).Field("cache-control"), "no-store") << target;
  }
}

// The files of PROJ, geoids and grids of shifts between reference systems, may change while the version stays.
TEST_F(ServerTest, RepliesThatDependOnFilesOfProjHaveNoETag) {
  read_points_ = [](std::uint32_t, std::span<const dem::GeoPosition> points, dem::HeightDatum, std::stop_token) {
    return Result<std::vector<float>>(std::vector<float>(points.size(), 7.0f));
  };
  Start();
  const std::string versioned = std::string("&v=") + kMauiVersion;
  const std::string heights = "/maui/heights?locations=1,2", grid = "/maui/grid?width=2&height=2";
  for (const std::string& target :
       {heights + "&datum=ellipsoid", grid + "&bbox=0,0,1,1&datum=ellipsoid", grid + "&bbox=0,0,1,1&crs=EPSG:4326"}) {
    const Reply reply = Fetch(port(), target + versioned);
    ASSERT_EQ(reply.status, 200) << target << reply.body;
    EXPECT_NE(reply.Field("etag"), "") << target;
    EXPECT_NE(reply.Field("cache-control").find("immutable"), std::string::npos) << target;
  }
  for (const std::string& target : {heights + "&datum=orthometric", grid + "&bbox=0,0,1,1&datum=orthometric",
                                    grid + "&bbox=400000,5000000,400100,5000100&crs=EPSG:23032"}) {
    for (const char* fields : {"", "If-None-Match: *\r\n"}) {
      const Reply reply = Fetch(port(), target + versioned, fields);
      EXPECT_EQ(reply.status, 200) << target << reply.body;
      EXPECT_FALSE(reply.fields.contains("etag")) << target;
      EXPECT_EQ(reply.Field("cache-control"), "public, max-age=3600") << target;
    }
    EXPECT_EQ(Fetch(port(), target + "&v=0a1b2c3d4e5e").Field("cache-control"), "no-store") << target;
  }
}

// RFC 9110, section 13.2.1: a precondition does not hide that the request itself is refused.
TEST_F(ServerTest, AnyEtagDoesNotTurnARefusalIntoUnmodified) {
  read_points_ = [](std::uint32_t, std::span<const dem::GeoPosition> points, dem::HeightDatum, std::stop_token) {
    return Result<std::vector<float>>(std::vector<float>(points.size(), 7.0f));
  };
  Start();
  const std::string grid = "/maui/grid?bbox=0,0,1,1&height=2";
  for (const char* fields : {"", "If-None-Match: *\r\n"}) {
    EXPECT_EQ(Fetch(port(), grid + "&width=1", fields).status, 400);
  }
  EXPECT_EQ(Fetch(port(), grid + "&width=2", "If-None-Match: *\r\n").status, 304);
  EXPECT_EQ(Fetch(port(), "/maui/heights?locations=1,2", "If-None-Match: *\r\n").status, 304);
}

TEST_F(ServerTest, TellsTheVersionsOfItsDatasets) {
  Start();
  EXPECT_NE(Fetch(port(), "/datasets").body.find(std::string(R"("version":")") + kMauiVersion + '"'),
            std::string::npos);
  const std::string metrics = Fetch(port(), "/metrics").body;
  const std::string line = std::string(R"(terrace_dataset_info{dataset="maui",version=")") + kMauiVersion + "\"} 1\n";
  EXPECT_NE(metrics.find(line), std::string::npos) << metrics;
}

TEST_F(ServerTest, NegotiatesCodingAndExtensions) {
  Start();
  const Reply gzip = Fetch(port(), "/maui/0/0/0.terrain", "Accept-Encoding: gzip\r\n");
  EXPECT_EQ(gzip.Field("content-encoding"), "gzip");
  EXPECT_TRUE(gzip.body.starts_with("\x1f\x8b"));
  const Reply plain = Fetch(port(), "/maui/0/0/0.terrain", "Accept-Encoding: identity\r\n");
  EXPECT_EQ(plain.Field("content-encoding"), "");
  EXPECT_NE(plain.Field("etag"), gzip.Field("etag"));
  const char* const accept = "Accept: application/vnd.quantized-mesh;extensions=octvertexnormals\r\n";
  const Reply by_accept = Fetch(port(), "/maui/0/0/0.terrain", accept);
  EXPECT_NE(by_accept.body.find("normals true"), std::string::npos);
  EXPECT_EQ(by_accept.body, Fetch(port(), "/maui/0/0/0.terrain?extensions=octvertexnormals").body);
  EXPECT_EQ(builds_, 3) << "the query form found the tile of the Accept form";
}

TEST_F(ServerTest, AnswersConditionalRequests) {
  Start();
  const std::string etag = Fetch(port(), "/maui/0/0/0.terrain").Field("etag");
  for (const std::string& value : {etag, "W/" + etag, "\"other\", " + etag, std::string("*")}) {
    const Reply reply = Fetch(port(), "/maui/0/0/0.terrain", "If-None-Match: " + value + "\r\n");
    EXPECT_EQ(reply.status, 304) << value;
    EXPECT_EQ(reply.Field("etag"), etag);
    EXPECT_EQ(reply.Field("cache-control"), "public, max-age=3600");
    EXPECT_EQ(reply.Field("vary"), "Accept, Accept-Encoding");
    EXPECT_EQ(reply.Field("access-control-allow-origin"), "*");
  }
  EXPECT_EQ(Fetch(port(), "/maui/0/0/0.terrain", "If-None-Match: \"other\"\r\n").status, 200);
  const std::string layer_etag = Fetch(port(), "/maui/layer.json").Field("etag");
  EXPECT_EQ(Fetch(port(), "/maui/layer.json", "If-None-Match: " + layer_etag + "\r\n").status, 304);
}

TEST_F(ServerTest, ReportsErrorsAsProblems) {
  Start();
  const struct {
    const char* target;
    int status;
  } cases[] = {
      {"/maui/0/0/0.terrain?error=abc", 400},
      {"/maui/0/0/0.terrain?error=", 400},
      {"/maui/0/0/0.terrain?error=1&fraction=1", 400},
      {"/maui/0/0/0.terrain?x=1", 400},
      {"/maui/layer.json?error=0", 400},
      {"/datasets?x=1", 400},
      {"/maui/4/0/0.terrain", 404},
      {"/maui/0/2/0.terrain", 404},
      {"/maui/0/0/18446744073709551616.terrain", 404},
      {"/oahu/0/0/0.terrain", 404},
      {"/oahu/layer.json", 404},
      {"/nothing", 404},
      {"/viewer/../../etc/passwd", 404},
  };
  for (const auto& c : cases) {
    const Reply reply = Fetch(port(), c.target, "Accept-Encoding: gzip\r\n");
    EXPECT_EQ(reply.status, c.status) << c.target;
    EXPECT_EQ(reply.Field("content-type"), "application/problem+json") << c.target;
    EXPECT_EQ(reply.Field("content-encoding"), "") << c.target;
    EXPECT_TRUE(reply.Field("cache-control").ends_with("no-store")) << c.target;
    EXPECT_EQ(reply.Field("access-control-allow-origin"), "*") << c.target;
    EXPECT_NE(reply.body.find("\"request_id\":\""), std::string::npos) << c.target;
  }
  EXPECT_EQ(builds_, 0);
}

TEST_F(ServerTest, NeverEchoesRequestTextIntoHeaders) {
  Start();
  const Reply reply = Fetch(port(), "/maui/0/0/0.terrain?error=1%0d%0aSet-Cookie:%20a=b");
  EXPECT_EQ(reply.status, 400);
  EXPECT_EQ(reply.Field("set-cookie"), "");
}

TEST_F(ServerTest, SpeaksHttp10) {
  Start();
  RawClient client(port());
  client.Send("GET /livez HTTP/1.0\r\nConnection: keep-alive\r\n\r\n");
  auto reply = client.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->version, "HTTP/1.0");
  EXPECT_EQ(reply->Field("connection"), "keep-alive");
  client.Send("GET /livez HTTP/1.0\r\n\r\n");
  reply = client.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->Field("connection"), "close");
  EXPECT_TRUE(client.Ended());
}

TEST_F(ServerTest, AnswersPipelinedRequestsInOrder) {
  Start();
  RawClient client(port());
  std::string requests = "\r\n";  // an empty line before a request is ignored
  for (int x = 0; x < 16; ++x) requests += Get("/maui/3/" + std::to_string(x) + "/0.terrain");
  client.Send(requests);
  for (int x = 0; x < 16; ++x) {
    const auto reply = client.Read();
    ASSERT_TRUE(reply);
    EXPECT_TRUE(reply->body.starts_with("tile 3/" + std::to_string(x) + "/0 ")) << reply->body.substr(0, 20);
  }
}

TEST_F(ServerTest, AnswersHeadWithoutABody) {
  Start();
  RawClient client(port());
  client.Send("HEAD /maui/0/0/0.terrain HTTP/1.1\r\nHost: x\r\n\r\n" + Get("/livez"));
  const auto head = client.Read(true);
  ASSERT_TRUE(head);
  EXPECT_EQ(head->status, 200);
  EXPECT_GT(std::stoi(head->Field("content-length")), 2000);
  EXPECT_EQ(client.Read()->body, "ok\n");
}

TEST_F(ServerTest, AnswersPreflights) {
  Start();
  for (const std::string target : {"/maui/layer.json", "*", "/nothing", "/maui/heights"}) {
    RawClient client(port());
    client.Send("OPTIONS " + target +
                " HTTP/1.1\r\nHost: x\r\nOrigin: http://a\r\nAccess-Control-Request-Headers: authorization\r\n\r\n");
    const auto reply = client.Read();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->status, 204);
    const std::string methods = target == "/maui/heights" ? "GET, HEAD, OPTIONS, POST" : "GET, HEAD, OPTIONS";
    EXPECT_EQ(reply->Field("allow"), methods);
    EXPECT_EQ(reply->Field("access-control-allow-methods"), methods);
    EXPECT_EQ(reply->Field("access-control-allow-headers"), "*, Authorization");
    EXPECT_EQ(reply->Field("access-control-max-age"), "86400");
  }
}

TEST_F(ServerTest, SaysWhichMethodsAUrlTakes) {
  Start();
  for (const std::string method : {"PUT", "POST"}) {
    for (const std::string target : {"/maui/heights", "/maui/layer.json"}) {
      const bool takes_post = target == "/maui/heights";
      if (takes_post && method == "POST") continue;
      RawClient client(port());
      client.Send(method + " " + target + " HTTP/1.1\r\nHost: x\r\n\r\n");
      const auto reply = client.Read();
      ASSERT_TRUE(reply);
      EXPECT_EQ(reply->status, 405);
      EXPECT_EQ(reply->Field("allow"), takes_post ? "GET, HEAD, OPTIONS, POST" : "GET, HEAD, OPTIONS");
      EXPECT_NE(reply->body.find(reply->Field("allow")), std::string::npos) << "the text says so as well";
      EXPECT_TRUE(client.Ended());
    }
  }
}

TEST_F(ServerTest, ServesProbesMetricsDatasetsAndAPage) {
  Start();
  EXPECT_EQ(Fetch(port(), "/livez").body, "ok\n");
  EXPECT_EQ(Fetch(port(), "/readyz").body, "ready\n");
  EXPECT_NE(Fetch(port(), "/datasets").body.find("\"maui\""), std::string::npos);
  EXPECT_NE(Fetch(port(), "/").body.find("/maui/layer.json"), std::string::npos);
  // Uses one connection: a reply is counted after its last byte, but before the next request of the connection is read.
  RawClient client(port());
  client.Send(Get("/maui/0/0/0.terrain") + Get("/maui/0/0/0.terrain") + Get("/metrics"));
  ASSERT_TRUE(client.Read());
  ASSERT_TRUE(client.Read());
  const auto reply = client.Read();
  ASSERT_TRUE(reply);
  const std::string& metrics = reply->body;
  for (const char* line :
       {"terrace_http_requests_total{dataset=\"maui\",route=\"tile\",status=\"200\"} 2",
        "terrace_tile_builds_total{dataset=\"maui\",result=\"ok\"} 1",
        "terrace_cache_hits_total{tier=\"memory\",kind=\"tiles\"} 1",
        "terrace_cache_misses_total{tier=\"memory\",kind=\"tiles\"} 1",
        "terrace_cache_entries{tier=\"memory\",kind=\"tiles\"} 1",
        "terrace_cache_bytes{tier=\"memory\",kind=\"sample_blocks\"}",
        "terrace_cache_bytes{tier=\"memory\",kind=\"drawn_meshes\"}", "terrace_datasets 1", "terrace_degraded 0",
        "terrace_http_connections ", "terrace_http_request_duration_seconds_bucket{cache=\"hit\",route=\"tile\"",
        "terrace_tile_build_stage_seconds_count{stage=\"refine\"} 1", "terrace_queue_length 0",
        "terrace_source_read_errors_total 0", "terrace_flights_joined_total 0"}) {
    EXPECT_NE(metrics.find(line), std::string::npos) << line << "\n" << metrics;
  }
}

TEST_F(ServerTest, TwoHundredClientsOnAColdTileCauseOneBuild) {
  build_ms_ = 300;
  Start();
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 200; ++i) clients.push_back(std::make_unique<RawClient>(port()));
  for (auto& client : clients) ASSERT_TRUE(client->Send(Get("/maui/2/3/1.terrain")));
  int misses = 0;
  for (auto& client : clients) {
    const auto reply = client->Read();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->status, 200);
    misses += reply->Field("server-timing").starts_with("cache;desc=miss");
  }
  EXPECT_EQ(builds_, 1);
  EXPECT_EQ(misses, 1);
}

TEST_F(ServerTest, SurvivesASourceThatCannotBeRead) {
  std::atomic<bool> readable{false};
  builder_ = [&](const tiler::TileRequest&, std::stop_token) -> Result<tiler::EncodedTile> {
    if (!readable) return MakeError(ErrorCode::kUnavailable, "/data/secret.tif: I/O error");
    return tiler::EncodedTile();
  };
  Start();
  const Reply reply = Fetch(port(), "/maui/0/0/0.terrain");
  EXPECT_EQ(reply.status, 503);
  EXPECT_FALSE(reply.Field("retry-after").empty());
  EXPECT_EQ(reply.Field("content-type"), "application/problem+json");
  EXPECT_EQ(reply.body.find("secret"), std::string::npos);
  readable = true;
  EXPECT_EQ(Fetch(port(), "/maui/0/0/0.terrain").status, 200) << "the failure was not kept";
}

TEST_F(ServerTest, SurvivesABuilderThatThrows) {
  builder_ = [](const tiler::TileRequest&, std::stop_token) -> Result<tiler::EncodedTile> { throw std::bad_alloc(); };
  Start();
  EXPECT_EQ(Fetch(port(), "/maui/0/0/0.terrain").status, 503);
  EXPECT_EQ(Fetch(port(), "/livez").status, 200);
}

TEST_F(ServerTest, TellsEveryWaiterThatTheBuildFailed) {
  std::latch all_wait(1);
  builder_ = [&](const tiler::TileRequest&, std::stop_token) -> Result<tiler::EncodedTile> {
    ++builds_;
    all_wait.wait();
    return MakeError(ErrorCode::kUnavailable, "I/O error");
  };
  Start();
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 100; ++i) {
    clients.push_back(std::make_unique<RawClient>(port()));
    clients.back()->Send(Get("/maui/0/0/0.terrain"));
  }
  const auto joined = [&] { return Fetch(port(), "/metrics").body.find("terrace_flights_joined_total 99\n"); };
  EXPECT_TRUE(Eventually([&] { return joined() != std::string::npos; }));
  const auto failed = std::chrono::steady_clock::now();
  all_wait.count_down();
  for (auto& client : clients) {
    const auto reply = client->Read();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->status, 503);
  }
  EXPECT_EQ(builds_, 1);
  const auto slowest = std::chrono::steady_clock::now() - failed;
  RecordProperty("slowest_ms",
                 static_cast<int>(std::chrono::duration_cast<std::chrono::milliseconds>(slowest).count()));
}

TEST_F(ServerTest, RefusesWhatItsQueueCannotHold) {
  build_ms_ = 500;
  ServerOptions options;
  options.config.worker_threads = 1;
  options.config.queue_length = 1;
  Start(options);
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int x = 0; x < 8; ++x) {
    clients.push_back(std::make_unique<RawClient>(port()));
    clients.back()->Send(Get("/maui/3/" + std::to_string(x) + "/0.terrain"));
  }
  int good = 0, refused = 0;
  for (auto& client : clients) {
    const auto reply = client->Read();
    ASSERT_TRUE(reply);
    good += reply->status == 200;
    refused += reply->status == 503 && reply->Field("retry-after") == "1";
  }
  EXPECT_EQ(good + refused, 8);
  EXPECT_EQ(good, 2) << "one at work, one waiting";
}

TEST_F(ServerTest, GivesUpAtTheDeadline) {
  build_ms_ = 5'000;
  ServerOptions options;
  options.config.request_deadline = 150ms;
  Start(options);
  const auto begun = std::chrono::steady_clock::now();
  const Reply reply = Fetch(port(), "/maui/0/0/0.terrain");
  EXPECT_EQ(reply.status, 503);
  EXPECT_FALSE(reply.Field("retry-after").empty());
  EXPECT_LT(std::chrono::steady_clock::now() - begun, 2s);
}

class AbandonedBuild : public ServerFixture {
 protected:
  // Requests a tile that is never finished, disconnects by `leave`, and waits until the build is stopped.
  void ExpectStopWhen(void (*leave)(RawClient&)) {
    std::latch begun(1);
    std::promise<void> stopped;
    builder_ = [&](const tiler::TileRequest&, std::stop_token stop) -> Result<tiler::EncodedTile> {
      begun.count_down();
      if (Eventually([&] { return stop.stop_requested(); })) stopped.set_value();
      return MakeError(ErrorCode::kCancelled, "stopped");
    };
    Start();
    RawClient client(port());
    client.Send(Get("/maui/0/0/0.terrain"));
    begun.wait();
    leave(client);
    EXPECT_EQ(stopped.get_future().wait_for(2s), std::future_status::ready);
    server_.reset();
  }
};

TEST_F(AbandonedBuild, StopsAfterAReset) {
  ExpectStopWhen([](RawClient& client) { client.Reset(); });
}

TEST_F(AbandonedBuild, StopsAfterAClose) {
  ExpectStopWhen([](RawClient& client) { client.Close(); });
}

TEST_F(AbandonedBuild, StopsAfterAResetBehindAPipelinedRequest) {
  ExpectStopWhen([](RawClient& client) {
    client.Send(Get("/livez"));
    std::this_thread::sleep_for(200ms);
    client.Reset();
  });
}

TEST_F(ServerTest, AnswersQuickRequestsOfClientsThatCloseTheirDirection) {
  Start();
  RawClient client(port());
  client.Send(Get("/maui/0/0/0.terrain"));
  client.CloseOwnDirection();
  const auto reply = client.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 200);
}

TEST_F(ServerTest, SaysWhatToDoAboutATakenPort) {
  Start();
  ServerOptions options;
  options.config.listen.port = port();
  const auto second = Server::Start(options);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().message.find("127.0.0.1:" + std::to_string(port())), std::string::npos);
  EXPECT_NE(second.error().message.find("choose another port"), std::string::npos);
}

}  // namespace
}  // namespace terrace::server
