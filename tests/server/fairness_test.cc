// Many clients and few workers, over HTTP: who waits, who is next, and who is refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tests/server/server_fixture.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

// A proxy's header identifies the clients.
std::string From(const std::string& client) { return "X-Forwarded-For: " + client + "\r\n"; }

class Fairness : public ServerFixture {
 protected:
  // Workers block in every job until the test releases them. The test records jobs in the order in which they start.
  void StartHeld(ServerOptions options = {}) {
    builder_ = [this](const tiler::TileRequest& request, std::stop_token stop) -> Result<tiler::EncodedTile> {
      Begin(geo::ToString(request.key), stop);
      tiler::EncodedTile tile;
      tile.bytes = BodyOf(request);
      tile.etag = "\"" + geo::ToString(request.key) + "\"";
      return tile;
    };
    area_mesher_.plan = [](std::uint32_t, const tiler::AreaRequest&) -> Result<tiler::AreaPlan> {
      return tiler::AreaPlan();
    };
    area_mesher_.build = [this](std::uint32_t, const tiler::AreaPlan&, const tiler::AreaRequest& area,
                                std::stop_token stop) -> Result<tiler::EncodedTile> {
      Begin("mesh " + std::to_string(static_cast<int>(area.error_m)), stop);
      return tiler::EncodedTile();
    };
    read_points_ = [this](std::uint32_t, std::span<const dem::GeoPosition> points, dem::HeightDatum,
                          std::stop_token stop) -> Result<std::vector<float>> {
      Begin("heights " + std::to_string(static_cast<int>(points[0].latitude)), stop);
      return std::vector<float>(points.size());
    };
    options.config.request_deadline = 1h;
    options.config.trusted_proxies = {"127.0.0.1"};
    options.config.max_connections = 4000;
    Start(options);
  }
  void TearDown() override {
    LetAllGo();
    clients_.clear();  // a client that does not read its reply would delay the server's stop
    ServerFixture::TearDown();
  }

  RawClient& Send(const std::string& request) {
    clients_.push_back(std::make_unique<RawClient>(port()));
    clients_.back()->Send(request);
    return *clients_.back();
  }
  int StatusOf(RawClient& client) {
    const auto reply = client.Read();
    return reply ? reply->status : 0;
  }
  void LetOneGo() {
    const std::lock_guard lock(mutex_);
    ++let_go_;
    changed_.notify_all();
  }
  void LetAllGo() {
    const std::lock_guard lock(mutex_);
    all_ = true;
    changed_.notify_all();
  }
  std::vector<std::string> Begun() {
    const std::lock_guard lock(mutex_);
    return begun_;
  }
  long Gauge(const std::string& name) {
    const std::string text = "\n" + Fetch(port(), "/metrics").body;
    return std::stol(text.substr(text.find("\n" + name + " ") + name.size() + 2));
  }
  bool Waiting(long jobs) {
    return Eventually([&] { return Gauge("terrace_queue_length") == jobs; });
  }
  // A job leaves the queue before it records its start.
  bool HaveBegun(std::size_t jobs) {
    return Eventually([&] { return Begun().size() == jobs; });
  }
  // Both workers are blocked. `asked` is the recorded name of the polite client's request, which must start as soon as
  // one of them is free.
  void ExpectNext(RawClient& polite, const std::string& asked) {
    ASSERT_TRUE(HaveBegun(2));
    LetOneGo();
    ASSERT_TRUE(HaveBegun(3));
    EXPECT_EQ(Begun()[2], asked);
    LetAllGo();
    EXPECT_EQ(StatusOf(polite), 200);
    for (auto& client : clients_) {
      EXPECT_TRUE(client.get() == &polite || StatusOf(*client) == 200);
    }
  }
  // Of two workers, one is blocked in the first of `sent` long jobs, and the other one makes a tile.
  void ExpectATileBesideOneOf(long sent) {
    ASSERT_TRUE(Waiting(sent - 1));
    ASSERT_TRUE(HaveBegun(1));
    RawClient& polite = Send(Get("/maui/0/0/0.terrain", From("192.0.2.2")));
    ASSERT_TRUE(HaveBegun(2));
    EXPECT_EQ(Begun()[1], "0/0/0");
    LetAllGo();
    EXPECT_EQ(StatusOf(polite), 200);
  }
  static std::string Tile(int i) {
    return "/maui/3/" + std::to_string(i % 16) + "/" + std::to_string(i / 16 % 8) +
           ".terrain?fraction=" + std::to_string(0.05 * (1 << (i / 128)));
  }
  static std::string Post(const std::string& latitude, const std::string& fields) {
    const std::string body = R"({"locations": ")" + latitude + R"(,7"})";
    return "POST /maui/heights HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: " +
           std::to_string(body.size()) + "\r\n" + fields + "\r\n" + body;
  }

  std::vector<std::unique_ptr<RawClient>> clients_;

