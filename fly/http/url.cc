#include "fly/http/url.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "engine/core/parse_number.h"

namespace terrace::fly {
namespace {

// The text of a URL without the values of its query that may be tokens.
std::string WithoutSecrets(std::string_view text) {
  constexpr std::size_t kSecretBytes = 16;  // tokens of the server are at least as long
  const std::size_t query = std::min(text.find('?'), text.size());
  std::string shown(text.substr(0, query));
  for (std::size_t at = query; at < text.size();) {
    const std::size_t end = std::min(text.find('&', at + 1), text.size());
    const std::size_t value = std::min(text.find('=', at), end - 1) + 1;
    const bool is_short = end - value < kSecretBytes;
    shown += text.substr(at, (is_short ? end : value) - at);
    if (!is_short) shown += "...";
    at = end;
  }
  return shown;
}

// "name=value" each, views of the target.
std::vector<std::string_view> ParametersOf(std::string_view target) {
  std::vector<std::string_view> parameters;
  for (std::size_t at = target.find('?'); at != std::string_view::npos;) {
    const std::size_t end = target.find('&', at + 1);
    parameters.push_back(target.substr(at + 1, end - at - 1));
    at = end;
  }
  return parameters;
}

std::string_view NameOfParameter(std::string_view parameter) { return parameter.substr(0, parameter.find('=')); }

}  // namespace

std::string Url::Text() const {
  const bool is_ipv6 = origin.host.find(':') != std::string::npos;
  const std::string host = is_ipv6 ? "[" + origin.host + "]" : origin.host;
  const bool is_default = origin.port == (origin.is_tls ? "443" : "80");
  return std::string(origin.is_tls ? "https://" : "http://") + host + (is_default ? "" : ":" + origin.port) + target;
}

std::string Url::PublicText() const { return Url{origin, WithoutSecrets(target)}.Text(); }

Result<Url> ParseUrl(std::string_view text) {
  const auto wrong = [text](std::string_view what) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: {}; give a URL such as http://127.0.0.1:8080/maui",
                     WithoutSecrets(text), what);
  };
  Url url;
  std::string_view rest = text;
  if (rest.starts_with("https://")) {
    url.origin.is_tls = true;
    rest.remove_prefix(8);
  } else if (rest.starts_with("http://")) {
    rest.remove_prefix(7);
  } else {
    return wrong("no http or https URL");
  }
  rest = rest.substr(0, rest.find('#'));
  const std::size_t slash = rest.find_first_of("/?");
  const std::string_view authority = rest.substr(0, slash);
  url.target = slash == std::string_view::npos ? "/" : std::string(rest.substr(slash));
  if (url.target.front() == '?') url.target.insert(0, "/");
  if (authority.find('@') != std::string_view::npos) return wrong("it contains a user; use --header for credentials");
  std::string_view host = authority.substr(0, authority.find(':'));
  std::string_view port = authority.substr(host.size());
  if (authority.starts_with("[")) {
    const std::size_t bracket = authority.find(']');
    if (bracket == std::string_view::npos) return wrong("the address is not closed by ]");
    host = authority.substr(1, bracket - 1);
    port = authority.substr(bracket + 1);
    if (!port.empty() && port.front() != ':') return wrong("something other than a port follows the ]");
  } else if (port.find(':', 1) != std::string_view::npos) {
    return wrong("the host contains a colon; an IPv6 address is in brackets, as in [::1]:8080");
  }
  url.origin.host = host;
  url.origin.port = url.origin.is_tls ? "443" : "80";
  if (port.size() > 1) {
    const std::string_view digits = port.substr(1);
    const auto number = ParseNumber<std::uint16_t>(digits);
    if (!number || *number == 0) return wrong(fmt::format("the port {} is no number from 1 to 65535", digits));
    url.origin.port = std::to_string(*number);
  }
  if (url.origin.host.empty()) return wrong("it names no host");
  const bool is_clean =
      std::none_of(url.target.begin(), url.target.end(), [](unsigned char c) { return c <= ' ' || c == 0x7f; });
  if (!is_clean) return wrong("it contains blanks or control characters");
  return url;
}

Result<Url> Resolve(const Url& base, std::string_view reference) {
  if (reference.starts_with("http://") || reference.starts_with("https://")) return ParseUrl(reference);
  if (reference.starts_with("//")) return ParseUrl((base.origin.is_tls ? "https:" : "http:") + std::string(reference));
  Url url = base;
  if (reference.starts_with("/")) {
    url.target = reference;
  } else {
    const std::string_view path = std::string_view(base.target).substr(0, base.target.find('?'));
    std::string folder(path.substr(0, path.rfind('/') + 1));
    while (reference.starts_with("./") || reference.starts_with("../")) {
      const bool is_up = reference[1] == '.';
      reference.remove_prefix(is_up ? 3 : 2);
      if (is_up && folder.size() > 1) folder.erase(folder.rfind('/', folder.size() - 2) + 1);
    }
    url.target = folder + std::string(reference);
  }
  return ParseUrl(url.Text());
}

Result<Url> ResolveWithQuery(const Url& base, std::string_view reference) {
  Result<Url> url = Resolve(base, reference);
  if (!url || url->origin != base.origin) return url;
  const std::string own = url->target;  // `known` refers to it
  const std::vector<std::string_view> known = ParametersOf(own);
  for (const std::string_view parameter : ParametersOf(base.target)) {
    const bool is_known = std::any_of(known.begin(), known.end(), [parameter](std::string_view other) {
      return NameOfParameter(other) == NameOfParameter(parameter);
    });
    if (is_known || parameter.empty()) continue;
    url->target += url->target.find('?') == std::string::npos ? '?' : '&';
    url->target += parameter;
  }
  return url;
}

}  // namespace terrace::fly
