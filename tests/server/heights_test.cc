// Heights over HTTP: bodies, deadlines, load. Tests replace the function that computes heights.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "tests/server/server_fixture.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

std::string Post(const std::string& target, const std::string& body, const std::string& fields = "",
                 const char* type = "application/json") {
  return "POST " + target + " HTTP/1.1\r\nHost: x\r\nContent-Type: " + type +
         "\r\nContent-Length: " + std::to_string(body.size()) + "\r\n" + fields + "\r\n" + body;
}

class HeightsTest : public ServerFixture {
 protected:
  // Heights are latitude + 1000 * longitude.
  void StartHeights(ServerOptions options = {}) {
    read_points_ = [this](std::uint32_t, std::span<const dem::GeoPosition> points, dem::HeightDatum datum,
                          std::stop_token stop) -> Result<std::vector<float>> {
      ++reads_;
      const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(read_ms_);
      while (std::chrono::steady_clock::now() < until) {
        if (stop.stop_requested()) return stopped_ = true, MakeError(ErrorCode::kCancelled, "stopped");
        std::this_thread::sleep_for(1ms);
      }
      std::vector<float> heights;
      const double undulation = datum == dem::HeightDatum::kOrthometric ? 50 : 0;
      for (const auto& p : points) {
        heights.push_back(static_cast<float>(p.latitude + 1000 * p.longitude - undulation));
      }
      return heights;
    };
    Start(std::move(options));
  }

  std::atomic<int> reads_{0}, read_ms_{0};
  std::atomic<bool> stopped_{false}, certified_fails_{false};
};

double Elevation(const Reply& reply, std::size_t i) {
  return nlohmann::json::parse(reply.body)["results"][i]["elevation"];
}

TEST_F(HeightsTest, AnswersGetAndHead) {
  StartHeights();
  const Reply reply = Fetch(port(), "/maui/heights?locations=5,7|6,8");
  EXPECT_EQ(reply.status, 200);
  EXPECT_EQ(reply.Field("content-type"), "application/json");
  EXPECT_EQ(Elevation(reply, 0), 7005);
  EXPECT_EQ(Elevation(reply, 1), 8006);
  ASSERT_NE(reply.Field("etag"), "");
  EXPECT_TRUE(reply.Field("server-timing").starts_with("cache;desc=miss, queue;dur=")) << reply.Field("server-timing");
  EXPECT_EQ(Fetch(port(), "/maui/heights?locations=5,7|6,8", "If-None-Match: " + reply.Field("etag") + "\r\n").status,
            304);
  EXPECT_EQ(reads_, 1) << "what the client has is not made again";
  EXPECT_EQ(Fetch(port(), "/nope/heights?locations=5,7").status, 404);
  EXPECT_EQ(Fetch(port(), "/maui/heights?locations=5").status, 400);
  EXPECT_EQ(Fetch(port(), "/maui/heights").status, 400);
}

TEST_F(HeightsTest, CertifiesByTheTilesOfThePoints) {
  builder_ = [this](const tiler::TileRequest& request, std::stop_token) -> Result<tiler::EncodedTile> {
    ++builds_;
    if (certified_fails_) return MakeError(ErrorCode::kUnavailable, "the disk is gone");
    tiler::EncodedTile tile;
    tile.bytes = "tile";
    if (request.key.x > 0) tile.certified_error_m = 10.0 * request.key.level + static_cast<double>(request.key.x);
    return tile;
  };
  StartHeights();
  const auto results = [this](const char* level) {
    const Reply reply = Fetch(port(), std::string("/maui/heights?locations=5,7|6,8|5,-170&certify=") + level);
    EXPECT_EQ(reply.status, 200) << reply.body;
    EXPECT_EQ(reply.Field("etag"), "") << "what is certified is not known before it is made";
    return nlohmann::json::parse(reply.body)["results"];
  };
  const auto shallow = results("1");
  EXPECT_EQ(shallow[0]["tile"], "1/2/1");
  EXPECT_EQ(shallow[0]["certified_error"], 12);
  EXPECT_EQ(shallow[1]["tile"], "1/2/1");
  EXPECT_EQ(shallow[2]["tile"], "1/0/1");
  EXPECT_TRUE(shallow[2]["certified_error"].is_null()) << "no bound is known";
  EXPECT_EQ(builds_, 2) << "two points share a tile";
  EXPECT_EQ(results("deepest")[0]["tile"], "3/8/4");
  certified_fails_ = true;
  EXPECT_EQ(Fetch(port(), "/maui/heights?locations=5,100&certify=3").status, 503);
}