 private:
  void Begin(const std::string& what, const std::stop_token& stop) {
    const std::stop_callback wake(stop, [this] { changed_.notify_all(); });
    std::unique_lock lock(mutex_);
    begun_.push_back(what);
    changed_.wait(lock, [&] { return all_ || let_go_ > 0 || stop.stop_requested(); });
    if (!all_ && let_go_ > 0) --let_go_;
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::string> begun_;
  int let_go_ = 0;
  bool all_ = false;
};

TEST_F(Fairness, FourHundredAndEightyColdTilesOfOneClientAreAllServed) {
  StartHeld();
  for (int i = 0; i < 480; ++i) Send(Get(Tile(i)));
  ASSERT_TRUE(Waiting(478));
  LetAllGo();
  for (auto& client : clients_) EXPECT_EQ(StatusOf(*client), 200);
}

TEST_F(Fairness, WhoLeavesLeavesTheQueue) {
  StartHeld();
  for (int i = 0; i < 242; ++i) Send(Get(Tile(i), From("192.0.2.1")));
  ASSERT_TRUE(Waiting(240));
  for (auto& client : clients_) client->Reset();
  EXPECT_TRUE(Waiting(0));
  EXPECT_EQ(StatusOf(Send(Get("/livez"))), 200);
}

TEST_F(Fairness, ATileIsNextBesideAFloodOfTiles) {
  StartHeld();
  for (int i = 0; i < 300; ++i) Send(Get(Tile(i), From("192.0.2.1")));
  ASSERT_TRUE(Waiting(298));
  RawClient& polite = Send(Get("/maui/2/1/1.terrain", From("192.0.2.2")));
  ASSERT_TRUE(Waiting(299));
  ExpectNext(polite, "2/1/1");
}

TEST_F(Fairness, ATileThatTheFloodAskedForIsNextAllTheSame) {
  StartHeld();
  for (int i = 0; i < 120; ++i) Send(Get(Tile(i), From("192.0.2.1")));
  ASSERT_TRUE(Waiting(118));
  RawClient& polite = Send(Get(Tile(100), From("192.0.2.2")));
  ASSERT_TRUE(Waiting(119));
  ExpectNext(polite, "3/4/6");
}

TEST_F(Fairness, HeightsAreNextBesideAFloodOfHeights) {
  StartHeld();
  for (int i = 0; i < 300; ++i) Send(Get("/maui/heights?locations=1,7", From("192.0.2.1")));
  ASSERT_TRUE(Waiting(298));
  RawClient& polite = Send(Get("/maui/heights?locations=2,7", From("192.0.2.2")));
  ASSERT_TRUE(Waiting(299));
  ExpectNext(polite, "heights 2");
}

TEST_F(Fairness, AMeshIsNextBesideAFloodOfMeshes) {
  StartHeld();  // two workers, of which long work has one
  const std::string mesh = "/maui/mesh?bbox=-157,20,-156,21&error=";
  for (int i = 0; i < 12; ++i) Send(Get(mesh + "1", From("192.0.2.1")));
  ASSERT_TRUE(Waiting(11));
  ASSERT_TRUE(HaveBegun(1)) << "a worker is kept for tiles";
  RawClient& polite = Send(Get(mesh + "2", From("192.0.2.2")));
  ASSERT_TRUE(Waiting(12));
  LetOneGo();
  ASSERT_TRUE(HaveBegun(2));
  EXPECT_EQ(Begun()[1], "mesh 2");
  LetAllGo();
  EXPECT_EQ(StatusOf(polite), 200);
  for (auto& client : clients_) {
    EXPECT_TRUE(client.get() == &polite || StatusOf(*client) == 200);
  }
}

TEST_F(Fairness, LongListsOfPointsLeaveAWorkerForTiles) {
  StartHeld();
  std::string body = R"({"locations": ")";
  for (int i = 0; i < 5000; ++i) body += "1,7|";
  body += R"(1,7"})";
  const std::string post = "POST /maui/heights HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n" +
                           From("192.0.2.1") + "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body;
  for (int i = 0; i < 4; ++i) Send(post);
  ExpectATileBesideOneOf(4);
}

TEST_F(Fairness, LongRaysLeaveAWorkerForTiles) {
  StartHeld();
  const std::string ray = "/maui/sight?heights=ground&rays=1,7,2,3,7,2";  // 200 km
  for (int i = 0; i < 4; ++i) Send(Get(ray, From("192.0.2.1")));
  ExpectATileBesideOneOf(4);
}

