// Stopping while clients are busy.
#include <gtest/gtest.h>

#include <atomic>
#include <csignal>
#include <thread>
#include <vector>

#include "tests/server/server_fixture.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

class Drain : public ServerFixture {};

TEST_F(Drain, CutsNoReplyShortUnderLoad) {
  build_ms_ = 3;
  ServerOptions options;
  options.config.cache_bytes = 0;
  Start(options);
  std::atomic<int> answered{0}, cut{0}, failed{0};
  std::vector<std::thread> clients;
  for (int c = 0; c < 16; ++c) {
    clients.emplace_back([&, c] {
      RawClient client(port());
      for (int i = 0;; ++i) {
        if (!client.Send(Get("/maui/3/" + std::to_string((c + i) % 16) + "/" + std::to_string(i % 8) + ".terrain")))
          return;
        const auto reply = client.Read();
        if (!reply) return;
        ++(reply->status == 200 ? answered : reply->status == -1 ? cut : failed);
        if (reply->Field("connection") == "close") return;
      }
    });
  }
  EXPECT_TRUE(Eventually([&] { return answered > 100; }));
  const auto begun = std::chrono::steady_clock::now();
  server_->RequestStop();
  EXPECT_TRUE(server_->Wait());
  EXPECT_LT(std::chrono::steady_clock::now() - begun, 3s);
  for (std::thread& client : clients) client.join();
  EXPECT_EQ(cut, 0);
  EXPECT_EQ(failed, 0);
}

TEST_F(Drain, FinishesTheBuildThatAClientWaitsFor) {
  build_ms_ = 500;
  Start();
  RawClient client(port());
  client.Send(Get("/maui/0/0/0.terrain"));
  ASSERT_TRUE(Eventually([&] { return builds_ == 1; }));
  server_->RequestStop();
  const auto reply = client.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 200);
  EXPECT_EQ(reply->Field("connection"), "close");
  EXPECT_TRUE(server_->Wait());
}

TEST_F(Drain, CancelsWhatDoesNotFinishInTime) {
  build_ms_ = 60'000;
  ServerOptions options;
  options.config.drain_timeout = 200ms;
  Start(options);
  RawClient client(port());
  client.Send(Get("/maui/0/0/0.terrain"));
  ASSERT_TRUE(Eventually([&] { return builds_ == 1; }));
  const auto begun = std::chrono::steady_clock::now();
  server_->RequestStop();
  const auto reply = client.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 503) << "told, not cut off";
  EXPECT_FALSE(server_->Wait());
  EXPECT_LT(std::chrono::steady_clock::now() - begun, 4s);
}

// Waits until /readyz says so, on separate connections.
void WaitUntilDraining(std::uint16_t port) {
  EXPECT_TRUE(Eventually([&] { return Fetch(port, "/readyz").body == "draining\n"; }));
}

TEST_F(Drain, AnswersAnotherRequestOnIdleConnectionsAndTheFirstOfNewOnes) {
  ServerOptions options;
  options.config.drain_timeout = options.drain_grace =
      60s;  // is not used up, because each connection ends with its reply
  Start(options);
  RawClient idle(port()), unused(port());
  idle.Send(Get("/livez"));
  ASSERT_TRUE(idle.Read());
  server_->RequestStop();
  WaitUntilDraining(port());
  for (RawClient* client : {&idle, &unused}) {
    ASSERT_TRUE(client->Send(Get("/maui/0/0/0.terrain")));
    const auto reply = client->Read();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->status, 200);
    EXPECT_EQ(reply->Field("connection"), "close");
    EXPECT_TRUE(client->Ended());
  }
  EXPECT_TRUE(server_->Wait());
}

TEST_F(Drain, AnswersARequestWhoseFirstHalfCameInTheGrace) {
  ServerOptions options;
  options.drain_grace = 200ms;
  Start(options);
  RawClient client(port());
  client.Send(Get("/livez"));
  ASSERT_TRUE(client.Read());
  server_->RequestStop();
  ASSERT_TRUE(client.Send("GET /livez HTTP/1.1\r\n"));
  RawClient idle(port());
  EXPECT_TRUE(idle.Ended()) << "the grace is over";
  ASSERT_TRUE(client.Send("Host: x\r\n\r\n"));
  const auto reply = client.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 200);
  EXPECT_TRUE(server_->Wait());
}

TEST_F(Drain, ServesThroughTheDelayAlsoWithoutAConnection) {
  ServerOptions options;
  options.config.drain_delay = 1s;
  options.drain_grace = 0ms;
  Start(options);
  RawClient idle(port());
  idle.Send(Get("/livez"));
  ASSERT_TRUE(idle.Read());
  const std::uint16_t port_then = port();
  const auto begun = std::chrono::steady_clock::now();
  server_->RequestStop();
  WaitUntilDraining(port_then);
  ASSERT_TRUE(idle.Send(Get("/livez"))) << "idle connections stay open";
  EXPECT_TRUE(idle.Read());
  EXPECT_TRUE(idle.Ended());
  int answers = 0;
  while (Fetch(port_then, "/maui/0/0/0.terrain").status == 200) ++answers;
  EXPECT_GT(answers, 0);
  EXPECT_TRUE(server_->Wait());
  EXPECT_GE(std::chrono::steady_clock::now() - begun, 1s);
}

TEST_F(Drain, DoesNotWaitLongerForAConnectionThatComesLate) {
  ServerOptions options;
  options.config.drain_delay = 2s;
  options.config.drain_timeout = 1s;  // the delay counted from the connection on would be longer
  options.config.header_timeout = 60s;
  options.drain_grace = 100ms;
  Start(options);
  ASSERT_EQ(Fetch(port(), "/readyz").status, 200);
  const std::uint16_t port_then = port();
  server_->RequestStop();
  WaitUntilDraining(port_then);
  std::this_thread::sleep_for(1s);
  RawClient silent(port_then);
  EXPECT_TRUE(server_->Wait()) << "no request was open";
  EXPECT_TRUE(silent.Ended());
}

TEST_F(Drain, ClosesIdleConnectionsAfterTheGraceAndTakesNoNewOnes) {
  Start();
  RawClient idle(port());
  idle.Send(Get("/livez"));
  ASSERT_TRUE(idle.Read());
  const std::uint16_t port_then = port();
  server_->RequestStop();
  EXPECT_TRUE(idle.Ended());
  EXPECT_TRUE(server_->Wait());
  RawClient late(port_then);
  EXPECT_FALSE(late.Send("x"));
}

TEST_F(Drain, StopsOnASignal) {
  ServerOptions options;
  options.stop_on_signals = true;
  Start(options);
  std::raise(SIGTERM);
  EXPECT_TRUE(server_->Wait());
}

TEST_F(Drain, IsDoneOnceHoweverOftenAsked) {
  Start();
  server_->RequestStop();
  server_->RequestStop();
  EXPECT_TRUE(server_->Wait());
  EXPECT_TRUE(server_->Wait());
}

}  // namespace
}  // namespace terrace::server
