#include "fly/http/http_client.h"

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/asio/strand.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>
#include <chrono>
#include <cstddef>
#include <exception>
#include <map>
#include <optional>
#include <thread>
#include <utility>

namespace terrace::fly {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using boost::system::error_code;
using Clock = std::chrono::steady_clock;
using TlsStream = beast::ssl_stream<beast::tcp_stream>;

constexpr std::uint64_t kMaxReplyBytes = std::uint64_t{64} << 20;
constexpr auto kAwait = asio::as_tuple(asio::use_awaitable);

struct Connection {
  beast::flat_buffer buffer;
  std::unique_ptr<beast::tcp_stream> plain;  // either this or `tls` is set
  std::unique_ptr<TlsStream> tls;

  beast::tcp_stream& lowest() { return plain ? *plain : tls->next_layer(); }
};

struct Call {
  int client = 0;
  Url url;
  std::string accept;
  int max_redirects = 0;
  std::function<void(HttpReply)> done;
  Clock::time_point start;
};

Failure FailureOf(const error_code& error) {
  if (error == beast::error::timeout) return Failure::kTimeout;
  if (error == http::error::body_limit) return Failure::kTooLarge;
  const bool is_cut = error == http::error::end_of_stream || error == http::error::partial_message ||
                      error.category() != http::make_error_code(http::error::end_of_stream).category();
  return is_cut ? Failure::kCut : Failure::kMalformed;
}

void Fail(HttpReply& reply, Failure failure, const error_code& error) {
  reply.failure = failure;
  reply.detail = error.message();
}

bool IsRedirect(int status) {
  return status == 301 || status == 302 || status == 303 || status == 307 || status == 308;
}

bool IsTlsError(const error_code& error, int reason) {
  const auto code = static_cast<unsigned long>(error.value());
  return error.category() == asio::error::get_ssl_category() && ERR_GET_LIB(code) == ERR_LIB_SSL &&
         ERR_GET_REASON(code) == reason;
}

}  // namespace

class HttpClient::Impl {
 public:
  explicit Impl(const HttpOptions& options)
      : options_(options),
        tls_(asio::ssl::context::tls_client),
        work_(io_.get_executor()),
        idle_(static_cast<std::size_t>(options.clients)) {
    for (int i = 0; i < options.clients; ++i) strands_.push_back(asio::make_strand(io_));
    tls_.set_default_verify_paths();
    tls_.set_verify_mode(options.verifies_certificates ? asio::ssl::verify_peer : asio::ssl::verify_none);
    for (int i = 0; i < options.threads; ++i) threads_.emplace_back([this] { io_.run(); });
  }

  ~Impl() {
    io_.stop();
    threads_.clear();  // joins; only then may the coroutines be destroyed
  }

  void Start(std::shared_ptr<Call> call) {
    const Strand& strand = strands_[static_cast<std::size_t>(call->client)];
    asio::co_spawn(strand, Run(std::move(call)), asio::detached);
  }

 private:
  using Strand = asio::strand<asio::io_context::executor_type>;
  using Idle = std::map<Origin, std::vector<std::unique_ptr<Connection>>>;

