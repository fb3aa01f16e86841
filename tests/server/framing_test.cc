// Messages that two parsers could delimit differently, and messages that are too large, too slow or too many.
#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "tests/server/server_fixture.h"
#include "tests/support/resident_memory.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

class Framing : public ServerFixture {
 protected:
  // Sends `message` and then a valid request. The reply to the first must be `status`, and the second must get none.
  void ExpectOneAnswer(const std::string& message, int status) {
    RawClient client(port());
    client.Send(message + Get("/livez"));
    const auto reply = client.Read(message.starts_with("HEAD "));
    ASSERT_TRUE(reply) << message;
    EXPECT_EQ(reply->status, status) << message;
    EXPECT_EQ(reply->Field("connection"), "close") << message;
    EXPECT_EQ(reply->Field("content-type"), "application/problem+json");
    EXPECT_EQ(reply->Field("access-control-allow-origin"), "*");
    EXPECT_TRUE(client.Ended()) << "two answers to: " << message;
  }
};

TEST_F(Framing, AmbiguousMessagesGetOneAnswer) {
  Start();
  std::vector<std::string> fields;
  for (const char* coding : {"chunked", "gzip", "identity", "gzip, chunked", "chunked, gzip", "x", "CHUNKED", ""}) {
    fields.push_back("Transfer-Encoding: " + std::string(coding) + "\r\n");
    fields.push_back("transfer-encoding:\t" + std::string(coding) + "\r\nContent-Length: 0\r\n");
  }
  for (const char* length : {"1", "5", "44", "00", "+0", "-1", "0x0", "0,0", "0 0", "18446744073709551616", ""}) {
    fields.push_back("Content-Length: " + std::string(length) + "\r\n");
  }
  fields.push_back("Content-Length: 0\r\nContent-Length: 0\r\n");
  fields.push_back("Content-Length: 0\r\nContent-Length: 44\r\n");
  fields.push_back("A: b\r\n Content-Length: 44\r\n");
  fields.push_back("A: b\r\n\tTransfer-Encoding: chunked\r\n");
  fields.push_back("Content-Length : 44\r\n");
  fields.push_back("Content-Length: 44\n");
  fields.push_back("Host: other\r\n");
  int cases = 0;
  for (const std::string& field : fields) {
    for (const char* method : {"GET", "HEAD", "OPTIONS"}) {
      ExpectOneAnswer(std::string(method) + " /livez HTTP/1.1\r\nHost: x\r\n" + field + "\r\n", 400);
      ++cases;
    }
  }
  // Only this URL accepts a body. Each of these fields can be interpreted so that the next request is a part of the
  // body.
  for (const char* field :
       {"Transfer-Encoding: chunked\r\n", "Transfer-Encoding: chunked\r\nContent-Length: 5\r\n",
        "Content-Length: 5\r\nTransfer-Encoding: chunked\r\n", "Transfer-Encoding: gzip\r\nContent-Length: 5\r\n",
        "Transfer-Encoding : chunked\r\n",
        "Transfer-Encoding:\x0b"
        "chunked\r\n",
        "A: b\nTransfer-Encoding: chunked\r\n", "A: b\rTransfer-Encoding: chunked\r\n",
        "A: b\r\n Transfer-Encoding: chunked\r\n", "\x01Transfer-Encoding: chunked\r\n",
        "Content-Length: 5\r\nContent-Length: 6\r\n", "Content-Length: 5, 5\r\n", "Content-Length: +5\r\n",
        "Content-Length: 0x5\r\n", "Content-Length: 05\r\n", "Content-Length: 5 \x0b\r\n", "Content-Length: -5\r\n",
        "Content-Length: 18446744073709551621\r\n"}) {
    ExpectOneAnswer("POST /maui/heights HTTP/1.1\r\nHost: x\r\n" + std::string(field) + "\r\n0\r\n\r\n", 400);
    ++cases;
  }
  EXPECT_GE(cases, 60);
  RecordProperty("cases", cases);
  ExpectOneAnswer("GET /livez HTTP/1.1\r\n\r\n", 400);
  ExpectOneAnswer("GET /livez HTTP/1.0\r\nConnection: keep-alive\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 400);
  ExpectOneAnswer("GET /livez HTTP/2.0\r\nHost: x\r\n\r\n", 400);
  ExpectOneAnswer("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", 400);
}

TEST_F(Framing, OtherMethodsEndTheConnection) {
  Start();
  for (const char* method : {"POST", "PUT", "DELETE", "PATCH", "TRACE", "CONNECT", "BREW"}) {
    ExpectOneAnswer(std::string(method) + " /livez HTTP/1.1\r\nHost: x\r\n\r\n", 405);
  }
  ExpectOneAnswer("POST /livez HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 400);
}

TEST_F(Framing, LimitsHeadAndTarget) {
  Start();
  ExpectOneAnswer("GET /" + std::string(9'000, 'a') + " HTTP/1.1\r\nHost: x\r\n\r\n", 414);
  ExpectOneAnswer("GET /" + std::string(100'000, 'a') + " HTTP/1.1\r\nHost: x\r\n\r\n", 414);
  ExpectOneAnswer(Get("/livez", "A: " + std::string(17'000, 'b') + "\r\n"), 431);
  std::string many;
  for (int i = 0; i < 5'000; ++i) many += "A: b\r\n";
  ExpectOneAnswer(Get("/livez", many), 431);
}

TEST_F(Framing, FortyMegabytesOfHeaderCostNothing) {
  Start();
  Fetch(port(), "/livez");
  const std::string piece(1 << 20, 'b');
  const long before = test_support::ResidentKib();
  RawClient client(port());
  client.Send("GET /livez HTTP/1.1\r\nHost: x\r\nA: ");
  for (int i = 0; i < 40 && client.Send(piece); ++i) {
  }
  const auto reply = client.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 431);
  if (!test_support::kSanitized) {
    EXPECT_LT(test_support::ResidentKib() - before, 2048);
  }
}

TEST_F(Framing, ClosesSlowSendersWhateverTheyTrickle) {
  ServerOptions options;
  options.config.header_timeout = 300ms;
  Start(options);
  const auto begun = std::chrono::steady_clock::now();
  RawClient client(port());
  bool open = true;
  for (int i = 0; i < 100 && open; ++i) {
    open = client.Send("G");
    std::this_thread::sleep_for(20ms);
  }
  EXPECT_FALSE(open);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, 1500ms);
  RawClient silent(port());
  EXPECT_TRUE(silent.Ended()) << "says nothing at all";
}

TEST_F(Framing, ClosesIdleConnectionsLater) {
  ServerOptions options;
  options.config.header_timeout = 200ms;
  options.config.idle_timeout = 700ms;
  Start(options);
  RawClient client(port());
  client.Send(Get("/livez"));
  ASSERT_TRUE(client.Read());
  std::this_thread::sleep_for(400ms);
  client.Send(Get("/livez"));
  ASSERT_TRUE(client.Read()) << "idle for longer than a header may take, but not too long";
  EXPECT_TRUE(client.Ended());
}

TEST_F(Framing, AnEmptyLineAfterARequestDoesNotBeginTheNextOne) {
  ServerOptions options;
  options.config.header_timeout = 200ms;
  options.config.idle_timeout = 10s;
  Start(options);
  RawClient client(port());
  client.Send(Get("/livez") + "\r\n");
  ASSERT_TRUE(client.Read());
  std::this_thread::sleep_for(400ms);
  client.Send(Get("/livez"));
  const auto reply = client.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 200);
}

TEST_F(Framing, ClosesReadersThatTakeNothing) {
  ServerOptions options;
  options.config.write_timeout = 300ms;
  builder_ = [](const tiler::TileRequest&, std::stop_token) -> Result<tiler::EncodedTile> {
    tiler::EncodedTile tile;
    tile.bytes.assign(std::size_t{32} << 20, 'x');
    return tile;
  };
  Start(options);
  RawClient client(port(), 4096);
  client.Send(Get("/maui/0/0/0.terrain"));
  std::this_thread::sleep_for(1s);
  const auto reply = client.Read();
  EXPECT_TRUE(!reply || reply->status == -1) << "cut off, never complete";
}

TEST_F(Framing, ServesAtTheCapAgainWhenAConnectionLeaves) {
  build_ms_ = 1000;
  ServerOptions options;
  options.config.max_connections = 3;
  options.config.worker_threads = 3;
  Start(options);
  std::vector<std::unique_ptr<RawClient>> busy;
  for (int i = 0; i < 3; ++i) {
    busy.push_back(std::make_unique<RawClient>(port()));
    busy.back()->Send(Get("/maui/2/" + std::to_string(i) + "/0.terrain"));
  }
  ASSERT_TRUE(Eventually([&] { return builds_ == 3; }));  // all of them are being served
  const Reply refused = Fetch(port(), "/livez");
  EXPECT_EQ(refused.status, 503) << "told, not left waiting";
  EXPECT_EQ(refused.Field("retry-after"), "1");
  EXPECT_EQ(refused.Field("connection"), "close");
  EXPECT_TRUE(Eventually([&] { return Fetch(port(), "/livez").status == 200; })) << "their tiles are there";
}

TEST_F(Framing, GivesTheRoomOfIdleConnectionsToNewOnes) {
  ServerOptions options;
  options.config.max_connections = 3;
  Start(options);
  std::vector<std::unique_ptr<RawClient>> idle;
  for (int i = 0; i < 3; ++i) {
    idle.push_back(std::make_unique<RawClient>(port()));
    idle.back()->Send(Get("/livez"));
    ASSERT_TRUE(idle.back()->Read());
  }
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_EQ(Fetch(port(), "/livez").status, 200);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, 3s);
}

}  // namespace
}  // namespace terrace::server