TEST_F(HeightsTest, CertifiesNoMoreTilesThanItSays) {
  more_datasets_.emplace_back();
  more_datasets_.back().name = "deep";
  for (int level = 0; level <= 8; ++level)
    more_datasets_.back().available.push_back({{0, 0, (2 << level) - 1, (1 << level) - 1}});
  StartHeights();
  const Reply reply = Fetch(port(), "/deep/heights?path=0,-80|0,80&samples=400&certify=8");
  EXPECT_EQ(reply.status, 400);
  EXPECT_NE(reply.body.find("certify: the points lie in more than 64 tiles"), std::string::npos) << reply.body;
  EXPECT_EQ(builds_, 0);
}

TEST_F(HeightsTest, AnswersPostsOneAfterTheOther) {
  StartHeights();
  RawClient client(port());
  // Two requests and a third of another kind in one piece, then one byte by byte.
  const std::string json = Post("/maui/heights", R"({"locations": "5,7"})");
  const std::string form = Post("/maui/heights", "locations=6%2C8", "", "application/x-www-form-urlencoded");
  client.Send(json + form + Get("/livez"));
  auto reply = client.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(Elevation(*reply, 0), 7005);
  EXPECT_EQ(reply->Field("cache-control"), "no-store");
  reply = client.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(Elevation(*reply, 0), 8006);
  reply = client.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->body, "ok\n");
  for (const char byte : json) client.Send({&byte, 1});
  reply = client.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(Elevation(*reply, 0), 7005);
  client.Send(Post("/maui/heights", ""));
  EXPECT_EQ(client.Read()->status, 400) << "an empty body asks for nothing";
}

TEST_F(HeightsTest, SaysThatTheBodyMayCome) {
  StartHeights();
  RawClient client(port());
  const std::string body = R"({"locations": "5,7"})";
  std::string head = Post("/maui/heights", body, "Expect: 100-continue\r\n");
  head.resize(head.size() - body.size());
  client.Send(head);
  const auto interim = client.Read(/*head=*/true);
  ASSERT_TRUE(interim);
  EXPECT_EQ(interim->status, 100);
  client.Send(body);
  EXPECT_EQ(client.Read()->status, 200);
}

TEST_F(HeightsTest, RefusesBodiesThatAreTooLarge) {
  ServerOptions options;
  options.config.max_locations = 10;
  StartHeights(options);
  for (const char* length : {"4737", "100000000000", "999999999999999"}) {
    RawClient client(port());
    client.Send("POST /maui/heights HTTP/1.1\r\nHost: x\r\nContent-Length: " + std::string(length) + "\r\n\r\n");
    const auto reply = client.Read();
    ASSERT_TRUE(reply) << length;
    EXPECT_EQ(reply->status, 413) << length;
    EXPECT_NE(
        reply->body.find(std::string(length) + " bytes, more than the 4736 that this URL takes; the limit follows "
                                               "from max_locations of this server: send fewer at once"),
        std::string::npos)
        << reply->body;
    EXPECT_EQ(reply->Field("connection"), "close");
    EXPECT_TRUE(client.Ended());
  }
  const std::string just(4736 - 27, ' ');
  RawClient client(port());
  client.Send(Post("/maui/heights", "{\"locations\":" + just + "\"5,7\"}\n\n\n\n\n\n\n\n"));
  EXPECT_EQ(client.Read()->status, 200);
}

TEST_F(HeightsTest, RefusesBodiesWhereverElse) {
  StartHeights();
  for (const char* length : {"00", "+1", "-1", "1,1", "1 1", "0x1", "1000000000000000000000", ""}) {
    RawClient client(port());
    client.Send("POST /maui/heights HTTP/1.1\r\nHost: x\r\nContent-Length: " + std::string(length) + "\r\n\r\nx" +
                Get("/livez"));
    EXPECT_EQ(client.Read()->status, 400) << length;
    EXPECT_TRUE(client.Ended()) << length;
  }
  for (const std::string fields : {"Transfer-Encoding: chunked\r\n", "Content-Length: 5\r\n"}) {
    RawClient client(port());
    client.Send(Post("/maui/heights", "{}", fields) + Get("/livez"));
    EXPECT_EQ(client.Read()->status, 400) << fields;
    EXPECT_TRUE(client.Ended());
  }
  for (const char* target : {"/livez", "/maui/layer.json", "/nope", "/maui/0/0/0.terrain"}) {
    RawClient client(port());
    client.Send(Post(target, "{}") + Get("/livez"));
    EXPECT_EQ(client.Read()->status, 405) << target;
    EXPECT_TRUE(client.Ended());
  }
}

TEST_F(HeightsTest, ClosesSlowBodies) {
  ServerOptions options;
  options.config.header_timeout = 300ms;
  StartHeights(options);
  const auto begun = std::chrono::steady_clock::now();
  RawClient client(port());
  client.Send("POST /maui/heights HTTP/1.1\r\nHost: x\r\nContent-Length: 1000\r\n\r\n");
  bool open = true;
  for (int i = 0; i < 100 && open; ++i) {
    open = client.Send("G");
    std::this_thread::sleep_for(20ms);
  }
  EXPECT_FALSE(open);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, 1500ms);
  EXPECT_EQ(reads_, 0);
}

