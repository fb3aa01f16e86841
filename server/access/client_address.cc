#include "server/access/client_address.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "server/http/text.h"

namespace terrace::server {
namespace {

using asio::ip::address;
using asio::ip::address_v6;

constexpr unsigned kMappedBits = 96;  // before the IPv4 part of ::ffff:a.b.c.d

address_v6::bytes_type BytesOf(const address& any) {
  return (any.is_v4() ? asio::ip::make_address_v6(asio::ip::v4_mapped, any.to_v4()) : any.to_v6()).to_bytes();
}

std::optional<address> ParseAddress(std::string_view text) {
  if (text.find('\0') != std::string_view::npos) return std::nullopt;
  boost::system::error_code error;
  const address parsed = asio::ip::make_address(std::string(text), error);
  if (error || (parsed.is_v6() && parsed.to_v6().scope_id() != 0)) return std::nullopt;
  return Canonical(parsed);
}

// "192.0.2.1", "192.0.2.1:4711", "[2001:db8::1]:4711", "2001:db8::1", any of them in quotes.
std::optional<address> ParseNode(std::string_view text) {
  text = Trim(text, " \t\"");
  if (text.starts_with('[')) return ParseAddress(text.substr(1, std::max<std::size_t>(text.find(']'), 1) - 1));
  const std::size_t colon = text.find(':');
  if (colon != std::string_view::npos && text.find(':', colon + 1) == std::string_view::npos) {
    text = text.substr(0, colon);
  }
  return ParseAddress(text);
}

// What one proxy reports: its client's address, and the requested scheme and host.
struct Hop {
  std::string_view node, host, scheme;
};

std::vector<std::string_view> Pieces(std::string_view list) {
  std::vector<std::string_view> pieces;
  while (!list.empty()) pieces.push_back(NextPiece(list, ','));
  return pieces;
}

std::string_view LastPiece(std::string_view list) {
  const std::vector<std::string_view> pieces = Pieces(list);
  return pieces.empty() ? std::string_view() : pieces.back();
}

// RFC 7239: for=192.0.2.60;proto=http;host=example.test, one element per proxy, the nearest one last.
Hop ParseForwarded(std::string_view element) {
  Hop hop;
  while (!element.empty()) {
    const std::string_view pair = NextPiece(element, ';');
    const std::size_t equals = pair.find('=');
    if (equals == std::string_view::npos) continue;
    const std::string_view name = Trim(pair.substr(0, equals)), value = Trim(pair.substr(equals + 1), " \t\"");
    if (EqualsIgnoringCase(name, "for")) hop.node = value;
    if (EqualsIgnoringCase(name, "host")) hop.host = value;
    if (EqualsIgnoringCase(name, "proto")) hop.scheme = value;
  }
  return hop;
}

std::vector<Hop> HopsOf(const Request& request, config::ForwardedHeader header) {
  std::vector<Hop> hops;
  if (header == config::ForwardedHeader::kForwarded) {
    for (const std::string_view element : Pieces(request.fields->forwarded)) hops.push_back(ParseForwarded(element));
    return hops;
  }
  for (const std::string_view node : Pieces(request.fields->forwarded_for)) hops.push_back({node, {}, {}});
  if (hops.empty()) hops.emplace_back();
  hops.back().host = LastPiece(request.fields->forwarded_host);
  hops.back().scheme = LastPiece(request.fields->forwarded_proto);
  return hops;
}

}  // namespace

std::string ClientBlock(const address& any) {
  const address plain = Canonical(any);
  if (plain.is_v4()) return plain.to_string();
  address_v6::bytes_type bytes = plain.to_v6().to_bytes();
  std::fill(bytes.begin() + 8, bytes.end(), std::uint8_t{0});
  return address_v6(bytes).to_string() + "/64";
}

Result<AddressRanges> AddressRanges::Parse(const std::vector<std::string>& texts) {
  AddressRanges ranges;
  for (const std::string& text : texts) {
    const std::size_t slash = text.find('/');
    const std::optional<address> base = ParseAddress(std::string_view(text).substr(0, slash));
    const unsigned most = base && base->is_v4() ? 32 : 128;
    std::optional<std::int64_t> bits = most;
    if (slash != std::string::npos) bits = PlainDecimal(std::string_view(text).substr(slash + 1), 3);
    // The length of an IPv4 range counts bits of IPv4.
    const bool is_mapped = base && base->is_v4() && text.find(':') != std::string::npos;
    if (!base || !bits || *bits > most || (is_mapped && slash != std::string::npos)) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "\"{}\" is no address or range of addresses; write one such as 10.0.0.0/8 or ::1", text);
    }
    ranges.ranges_.push_back({BytesOf(*base), static_cast<unsigned>(*bits) + (base->is_v4() ? kMappedBits : 0)});
  }
  return ranges;
}

bool AddressRanges::Contains(const address& any) const {
  const address_v6::bytes_type bytes = BytesOf(Canonical(any));
  return std::any_of(ranges_.begin(), ranges_.end(), [&](const Range& range) {
    const unsigned whole = range.bits / 8, rest = range.bits % 8;
    if (!std::equal(bytes.begin(), bytes.begin() + whole, range.bytes.begin())) return false;
    return rest == 0 || ((bytes[whole] ^ range.bytes[whole]) >> (8 - rest)) == 0;
  });
}

address ResolveClient(Request& request, const address& peer, const Proxies& proxies) {
  address client = Canonical(peer);
  if (!proxies.trusted.Contains(client)) return client;
  const SharedFields said = request.fields;  // the text that the hops refer to
  const std::vector<Hop> hops = HopsOf(request, proxies.header);
  if (hops.empty()) return client;
  // The scheme and host that the nearest proxy reports.
  if (IsHostValue(hops.back().host) && !hops.back().host.empty()) {
    request.fields.Set(&RequestFields::host, std::string(hops.back().host));
  }
  request.is_https = hops.back().scheme.empty() ? request.is_https : EqualsIgnoringCase(hops.back().scheme, "https");
  for (auto hop = hops.rbegin(); hop != hops.rend() && proxies.trusted.Contains(client); ++hop) {
    const std::optional<address> node = ParseNode(hop->node);
    if (!node)
      break;  // "unknown", an obfuscated name, or nonsense: the proxy that reported it is the last known address
    client = *node;
  }
  return client;
}

}  // namespace terrace::server
