#include "server/http/request_reader.h"

#include <algorithm>
#include <utility>

namespace terrace::server {
namespace {

constexpr std::size_t kReadBytes = 4096;
constexpr std::string_view kContinue = "HTTP/1.1 100 Continue\r\n\r\n";

BadRequest TooSlow() { return BadRequest{408, "the request did not arrive in time"}; }
BadRequest Gone() { return BadRequest{0, ""}; }

}  // namespace

RequestReader::RequestReader(Stream& stream, ReadTimeouts timeouts) : stream_(stream), timeouts_(timeouts) {}

void RequestReader::EndSoon(Stream::Clock::time_point close_at) {
  is_ending_ = true;
  close_at_ = std::min(close_at_, close_at);
  if (waiting_) stream_.ExpiresAt(std::min(stream_.deadline(), close_at_));
}

asio::awaitable<RequestReader::HeadOutcome> RequestReader::ReadHead(Request& request, Stream::Clock::time_point now) {
  const auto refused = [&](BadRequest why) {
    request = RefusedRequestOf(Unread());
    return HeadOutcome(tl::unexpected(why));
  };
  // RFC 9112, section 2.2: empty lines before a request are ignored. They do not begin a request.
  const auto skip_empty_lines = [&] {
    while (Unread().starts_with("\r\n")) Consume(2);
  };
  skip_empty_lines();
  std::size_t scanned = 0;
  bool begun = !Unread().empty();
  const auto timeout = now + (begun || is_first_ ? timeouts_.message : timeouts_.idle);
  stream_.ExpiresAt(begun ? timeout : std::min(timeout, close_at_));
  is_first_ = false;
  for (;;) {
    skip_empty_lines();
    if (const std::size_t size = TakeRepeated(Unread(), memo_, request)) {
      Consume(size);
      co_return HeadOutcome(std::in_place);
    }
    if (!Unread().empty()) {
      const auto end = FindHeadEnd(Unread(), scanned);
      if (!end) co_return refused(end.error());
      if (*end > 0) {
        tl::expected<Request, BadRequest> parsed = ParseHead(Unread().substr(0, *end), &memo_);
        if (!parsed) co_return refused(parsed.error());
        Consume(*end);
        request = *std::move(parsed);
        co_return HeadOutcome(std::in_place);
      }
      scanned = Unread().size();
      if (!begun) stream_.ExpiresAfter(timeouts_.message);
      begun = true;
    }
    if (!begun && Stream::Clock::now() >= close_at_) {
      if (!FillWithWhatArrived()) co_return std::nullopt;
      continue;
    }

    waiting_ = !begun;
    const Transfer got = co_await stream_.ReadSome(Room(std::min(kReadBytes, kMaxHeadBytes - Unread().size())));
    end_ += got.value_or(0);
    waiting_ = false;
    if (got) continue;
    if (stream_.expired() && begun) co_return refused(TooSlow());
    if (!stream_.expired() || !stream_.socket().is_open()) co_return std::nullopt;
    EndSoon();  // the wait is over, but a request may have arrived at the same time
  }
}

// A buffer for `bytes` bytes after the unread ones.
asio::mutable_buffer RequestReader::Room(std::size_t bytes) {
  std::copy(buffer_.begin() + begin_, buffer_.begin() + end_, buffer_.begin());
  end_ -= std::exchange(begin_, 0);
  if (buffer_.size() < end_ + bytes) buffer_.resize(end_ + bytes);
  return asio::buffer(buffer_.data() + end_, bytes);
}

asio::awaitable<Transfer> RequestReader::Fill(std::size_t room) {
  const Transfer got = co_await stream_.ReadSome(Room(room));
  end_ += got.value_or(0);
  co_return got;
}

// Returns false if no bytes had arrived.
bool RequestReader::FillWithWhatArrived() {
  const std::size_t got = stream_.ReadReady(Room(kMaxHeadBytes - Unread().size())).value_or(0);
  end_ += got;
  return got > 0;
}

asio::awaitable<tl::expected<void, BadRequest>> RequestReader::ReadBody(const Request& request, std::string& text,
                                                                        std::size_t size) {
  const auto begun = Stream::Clock::now();
  stream_.ExpiresAfter(timeouts_.message);
  if (request.expects_continue && text.empty() && Unread().empty()) {
    BufferPair interim = {asio::buffer(kContinue), asio::const_buffer()};
    Skip(stream_.TakeBytesSentAhead(), interim);
    const Transfer sent = co_await stream_.WriteSome(interim);
    if (!sent) co_return tl::unexpected(Gone());
  }
  for (std::size_t arrived = 0;;) {
    const std::string_view here = Unread().substr(0, size - text.size());
    text.append(here);
    Consume(here.size());
    if (text.size() == size) co_return tl::expected<void, BadRequest>();
    const Transfer got = co_await Fill(std::min(size - text.size(), kMaxHeadBytes));
    if (!got) co_return tl::unexpected(stream_.expired() ? TooSlow() : Gone());
    arrived += *got;
    auto deadline = Stream::Clock::now() + timeouts_.message;
    if (timeouts_.min_rate > 0) {
      const std::chrono::milliseconds earned(arrived * 1000 / timeouts_.min_rate);
      deadline = std::min(deadline, begun + timeouts_.message + earned);
    }
    stream_.ExpiresAt(deadline);
  }
}

asio::awaitable<void> RequestReader::Discard(std::size_t max_bytes) {
  for (std::size_t taken = 0; taken < max_bytes;) {
    Consume(Unread().size());
    const Transfer got = co_await Fill(kReadBytes);
    if (!got) break;
    taken += *got;
  }
}

}  // namespace terrace::server
