#include "redis/connection.h"

#include <hiredis/hiredis.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <string_view>
#include <utility>

namespace terrace::redis {
namespace {

using Clock = std::chrono::steady_clock;

// hiredis allocates an array of the size that the peer claims before any element is there. Arrays may be nested. All
// elements of the replies to a call have at least kMinElementBytes, as "+\r\n" has.
constexpr int kMaxElements = 1'000'000;
constexpr std::size_t kMinElementBytes = 3;

void* CreateBoundedArray(const redisReadTask* task, int elements);

// hiredis's functions with a bounded array.
struct ReplyFunctions {
  redisReplyObjectFunctions of_hiredis{}, bounded{};

  ReplyFunctions() {
    redisReader* const reader = ::redisReaderCreate();
    if (reader != nullptr) of_hiredis = *reader->fn;
    ::redisReaderFree(reader);
    bounded = of_hiredis;
    bounded.createArray = CreateBoundedArray;
  }
  static ReplyFunctions& Get() {
    static ReplyFunctions functions;
    return functions;
  }
};

void* CreateBoundedArray(const redisReadTask* task, int elements) {
  auto& left = *static_cast<std::size_t*>(task->privdata);  // Connection::elements_left_
  if (elements > kMaxElements || static_cast<std::size_t>(std::max(elements, 0)) > left) return nullptr;
  left -= static_cast<std::size_t>(std::max(elements, 0));
  return ReplyFunctions::Get().of_hiredis.createArray(task, elements);
}

constexpr std::string_view kTooManyClients = "ERR max number of clients";

std::string Encoded(std::span<const Command> commands) {
  std::string bytes;
  for (const Command& command : commands) {
    std::vector<const char*> data;
    std::vector<std::size_t> sizes;
    for (const std::string& part : command) {
      data.push_back(part.data());
      sizes.push_back(part.size());
    }
    char* text = nullptr;
    const int size = ::redisFormatCommandArgv(&text, static_cast<int>(data.size()), data.data(), sizes.data());
    if (size > 0) bytes.append(text, static_cast<std::size_t>(size));
    std::free(text);
  }
  return bytes;
}

}  // namespace

void Connection::FreeReader::operator()(redisReader* reader) const { ::redisReaderFree(reader); }

Connection::Connection(Socket socket, const Address& address, const ConnectionOptions& options)
    : socket_(std::move(socket)),
      name_(address.Text()),
      options_(options),
      reader_(::redisReaderCreateWithFunctions(&ReplyFunctions::Get().bounded)) {
  if (reader_) reader_->privdata = &elements_left_;
}

Connection::~Connection() = default;

Result<std::unique_ptr<Connection>> Connection::Open(const Address& address, const ConnectionOptions& options) {
  const Deadline deadline = Clock::now() + options.connect_timeout;
  auto socket = Socket::Connect(address, options.ca_file, deadline, options.stop);
  if (!socket) return tl::unexpected(socket.error());
  std::unique_ptr<Connection> connection(new Connection(*std::move(socket), address, options));
  if (auto greeted = connection->Greet(address, deadline); !greeted) return tl::unexpected(greeted.error());
  return connection;
}

Result<void> Connection::Greet(const Address& address, Deadline deadline) {
  std::vector<Command> commands;
  if (!address.user.empty()) {
    commands.push_back({"AUTH", address.user, address.password});
  } else if (!address.password.empty()) {
    commands.push_back({"AUTH", address.password});
  }
  if (address.database != 0) commands.push_back({"SELECT", std::to_string(address.database)});
  commands.push_back({"PING"});
  std::vector<Reply> replies;
  const Result<void> done = CallAll(commands, deadline, replies);
  for (std::size_t i = 0; i < replies.size(); ++i) {  // a Redis without room for a client says so, and closes
    if (!replies[i].is_error()) continue;
    Error error = Refusal(commands[i].front(), replies[i]);
    const bool is_lasting = commands[i].front() != "PING" && replies[i].text().starts_with("ERR") &&
                            !replies[i].text().starts_with(kTooManyClients);
    if (is_lasting) error.code = ErrorCode::kInvalidArgument;
    return tl::unexpected(std::move(error));
  }
  if (!done) return done;
  if (replies.back().text() == "PONG") return {};
  return MakeError(ErrorCode::kUnavailable, "Redis at {}: what answers there is no Redis; correct the URL", name_);
}

Result<std::vector<Reply>> Connection::CallAll(std::span<const Command> commands) {
  std::vector<Reply> replies;
  if (auto done = CallAll(commands, Clock::now() + options_.command_timeout, replies); !done) {
    return tl::unexpected(done.error());
  }
  return replies;
}

Result<void> Connection::CallAll(std::span<const Command> commands, Deadline deadline, std::vector<Reply>& replies) {
  if (!is_open_ || !reader_) {
    return MakeError(ErrorCode::kUnavailable, "Redis at {}: the connection is broken", name_);
  }
  is_open_ = false;  // unless every reply comes
  if (auto written = socket_.Write(Encoded(commands), deadline); !written) return written;
  std::size_t bytes_left = options_.max_reply_bytes;
  elements_left_ = bytes_left / kMinElementBytes;
  while (replies.size() < commands.size()) {
    auto reply = ReadReply(deadline, bytes_left);
    if (!reply) return tl::unexpected(reply.error());
    replies.push_back(*std::move(reply));
  }
  is_open_ = true;
  return {};
}

Result<Reply> Connection::ReadReply(Deadline deadline, std::size_t& bytes_left) {
  std::array<char, 16384> buffer;  // NOLINT: written before it is read
  while (true) {
    void* reply = nullptr;
    if (::redisReaderGetReply(reader_.get(), &reply) != REDIS_OK) {
      return MakeError(ErrorCode::kUnavailable, "Redis at {}: what answers there does not speak Redis's protocol ({})",
                       name_, std::string_view(reader_->errstr));
    }
    if (reply != nullptr) return Reply(static_cast<redisReply*>(reply));
    const auto size = socket_.Read(buffer, deadline);
    if (!size) return tl::unexpected(size.error());
    if (*size > bytes_left) {
      return MakeError(ErrorCode::kUnavailable, "Redis at {}: a reply has more than {} bytes", name_,
                       options_.max_reply_bytes);
    }
    bytes_left -= *size;
    ::redisReaderFeed(reader_.get(), buffer.data(), *size);
  }
}

Result<Reply> Connection::Call(const Command& command) {
  auto replies = CallAll(std::span(&command, 1));
  if (!replies) return tl::unexpected(replies.error());
  if (replies->front().is_error()) return tl::unexpected(Refusal(command.front(), replies->front()));
  return std::move(replies->front());
}

Error Connection::Refusal(const std::string& command, const ReplyView& error) const {
  // The first word is the kind. The rest may repeat arguments of the command, which messages must not contain. Known
  // kinds are explained; for others the message has only the first word.
  const std::string_view text = error.text();
  const std::string_view kind = text.substr(0, text.find(' '));
  const auto starts = [&](std::string_view prefix) { return text.starts_with(prefix); };
  const auto make = [&](ErrorCode code, std::string_view why) {
    return Error{code, fmt::format("Redis at {}: {}", name_, why)};
  };
  if (kind == "WRONGPASS" || starts("ERR invalid password")) {
    return make(ErrorCode::kInvalidArgument, "refuses the user or the password; correct them");
  }
  if (starts("ERR AUTH") || starts("ERR Client sent AUTH")) {
    return make(ErrorCode::kInvalidArgument, "has no password, but one was given; leave it out");
  }
  if (kind == "DENIED") {
    return make(ErrorCode::kInvalidArgument,
                "is in protected mode, and answers its own machine only; give it a password (requirepass)");
  }
  if (kind == "LOADING") {
    return make(ErrorCode::kUnavailable, "is reading its data after a start; it will be ready soon");
  }
  if (starts(kTooManyClients)) {
    return make(ErrorCode::kUnavailable, "has as many clients as it may have (maxclients); raise that");
  }
  if (kind == "NOAUTH") return make(ErrorCode::kInvalidArgument, "wants a password; give one");
  if (kind == "NOPERM") {
    return make(ErrorCode::kInvalidArgument, fmt::format("the user may not use {} there; extend its ACL", command));
  }
  if (command == "SELECT") return make(ErrorCode::kInvalidArgument, "has no such database; correct the URL");
  if (kind == "OOM") {
    return make(ErrorCode::kOverloaded,
                "is full (maxmemory) and may not evict; raise maxmemory, or take another Redis");
  }
  if (kind == "READONLY") {
    return make(ErrorCode::kUnavailable, "is a read-only replica; give the URL of the primary");
  }
  if (kind == "MISCONF") {
    return make(ErrorCode::kUnavailable, "cannot save its data and refuses writes; look into its log");
  }
  if (starts("ERR unknown command")) {
    return make(ErrorCode::kInvalidArgument, fmt::format("does not know {}; it is too old, or no Redis", command));
  }
  if (kind == "MOVED" || kind == "ASK" || kind == "CLUSTERDOWN" || kind == "CROSSSLOT") {
    return make(ErrorCode::kInvalidArgument, "is a node of a cluster; take a Redis without cluster-enabled");
  }
  if (kind == "MASTERDOWN") {
    return make(ErrorCode::kUnavailable, "is a replica that has lost its primary; give the URL of the primary");
  }
  if (kind == "BUSY") return make(ErrorCode::kUnavailable, "is busy with somebody's script; look who uses it");
  if (kind == "WRONGTYPE") {
    return make(ErrorCode::kInvalidArgument, "the key belongs to something else; take another name or database");
  }
  // What is no Redis may send anything, of any length: a kind has capital letters.
  const std::size_t end = kind.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ");
  return make(ErrorCode::kUnavailable,
              fmt::format("refuses {} ({})", command, kind.substr(0, std::min<std::size_t>(end, 32))));
}

}  // namespace terrace::redis
