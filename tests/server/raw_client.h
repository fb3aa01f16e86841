// A client for tests that sends exactly the given bytes and reads replies as they come.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace terrace::server {

struct Reply {
  std::string version;  // "HTTP/1.1"
  int status = 0;
  std::map<std::string, std::string> fields;  // names in lower case
  std::string body;

  // Empty if there is no such field.
  std::string Field(const std::string& name) const;
};

class RawClient {
 public:
  // `from`: the loopback address it connects from.
  explicit RawClient(std::uint16_t port, int receive_buffer_bytes = 0, const char* from = "127.0.0.1");
  ~RawClient();
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  // False: the server has closed the connection.
  bool Send(std::string_view bytes);

  // The next reply. `head`: replies have no body, whatever their Content-Length. Nothing: the connection ended before a
  // reply began, or ten seconds passed. A truncated reply has status -1.
  std::optional<Reply> Read(bool head = false);

  // True if the server closes within ten seconds without sending more bytes.
  bool Ended();

  // The bytes that have arrived, at most `most`; 0 if the connection has ended.
  std::size_t TakeSome(std::size_t most);

  void CloseOwnDirection();
  void Close();
  void Reset();  // the kernel informs the server immediately

 private:
  bool Fill();

  int socket_;
  std::string unread_;
};

// "GET {target} HTTP/1.1" with a Host and the extra fields ("Name: value\r\n").
std::string Get(std::string_view target, std::string_view fields = "");

// One request on a new connection.
Reply Fetch(std::uint16_t port, std::string_view target, std::string_view fields = "");

// The status of the reply to exactly these bytes on a new connection; 0: there is none.
int StatusOf(std::uint16_t port, std::string_view request);

}  // namespace terrace::server
