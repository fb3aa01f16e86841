// Connections that clients half close, abandon, or open in too large a number.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "tests/server/server_fixture.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

class Connections : public ServerFixture {};

// RFC 9293, section 3.6: a client that has closed one direction may still receive. The build takes longer than the
// server's checks of the client.
TEST_F(Connections, AClientThatEndsItsSendingGetsItsTile) {
  build_ms_ = 900;
  Start();
  RawClient client(port());
  client.Send(Get("/maui/0/0/0.terrain"));
  client.CloseOwnDirection();
  const auto reply = client.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 200);
  EXPECT_TRUE(client.Ended());
}

TEST_F(Connections, NewcomersTakeThePlacesOfUnfinishedHeads) {
  ServerOptions options;
  options.config.max_connections = 20;
  Start(options);
  std::vector<std::unique_ptr<RawClient>> slow;
  for (int i = 0; i < 60; ++i) {
    slow.push_back(std::make_unique<RawClient>(port()));
    slow.back()->Send("GET /maui/0/0/0.terrain HTTP/1.1\r\nHost:");
  }
  for (int i = 0; i < 40; ++i) EXPECT_EQ(Fetch(port(), "/maui/0/0/0.terrain").status, 200) << i;
}

TEST_F(Connections, ARequestThatIsServedKeepsItsPlace) {
  build_ms_ = 500;
  ServerOptions options;
  options.config.max_connections = 4;
  Start(options);
  RawClient served(port());
  served.Send(Get("/maui/0/0/0.terrain"));
  ASSERT_TRUE(Eventually([&] { return builds_ == 1; }));
  std::vector<std::unique_ptr<RawClient>> slow;
  for (int i = 0; i < 20; ++i) {
    slow.push_back(std::make_unique<RawClient>(port()));
    slow.back()->Send("GET / HT");
  }
  const auto reply = served.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 200);
}

// A client that sends bodies byte by byte, or requests more than all others, does not block the others.
TEST_F(Connections, NewcomersTakeThePlacesOfUnfinishedBodiesAndOfBusyFloods) {
  build_ms_ = 3000;
  ServerOptions options;
  options.config.max_connections = 20;
  Start(options);
  std::vector<std::unique_ptr<RawClient>> flood;
  const auto send = [&](const std::string& message) {
    flood.push_back(std::make_unique<RawClient>(port(), 0, "127.0.0.2"));
    flood.back()->Send(message);
  };
  for (int i = 0; i < 40; ++i) send("POST /maui/heights HTTP/1.1\r\nHost: x\r\nContent-Length: 99\r\n\r\n{");
  EXPECT_EQ(Fetch(port(), "/livez").status, 200) << "beside bodies";
  for (int i = 0; i < 40; ++i) send(Get("/maui/" + std::to_string(i) + "/0/0.terrain"));
  EXPECT_EQ(Fetch(port(), "/livez").status, 200) << "beside tiles";
}

TEST_F(Connections, TheBuildOfOneThatIsSentAwayStops) {
  std::atomic<int> begun = 0, stopped = 0;
  builder_ = [&](const tiler::TileRequest&, std::stop_token stop) -> Result<tiler::EncodedTile> {
    ++begun;
    while (!stop.stop_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    ++stopped;
    return MakeError(ErrorCode::kCancelled, "nobody waits");
  };
  ServerOptions options;
  options.config.max_connections = 2;
  options.config.worker_threads = 2;
  Start(options);
  RawClient first(port(), 0, "127.0.0.2"), second(port(), 0, "127.0.0.2");
  first.Send(Get("/maui/1/0/0.terrain"));
  second.Send(Get("/maui/1/1/0.terrain"));
  ASSERT_TRUE(Eventually([&] { return begun == 2; }));
  EXPECT_EQ(Fetch(port(), "/livez").status, 200);
  EXPECT_TRUE(Eventually([&] { return stopped == 1; }));
}

// RFC 9110, section 9.3.2: not even an error has a body then.
TEST_F(Connections, ARefusedHeadRequestGetsNoBody) {
  Start();
  RawClient client(port());
  client.Send("HEAD /livez HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n");
  const auto reply = client.Read(/*head=*/true);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 400);
  EXPECT_TRUE(client.Ended());
}

}  // namespace
}  // namespace terrace::server
