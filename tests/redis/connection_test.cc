#include "redis/connection.h"

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <functional>
#include <stop_token>
#include <string>
#include <thread>

namespace terrace::redis {
namespace {

using std::chrono::milliseconds;

constexpr const char* kGreeting = "+PONG\r\n";

void Send(int fd, std::string_view text) { EXPECT_GE(::send(fd, text.data(), text.size(), MSG_NOSIGNAL), 0); }

std::string Receive(int fd) {
  std::array<char, 4096> buffer{};
  const ssize_t size = ::recv(fd, buffer.data(), buffer.size(), 0);
  return {buffer.data(), size > 0 ? static_cast<std::size_t>(size) : 0};
}

// Plays one connection of a server on a port of its own.
class FakeServer {
 public:
  explicit FakeServer(std::function<void(int)> play) {
    listener_ = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(::listen(listener_, 1), 0);
    socklen_t size = sizeof address;
    ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
    address_.host = "127.0.0.1";
    address_.port = ntohs(address.sin_port);
    thread_ = std::thread([this, play = std::move(play)] {
      const int fd = ::accept(listener_, nullptr, nullptr);
      if (fd < 0) return;
      play(fd);
      ::close(fd);
    });
  }
  ~FakeServer() {
    ::shutdown(listener_, SHUT_RDWR);
    thread_.join();
    ::close(listener_);
  }
  const Address& address() const { return address_; }

