#include "redis/socket.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstddef>
#include <utility>

#include "engine/core/errno_text.h"
#include "redis/resolver.h"

namespace terrace::redis {
namespace {

using Clock = std::chrono::steady_clock;

int FamilyOf(const HostAddress& address) {
  sa_family_t family = AF_UNSPEC;
  address.copy(reinterpret_cast<char*>(&family), sizeof family, offsetof(sockaddr, sa_family));
  return family;
}

// The oldest error of OpenSSL in this thread; empties its list.
std::string TlsError() {
  const unsigned long code = ::ERR_get_error();
  ::ERR_clear_error();
  const char* const reason = code == 0 ? nullptr : ::ERR_reason_error_string(code);
  return reason == nullptr ? "the connection ended" : reason;
}

}  // namespace

void Socket::FreeTls::operator()(ssl_ctx_st* context) const { ::SSL_CTX_free(context); }
void Socket::FreeTls::operator()(ssl_st* tls) const { ::SSL_free(tls); }

Socket::Socket(int fd, std::string name, std::stop_token stop)
    : fd_(fd), stop_(std::move(stop)), name_(std::move(name)) {}

Socket::Socket(Socket&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)),
      stop_(std::move(other.stop_)),
      stop_end_(other.stop_end_),
      name_(std::move(other.name_)),
      context_(std::move(other.context_)),
      tls_(std::move(other.tls_)) {}

Socket::~Socket() {
  tls_ = nullptr;
  if (fd_ >= 0) ::close(fd_);
}

tl::unexpected<Error> Socket::Failed(std::string_view why) const {
  return MakeError(ErrorCode::kUnavailable, "Redis at {}: {}", name_, why);
}

Result<Socket> Socket::Connect(const Address& address, const std::string& ca_file, Deadline deadline,
                               const std::stop_token& stop) {
  const std::string name = address.Text();
  if (stop.stop_requested()) deadline = std::min(deadline, Clock::now() + kAfterStop);
  const auto found = Resolver::OfSystem().Resolve(address.host, address.port, deadline);
  if (!found) return MakeError(ErrorCode::kUnavailable, "Redis at {}: {}", name, found.error().message);
  std::string why = "the host has no address";
  auto left = static_cast<int>(found->size());
  for (auto one = found->begin(); one != found->end(); ++one, --left) {
    // An address that does not answer leaves time for the others.
    const Deadline now = std::chrono::steady_clock::now();
    const Deadline share = now + (deadline - now) / left;
    const int fd = ::socket(FamilyOf(*one), SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) {
      why = ErrorText();
      continue;
    }
    Socket socket(fd, name, stop);
    const int on = 1;
    ::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    int error = ::connect(fd, reinterpret_cast<const sockaddr*>(one->data()), static_cast<socklen_t>(one->size())) == 0
                    ? 0
                    : errno;
    if (error == EINPROGRESS) {
      if (const auto waited = socket.WaitFor(POLLOUT, share); !waited) {
        why = "does not answer";
        continue;
      }
      socklen_t size = sizeof error;
      ::getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size);
    }
    if (error != 0) {
      why = ErrorText(error);
      continue;
    }
    if (address.is_tls) {
      if (auto started = socket.StartTls(address, ca_file, deadline); !started) return tl::unexpected(started.error());
    }
    return socket;
  }
  return MakeError(ErrorCode::kUnavailable, "Redis at {}: cannot be reached: {}; start it, or correct the URL", name,
                   why);
}

Result<void> Socket::StartTls(const Address& address, const std::string& ca_file, Deadline deadline) {
  ::ERR_clear_error();
  context_.reset(::SSL_CTX_new(::TLS_client_method()));
  if (!context_) return Failed(TlsError());
  ::SSL_CTX_set_min_proto_version(context_.get(), TLS1_2_VERSION);
  ::SSL_CTX_set_verify(context_.get(), SSL_VERIFY_PEER, nullptr);
  const bool loaded = ca_file.empty() ? ::SSL_CTX_set_default_verify_paths(context_.get()) == 1
                                      : ::SSL_CTX_load_verify_file(context_.get(), ca_file.c_str()) == 1;
  if (!loaded) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: cannot be used as certificates for Redis ({}); it must be PEM",
                     ca_file, TlsError());
  }
  tls_.reset(::SSL_new(context_.get()));
  if (!tls_) return Failed(TlsError());
  // A certificate names hosts or addresses; only names are sent in the greeting.
  if (::X509_VERIFY_PARAM_set1_ip_asc(::SSL_get0_param(tls_.get()), address.host.c_str()) != 1) {
    ::SSL_set1_host(tls_.get(), address.host.c_str());
    ::SSL_set_tlsext_host_name(tls_.get(), address.host.c_str());
  }
  ::SSL_set_mode(tls_.get(), SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
  if (::SSL_set_fd(tls_.get(), fd_) != 1) return Failed(TlsError());
  while (true) {
    ::ERR_clear_error();
    const int result = ::SSL_connect(tls_.get());
    if (result == 1) return {};
    const long verified = ::SSL_get_verify_result(tls_.get());
    if (verified != X509_V_OK) {
      return Failed(fmt::format("its certificate is not trusted: {}; name the certificate of its authority",
                                ::X509_verify_cert_error_string(verified)));
    }
    if (auto waited = WaitForTls(result, deadline); !waited) {
      return Failed(fmt::format("TLS could not be agreed on ({}); is it a TLS port?", waited.error().message));
    }
  }
}

