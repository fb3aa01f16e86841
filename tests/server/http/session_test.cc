// Several sessions on one thread take turns.
#include "server/http/session.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/write.hpp>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

namespace terrace::server {
namespace {

// Answers immediately, and records the targets in the order of the requests.
class Echo : public Application {
 public:
  std::unique_ptr<ConnectionHandler> Connect(const asio::ip::address&) override {
    return std::make_unique<Handler>(*this);
  }
  std::string ClientOf(const asio::ip::address&) const override { return ""; }

  std::vector<std::string> targets;

 private:
  class Handler : public ConnectionHandler {
   public:
    explicit Handler(Echo& echo) : echo_(echo) {}
    Admission Admit(Request&, std::chrono::milliseconds) override { return {}; }
    Answer Handle(const Request& request) override {
      echo_.targets.emplace_back(request.target);
      return Response{};
    }
    void Report(const SentReply&) override {}

   private:
    Echo& echo_;
  };
};

// Both ends of a connection.
struct Ends {
  explicit Ends(asio::io_context& io) : client(io), server(io) {
    asio::ip::tcp::acceptor acceptor(io, {asio::ip::address_v4::loopback(), 0});
    client.connect(acceptor.local_endpoint());
    server = acceptor.accept();
    server.non_blocking(true);
  }
  asio::ip::tcp::socket client, server;
};

void Ask(Ends& ends, const std::string& name, int requests) {
  std::string text;
  for (int i = 0; i < requests; ++i) text += "GET /" + name + " HTTP/1.1\r\nHost: x\r\n\r\n";
  asio::write(ends.client, asio::buffer(text));
}

TEST(Session, RequestsSentAheadTakeTurnsWithOtherConnections) {
  asio::io_context io{1};
  Echo echo;
  ConnectionSet connections(8);
  TransferBudget transfers(1 << 20);
  const std::atomic<std::chrono::milliseconds> deadline{std::chrono::seconds(10)};
  const auto context = std::make_shared<SessionContext>();
  context->application = &echo;
  context->connections = &connections;
  context->transfers = &transfers;
  context->deadline = &deadline;
  constexpr int kAhead = 20;
  {
    Ends greedy(io), polite(io);
    Ask(greedy, "greedy", kAhead);
    Ask(polite, "polite", 1);
    StartSession(std::move(greedy.server), context, "");
    StartSession(std::move(polite.server), context, "");
    while (echo.targets.size() < kAhead + 1 && io.run_one_for(std::chrono::seconds(10)) > 0) {
    }
    greedy.client.close();
    polite.client.close();
    connections.AbortAll();
    io.run_for(std::chrono::seconds(10));
  }
  ASSERT_EQ(echo.targets.size(), kAhead + 1U);
  const auto polite = std::ranges::find(echo.targets, "/polite");
  ASSERT_NE(polite, echo.targets.end());
  EXPECT_LE(polite - echo.targets.begin(), 3) << "requests of the greedy one were answered before it";
}

}  // namespace
}  // namespace terrace::server
