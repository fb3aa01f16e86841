#include "tests/server/raw_client.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <utility>

namespace terrace::server {

std::string Reply::Field(const std::string& name) const {
  const auto found = fields.find(name);
  return found == fields.end() ? "" : found->second;
}

RawClient::RawClient(std::uint16_t port, int receive_buffer_bytes, const char* from)
    : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
  const timeval timeout{10, 0};
  ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
  ::setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &timeout, sizeof timeout);
  if (receive_buffer_bytes > 0) {
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes, sizeof receive_buffer_bytes);
  }
  sockaddr_in address{};
  address.sin_family = AF_INET;
  ::inet_pton(AF_INET, from, &address.sin_addr);
  ::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    ::close(socket_);
    socket_ = -1;
  }
}

RawClient::~RawClient() {
  if (socket_ >= 0) ::close(socket_);
}

bool RawClient::Send(std::string_view bytes) {
  while (!bytes.empty()) {
    const auto sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(sent));
  }
  return true;
}

bool RawClient::Fill() {
  char bytes[65536];
  const auto got = ::recv(socket_, bytes, sizeof bytes, 0);
  if (got <= 0) return false;
  unread_.append(bytes, static_cast<std::size_t>(got));
  return true;
}

std::optional<Reply> RawClient::Read(bool head) {
  std::size_t end;
  while ((end = unread_.find("\r\n\r\n")) == std::string::npos) {
    if (Fill()) continue;
    if (unread_.empty()) return std::nullopt;
    Reply cut;
    cut.status = -1;
    return cut;
  }
  Reply reply;
  reply.version = unread_.substr(0, 8);
  reply.status = std::atoi(unread_.c_str() + 9);
  for (std::size_t line = unread_.find("\r\n") + 2; line < end + 2;) {
    const std::size_t next = unread_.find("\r\n", line), colon = unread_.find(':', line);
    std::string name = unread_.substr(line, colon - line);
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
    reply.fields[name] = unread_.substr(colon + 2, next - colon - 2);
    line = next + 2;
  }
  unread_.erase(0, end + 4);
  if (head || reply.status == 204 || reply.status == 304) return reply;
  const std::size_t length = std::strtoul(reply.Field("content-length").c_str(), nullptr, 10);
  while (unread_.size() < length) {
    if (Fill()) continue;
    reply.status = -1;
    return reply;
  }
  reply.body = unread_.substr(0, length);
  unread_.erase(0, length);
  return reply;
}

bool RawClient::Ended() {
  char byte;
  return unread_.empty() && ::recv(socket_, &byte, 1, 0) == 0;
}

std::size_t RawClient::TakeSome(std::size_t most) {
  std::string bytes(most, 0);
  const auto got = ::recv(socket_, bytes.data(), most, 0);
  return got > 0 ? static_cast<std::size_t>(got) : 0;
}

void RawClient::CloseOwnDirection() { ::shutdown(socket_, SHUT_WR); }

void RawClient::Close() { ::close(std::exchange(socket_, -1)); }

void RawClient::Reset() {
  const linger at_once{1, 0};
  ::setsockopt(socket_, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  ::close(socket_);
  socket_ = -1;
}

std::string Get(std::string_view target, std::string_view fields) {
  return "GET " + std::string(target) + " HTTP/1.1\r\nHost: localhost\r\n" + std::string(fields) + "\r\n";
}

Reply Fetch(std::uint16_t port, std::string_view target, std::string_view fields) {
  RawClient client(port);
  client.Send(Get(target, fields));
  return client.Read().value_or(Reply());
}

int StatusOf(std::uint16_t port, std::string_view request) {
  RawClient client(port);
  client.Send(request);
  return client.Read().value_or(Reply()).status;
}

}  // namespace terrace::server
