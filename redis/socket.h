// A TCP connection, with TLS or without. Every operation has a deadline.
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "redis/address.h"

struct ssl_ctx_st;
struct ssl_st;

namespace terrace::redis {

using Deadline = std::chrono::steady_clock::time_point;

// Used by one thread at a time. With TLS the program must ignore SIGPIPE.
class Socket {
 public:
  // `ca_file`: PEM; the certificates that may sign the server's; empty: those of the system. The deadline includes the
  // look-up of the host's name (Resolver). kUnavailable: no server listens, the deadline passed, or the certificate
  // does not fit; kInvalidArgument: the file.
  // After `stop` is requested, all waits for the peer together last at most kAfterStop, also if their deadline is
  // later.
  static Result<Socket> Connect(const Address& address, const std::string& ca_file, Deadline deadline,
                                const std::stop_token& stop = {});
  Socket(Socket&& other) noexcept;
  Socket& operator=(Socket&&) = delete;
  ~Socket();

  static constexpr std::chrono::milliseconds kAfterStop{2'000};

  // kUnavailable: the connection ended, or the deadline passed. The socket cannot be used afterwards.
  Result<void> Write(std::string_view bytes, Deadline deadline);
  // At least one byte.
  Result<std::size_t> Read(std::span<char> into, Deadline deadline);

  // Whether the peer has closed the connection, or has sent something without being asked. Does not wait.
  bool HasEnded();
  // From any thread: current and later waits for the peer fail.
  void Interrupt() const;

 private:
  Socket(int fd, std::string name, std::stop_token stop);
  Result<void> StartTls(const Address& address, const std::string& ca_file, Deadline deadline);
  Result<void> WaitFor(short events, Deadline deadline) const;
  // After an operation of TLS that returned `result`: waits until it can be repeated.
  Result<void> WaitForTls(int result, Deadline deadline) const;
  tl::unexpected<Error> Failed(std::string_view why) const;

  struct FreeTls {
    void operator()(ssl_ctx_st* context) const;
    void operator()(ssl_st* tls) const;
  };

  int fd_ = -1;
  std::stop_token stop_;
  mutable std::optional<Deadline> stop_end_;  // once a wait has seen that the stop is requested
  std::string name_;                          // the address for messages
  std::unique_ptr<ssl_ctx_st, FreeTls> context_;
  std::unique_ptr<ssl_st, FreeTls> tls_;
};

}  // namespace terrace::redis