class Uploads : public Fairness {
 protected:
  // A body of the largest accepted size, mostly blanks.
  static std::string Large(const std::string& fields) {
    std::string body = R"({"locations": "1,7"})";
    body.resize(600'000, ' ');
    return "POST /maui/heights HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: 600000\r\n" +
           fields + "\r\n" + body;
  }
  static std::string Begun(std::size_t bytes, const std::string& fields) {
    const std::string whole = Large(fields);
    return whole.substr(0, whole.find("\r\n\r\n") + 4 + bytes);
  }
};

TEST_F(Uploads, ThatAreOnlyAnnouncedTakeNothing) {
  ServerOptions options;
  options.config.header_timeout = 1h;
  StartHeld(options);
  LetAllGo();
  for (int i = 0; i < 60; ++i) Send(Begun(1, From("192.0.2.1")));
  EXPECT_EQ(StatusOf(Send(Large(From("192.0.2.2")))), 200);
  EXPECT_EQ(Gauge("terrace_http_transfers_cut_total"), 0);
}

TEST_F(Uploads, OfAFloodMakeRoomForAnothers) {
  ServerOptions options;
  options.config.header_timeout = 1h;
  StartHeld(options);
  LetAllGo();
  for (int i = 0; i < 60; ++i) Send(Begun(20'000, From("192.0.2.1")));
  ASSERT_TRUE(Eventually([&] { return Gauge("terrace_http_transfers_waiting") >= 40; }));
  EXPECT_EQ(StatusOf(Send(Large(From("192.0.2.2")))), 200);
  EXPECT_EQ(Gauge("terrace_http_transfers_cut_total"), 1) << "the newest of the flood";
}

TEST_F(Uploads, ThatAreDisplacedAreTold) {
  ServerOptions options;
  options.config.header_timeout = 1h;
  options.config.transfer_bytes = std::size_t{6} << 20;  // two uploads
  StartHeld(options);
  RawClient& answered = Send(Large(From("192.0.2.1")));
  ASSERT_TRUE(Eventually([&] { return Fairness::Begun().size() == 1; }));
  RawClient& reading = Send(Begun(20'000, From("192.0.2.1")));
  ASSERT_TRUE(Eventually([&] { return Gauge("terrace_http_transfer_bytes") == 1'200'000; }));
  RawClient& polite = Send(Large(From("192.0.2.2")));
  const auto told = reading.Read();
  ASSERT_TRUE(told);
  EXPECT_EQ(told->status, 503);
  EXPECT_NE(told->Field("retry-after"), "");
  LetAllGo();
  EXPECT_EQ(StatusOf(polite), 200);
  EXPECT_EQ(StatusOf(answered), 200);
}

TEST_F(Uploads, ThatLeaveWhileTheyWaitAreNotRefused) {
  ServerOptions options;
  options.config.transfer_bytes = std::size_t{6} << 20;  // two uploads
  StartHeld(options);
  for (int i = 0; i < 2; ++i) Send(Large(From("192.0.2.1")));
  ASSERT_TRUE(HaveBegun(2));
  RawClient& waiting = Send(Begun(20'000, From("192.0.2.1")));
  ASSERT_TRUE(Eventually([&] { return Gauge("terrace_http_transfers_waiting") == 1; }));
  waiting.Reset();
  EXPECT_TRUE(Eventually([&] { return Fetch(port(), "/metrics").body.find(R"(status="499")") != std::string::npos; }));
  EXPECT_EQ(Fetch(port(), "/metrics").body.find(R"(status="503")"), std::string::npos);
}

TEST_F(Uploads, ThatLeaveStayWithinTheirRoom) {
  StartHeld();
  for (int i = 0; i < 2; ++i) Send(Get(Tile(i)));  // the workers are busy
  ASSERT_TRUE(Eventually([&] { return Fairness::Begun().size() == 2; }));
  for (int i = 0; i < 260; ++i) {
    RawClient client(port());
    client.Send(Large(From("192.0.2.1")));
    EXPECT_TRUE(i % 20 != 0 || Gauge("terrace_http_transfer_bytes") <= 8 << 20);
  }
  EXPECT_LE(Gauge("terrace_http_transfer_bytes"), 8 << 20);
  EXPECT_TRUE(Eventually([&] { return Gauge("terrace_http_transfer_bytes") == 0; }));
  EXPECT_TRUE(Waiting(0));
}

TEST_F(Uploads, HaveTheirRoomUntilTheJobHasEnded) {
  StartHeld();
  Send(Large(""));
  ASSERT_TRUE(Eventually([&] { return Fairness::Begun().size() == 1; }));
  EXPECT_EQ(Gauge("terrace_http_transfer_bytes"), 600'000);
  LetAllGo();
  EXPECT_EQ(StatusOf(*clients_.back()), 200);
  EXPECT_TRUE(Eventually([&] { return Gauge("terrace_http_transfer_bytes") == 0; }));
}

TEST_F(Uploads, OfSlowClientsAreReadToTheirEnd) {
  ServerOptions options;
  options.config.header_timeout = 300ms;
  options.config.min_read_rate = 4096;
  StartHeld(options);
  LetAllGo();
  std::string body = R"({"locations": "1,7"})";
  body.resize(99'000, ' ');
  RawClient& client =
      Send("POST /maui/heights HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: " +
           std::to_string(body.size()) + "\r\n\r\n");
  for (std::size_t at = 0; at < body.size(); at += 9'000) {
    std::this_thread::sleep_for(100ms);  // 90,000 bytes a second, for longer than the timeout
    client.Send(body.substr(at, 9'000));
  }
  EXPECT_EQ(StatusOf(client), 200);
}

}  // namespace
}  // namespace terrace::server