  std::chrono::nanoseconds timeout() const {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(options_.timeout_s));
  }

  std::unique_ptr<Connection> TakeIdle(int client, const Origin& origin) {
    auto& connections = idle_[static_cast<std::size_t>(client)][origin];
    if (connections.empty()) return nullptr;
    std::unique_ptr<Connection> connection = std::move(connections.back());
    connections.pop_back();
    return connection;
  }

  void PutIdle(int client, const Origin& origin, std::unique_ptr<Connection> connection) {
    idle_[static_cast<std::size_t>(client)][origin].push_back(std::move(connection));
  }

  // Null if there is no connection; then `reply` says why.
  asio::awaitable<std::unique_ptr<Connection>> Open(Origin origin, HttpReply& reply) {
    const asio::any_io_executor strand = co_await asio::this_coro::executor;
    asio::ip::tcp::resolver resolver(strand);
    auto [resolve_error, endpoints] = co_await resolver.async_resolve(origin.host, origin.port, kAwait);
    if (resolve_error) {
      Fail(reply, Failure::kConnect, resolve_error);
      co_return nullptr;
    }
    const Clock::time_point deadline = Clock::now() + timeout();
    std::unique_ptr<Connection> connection;
    error_code connect_error = asio::error::host_not_found;
    // Each address has its share of the time: one that does not answer, as of an IPv6 network without a route, does not
    // hide the next one.
    for (const auto& entry : endpoints) {
      connection = std::make_unique<Connection>();
      if (origin.is_tls) {
        connection->tls = std::make_unique<TlsStream>(strand, tls_);
      } else {
        connection->plain = std::make_unique<beast::tcp_stream>(strand);
      }
      connection->lowest().expires_after(timeout() / endpoints.size());
      auto [error] = co_await connection->lowest().async_connect(entry.endpoint(), kAwait);
      connect_error = error;
      if (!error) break;
    }
    if (connect_error) {
      Fail(reply, connect_error == beast::error::timeout ? Failure::kTimeout : Failure::kConnect, connect_error);
      co_return nullptr;
    }
    error_code ignored;
    connection->lowest().socket().set_option(asio::ip::tcp::no_delay(true), ignored);
    if (connection->tls) {
      SSL_set_tlsext_host_name(connection->tls->native_handle(), origin.host.c_str());
      if (options_.verifies_certificates) {
        connection->tls->set_verify_callback(asio::ssl::host_name_verification(origin.host));
      }
      connection->lowest().expires_at(deadline);
      auto [tls_error] = co_await connection->tls->async_handshake(asio::ssl::stream_base::client, kAwait);
      if (tls_error) {
        if (IsTlsError(tls_error, SSL_R_CERTIFICATE_VERIFY_FAILED)) {
          Fail(reply, Failure::kUntrusted, tls_error);
          reply.detail +=
              "; if the host is right, let SSL_CERT_FILE name a file with its certificate, or accept every certificate "
              "with --insecure";
        } else {
          Fail(reply, Failure::kConnect, tls_error);
          // OpenSSL takes the first bytes of "HTTP/1.1 400" for a version.
          if (IsTlsError(tls_error, SSL_R_WRONG_VERSION_NUMBER)) {
            reply.detail += "; if the server speaks plain HTTP on this port, use http://";
          }
        }
        co_return nullptr;
      }
    }
    co_return connection;
  }

  http::request<http::empty_body> MakeRequest(const Call& call) const {
    http::request<http::empty_body> request(http::verb::get, call.url.target, 11);
    const Url bare{call.url.origin, ""};
    const std::string text = bare.Text();
    request.set(http::field::host, text.substr(text.find("//") + 2));
    request.set(http::field::user_agent, "terrace-fly");
    request.set(http::field::accept, call.accept);
    request.set(http::field::accept_encoding, "gzip");
    if (call.url.origin != options_.headers_origin) return request;
    for (const auto& header : options_.headers) request.erase(header.first);
    for (const auto& header : options_.headers) request.insert(header.first, header.second);
    return request;
  }

  // Returns whether the connection can be used again. `answered`: whether any byte of a reply came.
  template <typename Stream>
  asio::awaitable<bool> Exchange(Stream& stream, Connection& connection, const Call& call, HttpReply& reply,
                                 bool& answered) {
    const http::request<http::empty_body> request = MakeRequest(call);
    connection.lowest().expires_after(timeout());
    auto [write_error, written] = co_await http::async_write(stream, request, kAwait);
    if (write_error) {
      Fail(reply, FailureOf(write_error), write_error);
      co_return false;
    }
    std::optional<http::response_parser<http::string_body>> parser;
    // Any number of informational replies, such as 103 Early Hints, precede the final one (RFC 9110, 15.2). 101 is
    // final.
    do {
      parser.emplace();
      parser->body_limit(kMaxReplyBytes);
      auto [read_error, read] = co_await http::async_read(stream, connection.buffer, *parser, kAwait);
      answered |= parser->got_some();
      reply.bytes += read;
      if (read_error) {
        Fail(reply, FailureOf(read_error), read_error);
        co_return false;
      }
      reply.status = static_cast<int>(parser->get().result_int());
    } while (reply.status / 100 == 1 && reply.status != 101);
    auto& message = parser->get();
    reply.is_gzip = message[http::field::content_encoding] == "gzip";
    reply.server_timing = std::string(message["Server-Timing"]);
    reply.retry_after = std::string(message[http::field::retry_after]);
    reply.date = std::string(message[http::field::date]);
    if (const std::string to(message[http::field::location]); IsRedirect(reply.status) && !to.empty()) {
      if (Result<Url> url = Resolve(call.url, to)) reply.location = *std::move(url);
    }
    reply.cache_control = std::string(message[http::field::cache_control]);
    reply.max_error = std::string(message["Terrain-Max-Error"]);
    // Bytes after the reply would be taken for the next one.
    const bool keeps = message.keep_alive() && connection.buffer.size() == 0;
    reply.body = std::move(message.body());
    co_return keeps;
  }

  asio::awaitable<HttpReply> Fetch(std::shared_ptr<Call> call) {
    for (;;) {
      HttpReply reply;
      std::unique_ptr<Connection> connection = TakeIdle(call->client, call->url.origin);
      const bool is_reused = connection != nullptr;
      if (!connection) {
        connection = co_await Open(call->url.origin, reply);
        if (!connection) co_return reply;
        reply.opened_connection = true;
      }
      bool answered = false, keeps = false;
      if (connection->tls) {
        keeps = co_await Exchange(*connection->tls, *connection, *call, reply, answered);
      } else {
        keeps = co_await Exchange(*connection->plain, *connection, *call, reply, answered);
      }
      // The server closed an idle connection and has not seen the request: repeat it on another one.
      if (is_reused && reply.failure == Failure::kCut && !answered) continue;
      if (keeps) {
        connection->lowest().expires_never();
        PutIdle(call->client, call->url.origin, std::move(connection));
      }
      co_return reply;
    }
  }

  asio::awaitable<void> Run(std::shared_ptr<Call> call) {
    HttpReply reply;
    try {
      reply = co_await Fetch(call);
      for (int hops = 0; hops < call->max_redirects && reply.location; ++hops) {
        call->url = *reply.location;
        const std::uint64_t bytes = reply.bytes;
        const bool opened_connection = reply.opened_connection;
        reply = co_await Fetch(call);
        reply.bytes += bytes;
        reply.opened_connection |= opened_connection;
      }
    } catch (const std::exception& error) {
      reply.failure = Failure::kMalformed;
      reply.detail = error.what();
    }
    reply.seconds = std::chrono::duration<double>(Clock::now() - call->start).count();
    call->done(std::move(reply));
  }

  const HttpOptions options_;
  asio::ssl::context tls_;
  // Declared before the members that use it: connections and coroutines are destroyed first.
  asio::io_context io_;
  asio::executor_work_guard<asio::io_context::executor_type> work_;
  // One for each client. Its coroutines and the timers of its streams run there: on several threads a timeout could
  // race with the end of a read, and look like a cut. A client's idle connections are used on its strand alone.
  std::vector<Strand> strands_;
  std::vector<Idle> idle_;
  std::vector<std::jthread> threads_;
};

HttpClient::HttpClient(const HttpOptions& options) : impl_(std::make_unique<Impl>(options)) {}
HttpClient::~HttpClient() = default;

void HttpClient::Get(int client, Url url, std::string accept, int max_redirects, std::function<void(HttpReply)> done) {
  auto call = std::make_shared<Call>();
  call->client = client;
  call->url = std::move(url);
  call->accept = std::move(accept);
  call->max_redirects = max_redirects;
  call->done = std::move(done);
  call->start = Clock::now();
  impl_->Start(std::move(call));
}

}  // namespace terrace::fly
