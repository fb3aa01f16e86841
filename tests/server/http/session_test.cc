// Sessions on one thread: turns, and the deadlines of requests.
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

// Lets each request wait, answers it immediately, and records it.
class Echo : public Application {
 public:
  std::unique_ptr<ConnectionHandler> Connect(const asio::ip::address&) override {
    return std::make_unique<Handler>(*this);
  }
  std::string ClientOf(const asio::ip::address&) const override { return ""; }

  std::chrono::milliseconds wait{0};
  std::shared_ptr<const std::string> body;                                     // of the answers
  std::vector<std::string> targets;                                            // in the order of the answers
  std::vector<std::chrono::steady_clock::time_point> at_admission, at_answer;  // deadlines
  struct Report {
    int status = 0;
    std::size_t bytes = 0;
  };
  std::vector<Report> reports;

 private:
  class Handler : public ConnectionHandler {
   public:
    explicit Handler(Echo& echo) : echo_(echo) {}
    Admission Admit(Request& request, std::chrono::milliseconds) override {
      echo_.at_admission.push_back(request.deadline);
      Admission admission;
      admission.wait = echo_.wait;
      admission.max_body_bytes = 16;
      return admission;
    }
    Answer Handle(const Request& request) override {
      echo_.targets.emplace_back(request.target);
      echo_.at_answer.push_back(request.deadline);
      Response response;
      response.body = echo_.body;
      return response;
    }
    void Report(const SentReply& reply) override { echo_.reports.push_back({reply.response.status, reply.body_bytes}); }

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

class Sessions : public testing::Test {
 protected:
  Sessions() {
    context_->application = &echo_;
    context_->connections = &connections_;
    context_->transfers = &transfers_;
    context_->request_time_limit = &request_time_limit_;
  }
  ~Sessions() override { End(); }  // sessions must not outlive what they use

  void RunUntilAnswered(std::size_t requests) {
    while (echo_.targets.size() < requests && io_.run_one_for(std::chrono::seconds(10)) > 0) {
    }
  }
  void RunUntilReported() {
    while (echo_.reports.empty() && io_.run_one_for(std::chrono::seconds(10)) > 0) {
    }
  }
  // The client closes once its request was admitted.
  void ExpectReportOfLeaving(Ends& ends) {
    while (echo_.at_admission.empty() && io_.run_one_for(std::chrono::seconds(10)) > 0) {
    }
    ends.client.close();
    RunUntilReported();
    ASSERT_EQ(echo_.reports.size(), 1u);
    EXPECT_EQ(echo_.reports[0].status, 499);
  }
  void End() {
    connections_.AbortAll();
    io_.run_for(std::chrono::seconds(10));
  }

  asio::io_context io_{1};
  Echo echo_;
  ConnectionSet connections_{8};
  TransferBudget transfers_{64 << 20};
  const std::atomic<std::chrono::milliseconds> request_time_limit_{std::chrono::seconds(10)};
  const std::shared_ptr<SessionContext> context_ = std::make_shared<SessionContext>();
};

TEST_F(Sessions, RequestsSentAheadTakeTurnsWithOtherConnections) {
  constexpr int kAhead = 20;
  {
    Ends greedy(io_), polite(io_);
    Ask(greedy, "greedy", kAhead);
    Ask(polite, "polite", 1);
    StartSession(std::move(greedy.server), context_, "");
    StartSession(std::move(polite.server), context_, "");
    RunUntilAnswered(kAhead + 1);
    greedy.client.close();
    polite.client.close();
    End();
  }
  ASSERT_EQ(echo_.targets.size(), kAhead + 1U);
  const auto polite = std::ranges::find(echo_.targets, "/polite");
  ASSERT_NE(polite, echo_.targets.end());
  EXPECT_LE(polite - echo_.targets.begin(), 3) << "requests of the greedy one were answered before it";
}

TEST_F(Sessions, WaitsAndTheAnswerShareTheDeadlineOfTheHead) {
  using Clock = std::chrono::steady_clock;
  echo_.wait = std::chrono::milliseconds(50);
  {
    Ends ends(io_);
    const auto begun = Clock::now();
    StartSession(std::move(ends.server), context_, "");
    Ask(ends, "at-once", 1);
    RunUntilAnswered(1);
    asio::write(ends.client, asio::buffer(std::string("POST /slow HTTP/1.1\r\nHost: x\r\nContent-Length: 4\r\n\r\n")));
    while (echo_.at_admission.size() < 2 && io_.run_one_for(std::chrono::seconds(10)) > 0) {
    }
    io_.run_for(std::chrono::milliseconds(200));
    ASSERT_EQ(echo_.at_answer.size(), 1U) << "the body has not been sent";
    asio::write(ends.client, asio::buffer(std::string("body")));
    RunUntilAnswered(2);
    const auto taken = Clock::now() - begun;
    ends.client.close();
    End();
    ASSERT_EQ(echo_.at_answer.size(), 2U);
    EXPECT_GE(echo_.at_admission[0], begun + request_time_limit_.load());
    EXPECT_EQ(echo_.at_answer[0], echo_.at_admission[0]);
    const auto postponed = echo_.at_answer[1] - echo_.at_admission[1];
    EXPECT_GT(postponed.count(), 0) << "while the body arrived";
    EXPECT_LE(postponed, taken - 2 * echo_.wait) << "waits were not counted";
  }
}

TEST_F(Sessions, ReportsTheBytesThatWereWritten) {
  context_->options.write_timeout = std::chrono::milliseconds(100);
  echo_.body = std::make_shared<const std::string>(std::size_t{16} << 20, 'x');
  Ends ends(io_);
  Ask(ends, "large", 1);
  StartSession(std::move(ends.server), context_, "");
  RunUntilReported();
  ASSERT_EQ(echo_.reports.size(), 1u);
  EXPECT_EQ(echo_.reports[0].status, 200);
  EXPECT_GT(echo_.reports[0].bytes, 0u);
  EXPECT_LT(echo_.reports[0].bytes, echo_.body->size()) << "nobody has read it";
}

TEST_F(Sessions, ReportsAClientThatLeavesWhileItWaitsForItsTurn) {
  echo_.wait = std::chrono::seconds(60);
  Ends ends(io_);
  Ask(ends, "late", 1);
  StartSession(std::move(ends.server), context_, "");
  ExpectReportOfLeaving(ends);
}

TEST_F(Sessions, ReportsAClientThatLeavesDuringItsBody) {
  Ends ends(io_);
  asio::write(ends.client, asio::buffer(std::string("POST /late HTTP/1.1\r\nHost: x\r\nContent-Length: 4\r\n\r\nb")));
  StartSession(std::move(ends.server), context_, "");
  ExpectReportOfLeaving(ends);
  EXPECT_TRUE(echo_.targets.empty()) << "there was nothing to answer";
}

}  // namespace
}  // namespace terrace::server
