#include "redis/address.h"

#include <optional>

#include "engine/core/parse_number.h"

namespace terrace::redis {
namespace {

// Without a password: the shared cache takes none in its URL, and a queue better has it in a file.
constexpr const char* kForm = "redis://[user@]HOST:PORT/DATABASE, or rediss:// for TLS";

// Nothing: a percent sign without two hexadecimal digits.
std::optional<std::string> Decoded(std::string_view text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      decoded += text[i];
      continue;
    }
    const std::string_view digits = text.substr(i + 1, 2);
    const auto code = ParseNumber<unsigned>(digits, 16);
    if (digits.size() != 2 || !code) return std::nullopt;
    decoded += static_cast<char>(*code);
    i += 2;
  }
  return decoded;
}

}  // namespace

std::string Address::Text() const {
  const bool is_ipv6 = host.find(':') != std::string::npos;
  return fmt::format("{}://{}{}{}:{}/{}", is_tls ? "rediss" : "redis", is_ipv6 ? "[" : "", host, is_ipv6 ? "]" : "",
                     port, database);
}

Result<Address> ParseAddress(std::string_view url) {
  const auto wrong = [](std::string_view what) {
    return MakeError(ErrorCode::kInvalidArgument, "the URL of Redis {}; it must be {}", what, kForm);
  };
  Address address;
  if (url.starts_with("rediss://")) {
    address.is_tls = true;
    url.remove_prefix(9);
  } else if (url.starts_with("redis://")) {
    url.remove_prefix(8);
  } else {
    return wrong("does not begin with redis:// or rediss://");
  }
  // A password may contain "/" and "@" only as percent codes, but a stray "@" must not end in a message as a host.
  const std::size_t slash = url.find('/', url.find('@') == std::string_view::npos ? 0 : url.rfind('@'));
  const std::string_view path = slash == std::string_view::npos ? std::string_view() : url.substr(slash + 1);
  std::string_view host = url.substr(0, slash);
  if (const std::size_t at = host.rfind('@'); at != std::string_view::npos) {
    const std::string_view who = host.substr(0, at);
    host.remove_prefix(at + 1);
    const std::size_t colon = who.find(':');
    const auto user = Decoded(who.substr(0, colon));
    const auto password = colon == std::string_view::npos ? std::string() : Decoded(who.substr(colon + 1));
    if (!user || !password) return wrong("has a user or password with a percent sign that is no percent code");
    address.user = *user;
    address.password = *password;
  }
  std::string_view port;
  bool has_port = false;
  if (host.starts_with('[')) {
    const std::size_t end = host.find(']');
    const std::string_view rest = end == std::string_view::npos ? "x" : host.substr(end + 1);
    if (!rest.empty() && rest[0] != ':') return wrong("has an IPv6 address that does not end with \"]\"");
    has_port = !rest.empty();
    port = has_port ? rest.substr(1) : rest;
    host = host.substr(1, end - 1);
  } else if (const std::size_t colon = host.find(':'); colon != std::string_view::npos) {
    has_port = true;
    port = host.substr(colon + 1);
    host = host.substr(0, colon);
  }
  if (host.empty()) return wrong("has no host");
  address.host = host;
  if (has_port) {
    const auto number = ParseNumber<std::uint16_t>(port);
    if (!number || *number == 0) return wrong("has a port that is no number from 1 to 65535");
    address.port = *number;
  }
  if (!path.empty()) {
    constexpr int kMaxDatabase = 1'000'000;
    const auto number = ParseNumber<int>(path);
    if (!number || *number < 0 || *number > kMaxDatabase) return wrong("has a database that is no number");
    address.database = *number;
  }
  return address;
}

}  // namespace terrace::redis
