// Sends the bytes of a connection in three pieces. However they are split, the server must read the same messages as a
// second, simple parser, and end. That parser finds only where messages end: if two parsers disagree on that, requests
// can be smuggled.
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "server/http/request_reader.h"
#include "server/http/text.h"
#include "tests/fuzz/fuzz_input.h"

namespace terrace::fuzz {
namespace {

using namespace server;
using asio::ip::tcp;

constexpr std::size_t kMaxBytes = 48 * 1024;  // fits into the buffers of a socket pair
constexpr std::size_t kMaxBody = 16 * 1024;

struct Seen {
  std::vector<Request> requests;
  int refused = 0;  // status; 0: the client closed
  bool done = false;
};

// Reads as a session does, without replies.
asio::awaitable<void> ReadAll(RequestReader& reader, Seen& seen) {
  for (bool more = true; more;) {
    Request request;
    const RequestReader::HeadOutcome head = co_await reader.ReadHead(request, Stream::Clock::now());
    if (!head) break;
    if (!*head) {
      seen.refused = head->error().status;
      break;
    }
    if (request.content_length > kMaxBody) {
      seen.refused = 413;
      break;
    }
    if (request.content_length > 0) {
      auto text = std::make_shared<std::string>();
      const auto body = co_await reader.ReadBody(request, *text, request.content_length);
      if (!body) {
        seen.refused = body.error().status;
        break;
      }
      request.body = RequestBody(std::move(text));
    }
    more = request.keep_alive;
    seen.requests.push_back(std::move(request));
  }
  seen.done = true;
}

void Poll(asio::io_context& io) {
  io.restart();
  while (io.poll() > 0) {
  }
}

void Send(int socket, std::string_view bytes) {
  TERRACE_CHECK(bytes.empty() || ::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT) > 0 ||
                errno == EPIPE);
}

Seen Converse(const std::array<std::string_view, 3>& pieces) {
  int ends[2];
  TERRACE_CHECK(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends) == 0);
  Seen seen;
  {
    asio::io_context io(1);
    tcp::socket socket(io);
    socket.assign(tcp::v4(), ends[0]);  // uses only operations that also work on a Unix socket
    Stream stream(std::move(socket), nullptr);
    RequestReader reader(stream, {});
    asio::co_spawn(io, ReadAll(reader, seen), asio::detached);
    for (const std::string_view piece : pieces) {
      Poll(io);
      if (!seen.done) Send(ends[1], piece);
    }
    ::shutdown(ends[1], SHUT_WR);
    Poll(io);
    TERRACE_CHECK(seen.done);  // the client has closed, so there is nothing to wait for
    stream.Close();
    Poll(io);
  }
  ::close(ends[1]);
  return seen;
}

// The end of the message at the beginning of `bytes`, by RFC 9112 and the rule that only a POST has a body. The server
// has accepted its head, so the head is complete.
std::size_t EndOfMessage(std::string_view bytes, const Request& request) {
  const std::size_t end = bytes.find("\r\n\r\n");
  TERRACE_CHECK(end != std::string_view::npos);
  std::string_view head = bytes.substr(0, end + 2);
  std::size_t length = 0;
  int lengths = 0;
  const std::string_view first = head.substr(0, head.find("\r\n"));
  TERRACE_CHECK(first.starts_with(request.method_name + " "));
  TERRACE_CHECK(first.ends_with(request.version == 11 ? " HTTP/1.1" : " HTTP/1.0"));
  for (head.remove_prefix(first.size() + 2); !head.empty();) {
    const std::string_view line = head.substr(0, head.find("\r\n"));
    head.remove_prefix(line.size() + 2);
    TERRACE_CHECK(line.find_first_of(std::string_view("\r\n\0", 3)) == std::string_view::npos);
    TERRACE_CHECK(!line.starts_with(' ') && !line.starts_with('\t'));
    const std::size_t colon = line.find(':');
    TERRACE_CHECK(colon != std::string_view::npos && colon > 0);
    const std::string_view name = line.substr(0, colon);
    TERRACE_CHECK(Trim(name) == name);  // "Content-Length : 5" is a field to some
    TERRACE_CHECK(!EqualsIgnoringCase(name, "transfer-encoding"));
    if (!EqualsIgnoringCase(name, "content-length")) continue;
    ++lengths;
    const std::string_view value = Trim(line.substr(colon + 1));
    TERRACE_CHECK(!value.empty() && value.find_first_not_of("0123456789") == std::string_view::npos);
    length = std::stoul(std::string(value));
  }
  TERRACE_CHECK(lengths <= 1);
  TERRACE_CHECK(length == request.content_length && length == request.body.size());
  TERRACE_CHECK(length == 0 || request.method == Method::kPost);
  return end + 4 + length;
}

// A connection remembers the header lines of its last request. The result must not depend on them.
void ExpectAsAlone(std::string_view head, const Request& request) {
  const auto alone = ParseHead(head);
  TERRACE_CHECK(alone.has_value());
  TERRACE_CHECK(alone->method == request.method && alone->method_name == request.method_name);
  TERRACE_CHECK(alone->version == request.version && alone->keep_alive == request.keep_alive);
  TERRACE_CHECK(alone->target == request.target);
  TERRACE_CHECK(alone->content_length == request.content_length && alone->expects_continue == request.expects_continue);
  TERRACE_CHECK(*alone->fields == *request.fields);
}

void ExpectOneReading(std::string_view bytes, const Seen& seen) {
  for (const Request& request : seen.requests) {
    while (bytes.starts_with("\r\n")) bytes.remove_prefix(2);
    const std::size_t end = EndOfMessage(bytes, request);
    ExpectAsAlone(bytes.substr(0, end - request.body.size()), request);
    TERRACE_CHECK(end <= bytes.size());
    TERRACE_CHECK(request.body == bytes.substr(end - request.body.size(), request.body.size()));
    bytes.remove_prefix(end);
    for (const unsigned char c : request.target) TERRACE_CHECK(c > 0x20 && c != 0x7f);
    TERRACE_CHECK(request.target.size() <= kMaxTargetBytes);
    TERRACE_CHECK(IsHostValue(request.fields->host));
  }
}

void ExpectSame(const Seen& a, const Seen& b) {
  TERRACE_CHECK(a.requests.size() == b.requests.size());
  // If a head has two errors, the one that is found first is reported, which depends on the split.
  TERRACE_CHECK((a.refused != 0) == (b.refused != 0));
  for (std::size_t i = 0; i < a.requests.size(); ++i) {
    const Request &x = a.requests[i], &y = b.requests[i];
    TERRACE_CHECK(x.method_name == y.method_name && x.target == y.target && x.body == y.body && *x.fields == *y.fields);
  }
}

void Run(FuzzInput& input) {
  std::size_t first = input.Take<std::uint16_t>(), second = input.Take<std::uint16_t>();
  const std::string_view bytes = input.rest().substr(0, kMaxBytes);
  first = std::min(first, bytes.size());
  second = std::min(second, bytes.size() - first);
  const Seen whole = Converse({bytes, {}, {}});
  ExpectOneReading(bytes, whole);
  TERRACE_CHECK(whole.refused == 0 || whole.refused == 400 || whole.refused == 413 || whole.refused == 414 ||
                whole.refused == 431);
  const Seen cut = Converse({bytes.substr(0, first), bytes.substr(first, second), bytes.substr(first + second)});
  ExpectSame(whole, cut);
}

}  // namespace
}  // namespace terrace::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  terrace::fuzz::FuzzInput input(data, size);
  terrace::fuzz::Run(input);
  return 0;
}
