// The queue in Redis, with a Redis that this file plays: what a real one cannot be made to do.
#include "bake/queue/redis_queue.h"

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <optional>
#include <thread>

namespace terrace::bake {
namespace {

using std::chrono::milliseconds;

// Hands out the unit "a" at once. Does not answer to the second request for one.
class SlowRedis {
 public:
  SlowRedis() : listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(listener_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(listener_, 16), 0);
    ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
    accept_ = std::jthread([this] {
      for (int fd = 0; (fd = ::accept(listener_, nullptr, nullptr)) >= 0;) {
        const std::lock_guard lock(mutex_);
        open_.push_back(fd);
        threads_.emplace_back([this, fd] { Serve(fd); });
      }
    });
  }
  SlowRedis(const SlowRedis&) = delete;
  SlowRedis& operator=(const SlowRedis&) = delete;
  ~SlowRedis() {
    ::shutdown(listener_, SHUT_RDWR);
    accept_ = {};
    Release();
    threads_.clear();
    for (const int fd : open_) ::close(fd);
    ::close(listener_);
  }

  std::uint16_t port() const { return port_; }
  int takes() const { return takes_; }
  int beats() const { return beats_; }
  // Ends all connections.
  void Release() {
    const std::lock_guard lock(mutex_);
    for (const int fd : open_) ::shutdown(fd, SHUT_RDWR);
  }

 private:
  // The words of the first command, and the bytes that it has; nothing: not all is there.
  static std::optional<std::pair<std::vector<std::string>, std::size_t>> Parse(const std::string& bytes) {
    std::size_t at = 0;
    const auto number = [&]() -> std::optional<std::size_t> {
      const std::size_t end = bytes.find("\r\n", at);
      if (end == std::string::npos) return std::nullopt;
      const auto value = std::strtoul(bytes.c_str() + at + 1, nullptr, 10);
      at = end + 2;
      return value;
    };
    const auto count = number();
    std::vector<std::string> words;
    for (std::size_t i = 0; count && i < *count; ++i) {
      const auto size = number();
      if (!size || bytes.size() < at + *size + 2) return std::nullopt;
      words.push_back(bytes.substr(at, *size));
      at += *size + 2;
    }
    if (!count) return std::nullopt;
    return std::pair(std::move(words), at);
  }

  std::string ReplyTo(const std::vector<std::string>& words) {
    if (words[0] == "PING") return "+PONG\r\n";
    if (words[0] == "INFO") return "$19\r\nredis_version:7.0.0\r\n";
    if (words[0] != "EVAL") return "*0\r\n";  // there is no job, and nothing is dead
    if (words[1].find("XREADGROUP") != std::string::npos) {
      return ++takes_ == 1 ? "*4\r\n$4\r\nunit\r\n$3\r\n1-0\r\n$1\r\na\r\n:1\r\n" : "";
    }
    if (words[1].find("'XCLAIM', units, 'bakers', ARGV[2], 0") != std::string::npos) ++beats_;
    return "*1\r\n$2\r\nok\r\n";
  }

  void Serve(int fd) {
    std::string bytes;
    std::array<char, 65536> buffer{};
    for (ssize_t size = 0; (size = ::recv(fd, buffer.data(), buffer.size(), 0)) > 0;) {
      bytes.append(buffer.data(), static_cast<std::size_t>(size));
      while (const auto command = Parse(bytes)) {
        bytes.erase(0, command->second);
        const std::string reply = ReplyTo(command->first);
        ::send(fd, reply.data(), reply.size(), MSG_NOSIGNAL);
      }
    }
  }

  int listener_ = -1;
  std::uint16_t port_ = 0;
  std::atomic<int> takes_{0}, beats_{0};
  std::mutex mutex_;
  std::vector<int> open_;
  std::vector<std::jthread> threads_;
  std::jthread accept_;
};

TEST(RedisQueue, RenewsWhatItHoldsWhileAnotherCallIsNotAnswered) {
  SlowRedis redis;
  RedisQueueOptions options;
  options.job.address.host = "127.0.0.1";
  options.job.address.port = redis.port();
  options.job.name = "job";
  options.worker = "worker";
  options.units = {"a", "b"};
  options.find_missing = [] { return std::vector<std::size_t>{0, 1}; };
  options.lease = milliseconds(60);
  auto queue = RedisQueue::Join(std::move(options));
  ASSERT_TRUE(queue) << queue.error().message;
  EXPECT_EQ((*queue)->Take().state, UnitQueue::Taken::State::kUnit);
  std::atomic<bool> is_back{false};
  std::jthread other([&] {
    (*queue)->Take();
    is_back = true;
  });
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(8);  // below the time-out of a call
  while (redis.takes() < 2 && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(milliseconds(1));
  const int before = redis.beats();
  while (redis.beats() < before + 5 && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(milliseconds(1));
  }
  EXPECT_GE(redis.beats(), before + 5);
  EXPECT_FALSE(is_back);
  (*queue)->Done(0);  // does not wait for the call either
  EXPECT_FALSE(is_back);
  // Nothing is in hand any more, but Redis has not heard that the unit is done.
  const int after = redis.beats();
  while (redis.beats() < after + 5 && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(milliseconds(1));
  }
  EXPECT_GE(redis.beats(), after + 5);
  redis.Release();
  other.join();
}

}  // namespace
}  // namespace terrace::bake