TEST_F(HeightsTest, RefusedAndAbandonedBodiesAreCountedForTheirRouteAndDataset) {
  ServerOptions options;
  options.config.header_timeout = 400ms;
  options.config.max_locations = 10;
  StartHeights(options);
  const auto status_of = [&](const std::string& request) { return StatusOf(port(), request); };
  const std::string large(5000, ' ');
  EXPECT_EQ(status_of(Post("/maui/heights", large)), 413);
  EXPECT_EQ(status_of(Post("/maui/heights", "{}", "Content-Encoding: gzip\r\n")), 415);
  EXPECT_EQ(status_of(Post("/nope/heights", large)), 413);
  const std::string unfinished = "POST /maui/heights HTTP/1.1\r\nHost: x\r\nContent-Length: 20\r\n\r\n{";
  EXPECT_EQ(status_of(unfinished), 408);
  RawClient leaves(port());
  leaves.Send("POST /maui/heights HTTP/1.1\r\nHost: x\r\nExpect: 100-continue\r\nContent-Length: 20\r\n\r\n");
  EXPECT_EQ(leaves.Read(/*head=*/true)->status, 100) << "the server waits for the body";
  leaves.Reset();
  for (const char* labels :
       {R"(dataset="maui",route="heights",status="413")", R"(dataset="",route="heights",status="413")",
        R"(dataset="maui",route="heights",status="415")", R"(dataset="maui",route="heights",status="408")",
        R"(dataset="maui",route="heights",status="499")"}) {
    const std::string line = "terrace_http_requests_total{" + std::string(labels) + "} 1\n";
    EXPECT_TRUE(Eventually([&] { return Fetch(port(), "/metrics").body.find(line) != std::string::npos; })) << labels;
  }
}

TEST_F(HeightsTest, GivesUpAtTheDeadlineAndStopsReading) {
  ServerOptions options;
  options.config.request_deadline = 200ms;
  read_ms_ = 60'000;
  StartHeights(options);
  const Reply reply = Fetch(port(), "/maui/heights?locations=5,7");
  EXPECT_EQ(reply.status, 503);
  EXPECT_NE(reply.Field("retry-after"), "");
  EXPECT_TRUE(Eventually([&] { return stopped_.load(); }));
}

TEST_F(HeightsTest, StopsReadingWhenTheClientLeaves) {
  read_ms_ = 60'000;
  StartHeights();
  {
    RawClient client(port());
    client.Send(Get("/maui/heights?locations=5,7"));
    ASSERT_TRUE(Eventually([&] { return reads_ == 1; }));
    client.Reset();
  }
  EXPECT_TRUE(Eventually([&] { return stopped_.load(); }));
}

TEST_F(HeightsTest, RequestsAreNotJoinedButBounded) {
  ServerOptions options;
  options.config.worker_threads = 1;
  options.config.queue_length = 1;
  read_ms_ = 300;
  StartHeights(options);
  std::atomic<int> good{0}, refused{0};
  std::vector<std::thread> clients;
  for (int i = 0; i < 6; ++i) {
    clients.emplace_back([&] { ++(Fetch(port(), "/maui/heights?locations=5,7").status == 200 ? good : refused); });
  }
  for (std::thread& client : clients) client.join();
  EXPECT_EQ(good, reads_);
  EXPECT_GE(good, 1);
  EXPECT_GE(refused, 1);
}

TEST_F(HeightsTest, FailuresOfSourcesAreCountedWhateverIsAsked) {
  builder_ = [](const tiler::TileRequest&, std::stop_token) -> Result<tiler::EncodedTile> {
    return MakeError(ErrorCode::kUnavailable, "the disk is gone");
  };
  read_points_ = [](std::uint32_t, std::span<const dem::GeoPosition>, dem::HeightDatum,
                    std::stop_token) -> Result<std::vector<float>> {
    return MakeError(ErrorCode::kUnavailable, "the disk is gone");
  };
  Start();
  for (const char* target : {"/maui/heights?locations=5,7", "/maui/0/0/0.terrain"}) {
    EXPECT_EQ(Fetch(port(), target).status, 503) << target;
  }
  EXPECT_EQ(Fetch(port(), "/maui/heights").status, 400);
  EXPECT_TRUE(Eventually([&] {
    return Fetch(port(), "/metrics").body.find("\nterrace_source_read_errors_total 2\n") != std::string::npos;
  }));
}

TEST_F(HeightsTest, IsUnavailableWithoutAReader) {
  Start();
  EXPECT_EQ(Fetch(port(), "/maui/heights?locations=5,7").status, 503);
}

}  // namespace
}  // namespace terrace::server
