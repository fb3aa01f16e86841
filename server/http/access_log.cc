#include "server/http/access_log.h"

#include <fmt/format.h>

#include <iterator>

namespace terrace::server {
namespace {

std::string Escaped(std::string_view text) {
  std::string escaped;
  for (const char c : text.substr(0, kMaxLoggedTargetBytes)) {
    if (c > 0x20 && c < 0x7f && c != '"' && c != '\\') {
      escaped += c;
    } else {
      fmt::format_to(std::back_inserter(escaped), "\\x{:02x}", static_cast<unsigned char>(c));
    }
  }
  if (text.size() > kMaxLoggedTargetBytes) escaped += "...";
  return escaped;
}

}  // namespace

std::string FormatAccessLine(const ReplyRecord& record) {
  std::string line =
      fmt::format("{} \"{}\" {} {} B {:.3f} ms cache={} id={} peer={}", Escaped(record.method), Escaped(record.target),
                  record.status, record.body_bytes, static_cast<double>(record.duration.count()) / 1000, record.cache,
                  record.request_id, record.peer);
  if (!record.client.empty()) line.append(" client=").append(record.client);
  if (!record.token_name.empty()) line.append(" token=").append(Escaped(record.token_name));
  return line;
}

}  // namespace terrace::server
