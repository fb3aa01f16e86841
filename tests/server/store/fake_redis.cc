#include "tests/server/store/fake_redis.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

namespace terrace::server {
namespace {

std::uint64_t Count(std::string_view text, std::string_view word) {
  std::uint64_t count = 0;
  for (std::size_t at = 0; (at = text.find(word, at)) != std::string_view::npos; at += word.size()) ++count;
  return count;
}

}  // namespace

FakeRedis::FakeRedis() : listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  SetValue("");
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  EXPECT_EQ(::bind(listener_, reinterpret_cast<sockaddr*>(&address), size), 0);
  constexpr int kWaiting = 64;
  EXPECT_EQ(::listen(listener_, kWaiting), 0);
  ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
  address_.host = "127.0.0.1";
  address_.port = ntohs(address.sin_port);
  accept_ = std::jthread([this] { Accept(); });
}

FakeRedis::~FakeRedis() {
  ::shutdown(listener_, SHUT_RDWR);
  accept_ = {};
  CloseAll();
  std::vector<std::jthread> threads;
  {
    const std::lock_guard lock(mutex_);
    threads.swap(threads_);
  }
  threads.clear();
  ::close(listener_);
}

void FakeRedis::SetValue(const std::string& value) { SetReply(fmt::format("${}\r\n{}\r\n", value.size(), value)); }

void FakeRedis::SetReply(const std::string& bytes) {
  const std::lock_guard lock(mutex_);
  reply_ = bytes;
}

void FakeRedis::CloseOne() {
  const std::lock_guard lock(mutex_);
  if (!open_.empty()) ::shutdown(open_.back(), SHUT_RDWR);
}

void FakeRedis::CloseAll() {
  const std::lock_guard lock(mutex_);
  for (const int fd : open_) ::shutdown(fd, SHUT_RDWR);
}

void FakeRedis::Accept() {
  while (true) {
    const int fd = ::accept(listener_, nullptr, nullptr);
    if (fd < 0) return;
    const std::lock_guard lock(mutex_);
    open_.push_back(fd);
    threads_.emplace_back([this, fd] { Serve(fd); });
  }
}

// The commands of these tests are small and sent at once, so a piece that is read has whole commands.
void FakeRedis::Serve(int fd) {
  std::array<char, 4096> buffer{};
  bool has_written = false;
  for (ssize_t size = 0; (size = ::recv(fd, buffer.data(), buffer.size(), 0)) > 0;) {
    const std::string_view text(buffer.data(), static_cast<std::size_t>(size));
    const std::uint64_t pings = Count(text, "\r\nPING\r\n"), others = Count(text, "\r\nGETRANGE\r\n");
    const std::uint64_t erased = Count(text, "\r\nUNLINK\r\n"), written = Count(text, "\r\nSET\r\n");
    const bool is_held = holds_ && Count(text, "\r\nNX\r\n") > 0;
    const bool is_silent = is_silent_ || (drops_ && has_written);
    has_written |= written > 0;
    std::string replies;
    for (std::uint64_t i = 0; i < pings; ++i) replies += "+PONG\r\n";
    for (std::uint64_t i = 0; i < others; ++i) {
      const std::lock_guard lock(mutex_);
      replies += reply_;
    }
    if (Count(text, "\r\nSCAN\r\n") > 0) replies += "*2\r\n$1\r\n0\r\n*0\r\n";
    for (std::uint64_t i = 0; i < erased; ++i) replies += ":1\r\n";
    for (std::uint64_t i = 0; i < written; ++i) replies += is_held ? "$-1\r\n" : "+OK\r\n";
    if (!is_silent) ::send(fd, replies.data(), replies.size(), MSG_NOSIGNAL);
    pings_ += pings;
    look_ups_ += others;
    erased_ += erased;
  }
  const std::lock_guard lock(mutex_);
  std::erase(open_, fd);
  ::close(fd);
}

}  // namespace terrace::server
