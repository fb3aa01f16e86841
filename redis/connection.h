// A connection to a Redis server: commands and checked replies, each with a deadline.
//
// hiredis writes the commands and parses the replies. The socket is our own: hiredis's time-outs count from the last
// byte, so that a peer that sends a byte now and then would hold a caller for ever, and Debian's hiredis has no TLS.
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "redis/address.h"
#include "redis/reply.h"
#include "redis/socket.h"

struct redisReader;

namespace terrace::redis {

struct ConnectionOptions {
  std::chrono::milliseconds connect_timeout{2000};  // including TLS and the password
  std::chrono::milliseconds command_timeout{2000};  // of a Call or CallAll: from the first byte out to the last in
  std::string ca_file = {};  // PEM; the certificates that may sign that of a rediss:// server; empty: the system's
  std::size_t max_reply_bytes = std::size_t{64} << 20;  // of a Call or CallAll
  std::stop_token stop = {};                            // once requested, calls end soon: Socket::Connect
};

// The name and the arguments; bytes, not text.
using Command = std::vector<std::string>;

// Used by one thread at a time, except Interrupt. No message contains user, password or an argument of a command.
class Connection {
 public:
  // Connects, authenticates, selects the database. kUnavailable: there is no server, or it is not a Redis.
  // kInvalidArgument: as Refusal, or ca_file cannot be read.
  static Result<std::unique_ptr<Connection>> Open(const Address& address, const ConnectionOptions& options);
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  ~Connection();

  // One reply for each command, in one round trip; a command that Redis refuses has a reply of kind kError.
  // kUnavailable: the connection broke, the deadline passed, or a reply was malformed. The commands may have been
  // carried out or not, and every later call fails: open another connection.
  Result<std::vector<Reply>> CallAll(std::span<const Command> commands);
  // Returns the reply if it is not an error. Errors: as CallAll; an error reply is converted by Refusal.
  Result<Reply> Call(const Command& command);
  // An error reply to a command as an Error. kInvalidArgument: what the user has to correct: the password, rights, the
  // database, a Redis in protected or cluster mode or too old, a key of another type. kOverloaded: Redis is full.
  // kUnavailable: it is loading, a read-only replica, or anything else.
  Error Refusal(const std::string& command, const ReplyView& error) const;

  bool is_open() const { return is_open_; }
  // Whether the connection cannot be used any more: a call failed, the server has closed it or sent something unasked.
  // A peer that vanished without closing it is not noticed.
  // Does not wait.
  bool HasEnded() { return !is_open_ || socket_.HasEnded(); }
  // From any thread: the current call and all later ones fail at once with kUnavailable.
  void Interrupt() const { socket_.Interrupt(); }

 private:
  Connection(Socket socket, const Address& address, const ConnectionOptions& options);
  // `replies`: those that came, also if the others did not.
  Result<void> CallAll(std::span<const Command> commands, Deadline deadline, std::vector<Reply>& replies);
  Result<void> Greet(const Address& address, Deadline deadline);
  Result<Reply> ReadReply(Deadline deadline, std::size_t& bytes_left);

  struct FreeReader {
    void operator()(redisReader* reader) const;
  };

  Socket socket_;
  const std::string name_;
  const ConnectionOptions options_;
  std::unique_ptr<redisReader, FreeReader> reader_;
  std::size_t elements_left_ = 0;  // of arrays, in the replies to a call
  bool is_open_ = true;
};

}  // namespace terrace::redis