Result<void> Socket::WaitFor(short events, Deadline deadline) const {
  constexpr long long kLookAgain = 100;  // ms; whether the stop is requested
  while (true) {
    const auto now = Clock::now();
    if (!stop_end_ && stop_.stop_requested()) stop_end_ = now + kAfterStop;
    const Deadline end = stop_end_ ? std::min(deadline, *stop_end_) : deadline;
    long long left = std::chrono::ceil<std::chrono::milliseconds>(end - now).count();
    if (left <= 0) return Failed("did not reply in time; it is overloaded, stopped, or the network is slow");
    if (!stop_end_ && stop_.stop_possible()) left = std::min(left, kLookAgain);
    pollfd wait{fd_, events, 0};
    const int ready = ::poll(&wait, 1, static_cast<int>(std::min<long long>(left, INT_MAX)));
    if (ready > 0) return {};
    if (ready < 0 && errno != EINTR) return Failed(ErrorText());
  }
}

Result<void> Socket::WaitForTls(int result, Deadline deadline) const {
  switch (::SSL_get_error(tls_.get(), result)) {
    case SSL_ERROR_WANT_READ:
      return WaitFor(POLLIN, deadline);
    case SSL_ERROR_WANT_WRITE:
      return WaitFor(POLLOUT, deadline);
    case SSL_ERROR_ZERO_RETURN:
      return Failed("closed the connection");
    default:
      return Failed(TlsError());
  }
}

Result<void> Socket::Write(std::string_view bytes, Deadline deadline) {
  while (!bytes.empty()) {
    if (tls_) {
      ::ERR_clear_error();
      const int written =
          ::SSL_write(tls_.get(), bytes.data(), static_cast<int>(std::min<std::size_t>(bytes.size(), INT_MAX)));
      if (written > 0) {
        bytes.remove_prefix(static_cast<std::size_t>(written));
      } else if (auto waited = WaitForTls(written, deadline); !waited) {
        return waited;
      }
      continue;
    }
    const ssize_t written = ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (written >= 0) {
      bytes.remove_prefix(static_cast<std::size_t>(written));
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      if (auto waited = WaitFor(POLLOUT, deadline); !waited) return waited;
    } else if (errno != EINTR) {
      return Failed(ErrorText());
    }
  }
  return {};
}

Result<std::size_t> Socket::Read(std::span<char> into, Deadline deadline) {
  while (true) {
    if (tls_) {
      ::ERR_clear_error();
      const int size = ::SSL_read(tls_.get(), into.data(), static_cast<int>(into.size()));
      if (size > 0) return static_cast<std::size_t>(size);
      if (auto waited = WaitForTls(size, deadline); !waited) return tl::unexpected(waited.error());
      continue;
    }
    const ssize_t size = ::recv(fd_, into.data(), into.size(), 0);
    if (size > 0) return static_cast<std::size_t>(size);
    if (size == 0) return Failed("closed the connection");
    if (errno == EAGAIN || errno == EWOULDBLOCK) {
      if (auto waited = WaitFor(POLLIN, deadline); !waited) return tl::unexpected(waited.error());
    } else if (errno != EINTR) {
      return Failed(ErrorText());
    }
  }
}

bool Socket::HasEnded() {
  char byte = 0;
  if (tls_) {  // which may have news of its own to read
    ::ERR_clear_error();
    const int size = ::SSL_peek(tls_.get(), &byte, 1);
    return size > 0 || ::SSL_get_error(tls_.get(), size) != SSL_ERROR_WANT_READ;
  }
  const ssize_t size = ::recv(fd_, &byte, 1, MSG_PEEK | MSG_DONTWAIT);
  return size >= 0 || (errno != EAGAIN && errno != EWOULDBLOCK);
}

void Socket::Interrupt() const { ::shutdown(fd_, SHUT_RDWR); }

}  // namespace terrace::redis