 private:
  int listener_ = -1;
  Address address_;
  std::thread thread_;
};

ConnectionOptions Quick() {
  ConnectionOptions options;
  options.connect_timeout = options.command_timeout = milliseconds(300);
  options.max_reply_bytes = 100'000;
  return options;
}

// What a client makes of a server that greets, and then replies `reply`.
Result<Reply> ReplyTo(const std::string& reply) {
  const FakeServer server([&](int fd) {
    Receive(fd);
    Send(fd, kGreeting);
    Receive(fd);
    Send(fd, reply);
  });
  auto connection = Connection::Open(server.address(), Quick());
  if (!connection) return tl::unexpected(connection.error());
  return (*connection)->Call({"GET", "secret-argument"});
}

TEST(RedisConnection, HasTheValuesOfReplies) {
  const auto reply = ReplyTo("*4\r\n$3\r\na\r\n\r\n:-7\r\n$-1\r\n*2\r\n+x\r\n:9\r\n");
  ASSERT_TRUE(reply) << reply.error().message;
  EXPECT_EQ(reply->size(), 4U);
  EXPECT_EQ((*reply)[0].text(), "a\r\n");
  EXPECT_EQ((*reply)[1].integer(), -7);
  EXPECT_TRUE((*reply)[2].is_nil());
  EXPECT_EQ((*reply)[3].Field("x").integer(), 9);
  EXPECT_TRUE((*reply)[3].Field("y").is_nil());
  EXPECT_TRUE((*reply)[4][5].is_nil());
}

TEST(RedisConnection, BytesAreSentAsTheyAre) {
  std::string sent;
  {
    const FakeServer server([&](int fd) {
      Receive(fd);
      Send(fd, kGreeting);
      sent = Receive(fd);
      Send(fd, "+OK\r\n");
    });
    auto connection = Connection::Open(server.address(), Quick());
    ASSERT_TRUE(connection) << connection.error().message;
    ASSERT_TRUE((*connection)->Call({"SET", "k", std::string("\0\r\n", 3)}));
  }
  EXPECT_EQ(sent, "*3\r\n$3\r\nSET\r\n$1\r\nk\r\n$3\r\n" + std::string("\0\r\n", 3) + "\r\n");
}

TEST(RedisConnection, ErrorsOfTheServerSayTheRemedyAndNoArgument) {
  const auto expect = [](const std::string& error, ErrorCode code, const std::string& part) {
    const auto reply = ReplyTo("-" + error + " secret-argument\r\n");
    ASSERT_FALSE(reply);
    EXPECT_EQ(reply.error().code, code) << error;
    EXPECT_NE(reply.error().message.find(part), std::string::npos) << reply.error().message;
    EXPECT_EQ(reply.error().message.find("secret"), std::string::npos) << reply.error().message;
  };
  expect("OOM command not allowed", ErrorCode::kOverloaded, "maxmemory");
  expect("READONLY You can't write", ErrorCode::kUnavailable, "primary");
  expect("NOAUTH Authentication required.", ErrorCode::kInvalidArgument, "password");
  expect("DENIED Redis is running in protected mode", ErrorCode::kInvalidArgument, "requirepass");
  expect("LOADING Redis is loading", ErrorCode::kUnavailable, "soon");
  expect("ERR unknown command `GET`", ErrorCode::kInvalidArgument, "does not know GET");
  expect("ERR something", ErrorCode::kUnavailable, "refuses GET (ERR)");
  expect("ERR max number of clients reached", ErrorCode::kUnavailable, "maxclients");
  expect("MOVED 3999 10.0.0.7:6381", ErrorCode::kInvalidArgument, "node of a cluster");
  expect("CLUSTERDOWN Hash slot not served", ErrorCode::kInvalidArgument, "node of a cluster");
  expect("MASTERDOWN Link with MASTER is down", ErrorCode::kUnavailable, "URL of the primary");
  expect("BUSY Redis is busy running a script", ErrorCode::kUnavailable, "script");
  expect("\x1b[2J" + std::string(50'000, 'x'), ErrorCode::kUnavailable, "refuses GET ()");
}

// A Redis without room for another client says so before it has read anything, and closes the connection.
TEST(RedisConnection, ARedisWithoutRoomForAClientIsNoWrongPassword) {
  for (const bool has_password : {false, true}) {
    const FakeServer server([](int fd) {
      Send(fd, "-ERR max number of clients reached\r\n");
      Receive(fd);
    });
    Address address = server.address();
    if (has_password) address.password = "secret";
    address.database = 3;
    const auto connection = Connection::Open(address, Quick());
    ASSERT_FALSE(connection);
    EXPECT_EQ(connection.error().code, ErrorCode::kUnavailable);
    EXPECT_NE(connection.error().message.find("maxclients"), std::string::npos) << connection.error().message;
  }
}

TEST(RedisConnection, AStopEndsItsWaits) {
  const FakeServer server([](int fd) {
    Receive(fd);
    Send(fd, kGreeting);
    while (!Receive(fd).empty()) {
    }
  });
  std::stop_source stop;
  ConnectionOptions options;
  options.connect_timeout = options.command_timeout = std::chrono::hours(1);
  options.stop = stop.get_token();
  auto connection = Connection::Open(server.address(), options);
  ASSERT_TRUE(connection) << connection.error().message;
  const std::jthread stops([&] {
    std::this_thread::sleep_for(milliseconds(50));
    stop.request_stop();
  });
  EXPECT_FALSE((*connection)->Call({"GET", "a"}));  // the test would wait for an hour
}

TEST(RedisConnection, PeersThatAreNoRedisAreRefused) {
  for (const std::string greeting : {"HTTP/1.0 400 Bad Request\r\n\r\n", "+OK\r\n", ":1\r\n", "*999999999\r\n",
                                     "*-5\r\n", "$99999999999999999999\r\n", ""}) {
    const FakeServer server([&](int fd) {
      Receive(fd);
      Send(fd, greeting);
    });
    const auto connection = Connection::Open(server.address(), Quick());
    ASSERT_FALSE(connection) << greeting;
    EXPECT_EQ(connection.error().code, ErrorCode::kUnavailable) << connection.error().message;
  }
}

TEST(RedisConnection, RepliesThatAreCutOrTooLongBreakIt) {
  for (const std::string& reply :
       {std::string("$10\r\nabc"), std::string("*2\r\n:1\r\n"), std::string("$-"), std::string("*30000\r\n*30000\r\n"),
        std::string("x"), "$200000\r\n" + std::string(200'000, 'x') + "\r\n"}) {
    const FakeServer server([&](int fd) {
      Receive(fd);
      Send(fd, kGreeting);
      Receive(fd);
      ::send(fd, reply.data(), reply.size(), MSG_NOSIGNAL);
    });
    auto connection = Connection::Open(server.address(), Quick());
    ASSERT_TRUE(connection) << connection.error().message;
    const auto answer = (*connection)->Call({"GET", "a"});
    ASSERT_FALSE(answer) << reply.substr(0, 20);
    EXPECT_EQ(answer.error().code, ErrorCode::kUnavailable);
    EXPECT_FALSE((*connection)->is_open());
    EXPECT_FALSE((*connection)->Call({"GET", "a"}));
  }
}

// hiredis's own time-outs start again with each byte.
TEST(RedisConnection, APeerThatSendsAByteNowAndThenRunsIntoTheDeadline) {
  const FakeServer server([](int fd) {
    Receive(fd);
    Send(fd, kGreeting);
    Receive(fd);
    Send(fd, "$1000\r\n");
    for (int i = 0; i < 1000 && ::send(fd, "x", 1, MSG_NOSIGNAL) == 1; ++i) {
      std::this_thread::sleep_for(milliseconds(20));
    }
  });
  auto connection = Connection::Open(server.address(), Quick());
  ASSERT_TRUE(connection) << connection.error().message;
  const auto answer = (*connection)->Call({"GET", "a"});
  ASSERT_FALSE(answer) << "1000 bytes take 20 s, the deadline is 0.3 s";
  EXPECT_NE(answer.error().message.find("in time"), std::string::npos) << answer.error().message;
}

TEST(RedisConnection, WithoutAServerItCannotBeReached) {
  Address address;
  address.host = "127.0.0.1";
  address.port = 1;
  const auto connection = Connection::Open(address, Quick());
  ASSERT_FALSE(connection);
  EXPECT_NE(connection.error().message.find("redis://127.0.0.1:1/0: cannot be reached"), std::string::npos)
      << connection.error().message;
}

}  // namespace
}  // namespace terrace::redis
