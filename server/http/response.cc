#include "server/http/response.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <utility>

#include "engine/core/check.h"
#include "server/http/status_text.h"
#include "server/http/text.h"

namespace terrace::server {
namespace {

void Put(std::string& head, std::string_view name, std::string_view value) {
  TERRACE_CHECK(std::none_of(value.begin(), value.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }));
  head.append(name).append(": ").append(value).append("\r\n");
}

void PutStatus(std::string& head, unsigned version, int status) {
  head.append(version == 10 ? "HTTP/1.0 " : "HTTP/1.1 ").append(fmt::format_int(status).c_str());
  head.append(" ").append(TextOfStatus(status).phrase).append("\r\n");
}

// The current Date header. Every thread caches the line of the last second.
void PutDate(std::string& head) {
  thread_local std::time_t second = 0;
  thread_local std::string line;
  if (const std::time_t now = std::time(nullptr); now != second) {
    second = now;
    line = fmt::format("Date: {:%a, %d %b %Y %H:%M:%S} GMT\r\n", fmt::gmtime(now));
  }
  head += line;
}

bool HasBody(int status) { return status != 204 && status != 304; }

// The header lines that describe the body.
void PutContent(std::string& head, const Response& response) {
  if (response.lines) {
    head += std::string_view(*response.lines).substr(HasBody(response.status) ? 0 : response.bytes_about_body);
    return;
  }
  if (HasBody(response.status)) {
    if (!response.content_type.empty()) Put(head, "Content-Type", response.content_type);
    if (!response.content_encoding.empty()) Put(head, "Content-Encoding", response.content_encoding);
    Put(head, "Content-Length", fmt::format_int(response.body ? response.body->size() : 0).c_str());
  }
  if (!response.etag.empty()) Put(head, "ETag", response.etag);
}

void PutCacheControl(std::string& head, const Response& response, bool is_private) {
  if (is_private) return Put(head, "Cache-Control", PrivateCacheControl(response.cache_control));
  if (!response.cache_control.empty()) Put(head, "Cache-Control", response.cache_control);
}

void PutVary(std::string& head, const Response& response, const CorsPolicy& cors) {
  std::string_view before = "Vary: ";
  const auto add = [&](std::string_view names) { head.append(std::exchange(before, ", ")).append(names); };
  if (!response.vary.empty()) add(response.vary);
  if (!response.vary_more.empty()) add(response.vary_more);
  if (response.depends_on_token) add("Authorization");
  if (cors.varies()) add("Origin");
  if (before == ", ") head += "\r\n";
}

}  // namespace

std::string PrivateCacheControl(std::string_view configured) {
  std::string directives;
  while (!configured.empty()) {
    const std::string_view directive = NextPiece(configured, ',');
    if (EqualsIgnoringCase(directive, "public") || EqualsIgnoringCase(directive, "private") || directive.empty()) {
      continue;
    }
    if (EqualsIgnoringCase(directive.substr(0, directive.find('=')), "s-maxage")) continue;
    directives.append(", ").append(directive);
  }
  return "private" + directives;
}

std::string SerializeHead(const Response& response, const HeadOptions& options) {
  static const CorsPolicy any_origin;
  const CorsPolicy& cors = options.cors ? *options.cors : any_origin;
  std::string head;
  head.reserve(1024);
  PutStatus(head, options.version, response.status);
  PutDate(head);
  PutContent(head, response);
  PutCacheControl(head, response, response.depends_on_token || options.is_private);
  PutVary(head, response, cors);
  head += response.literal_lines;
  for (const Response::Header& header : response.headers) Put(head, header.name, header.value);
  head += cors.HeadersFor(options.origin);
  head += "X-Content-Type-Options: nosniff\r\n";
  // RFC 9112, section 9.3: in HTTP/1.1 a connection stays open by default.
  if (!options.keep_alive) head += "Connection: close\r\n";
  if (options.keep_alive && options.version == 10) head += "Connection: keep-alive\r\n";
  head += "\r\n";
  return head;
}

std::string MethodsOf(bool takes_post) { return takes_post ? "GET, HEAD, OPTIONS, POST" : "GET, HEAD, OPTIONS"; }

Response PreflightResponse(bool takes_post) {
  Response response;
  response.status = 204;
  response.labels.route = "preflight";
  response.headers.emplace_back("Allow", MethodsOf(takes_post));
  response.headers.emplace_back("Access-Control-Allow-Methods", MethodsOf(takes_post));
  // "*" does not cover Authorization.
  response.headers.emplace_back("Access-Control-Allow-Headers", "*, Authorization");
  response.headers.emplace_back("Access-Control-Max-Age", "86400");
  return response;
}

Response Conditional(Response response, const Request& request) {
  if (response.status != 200 || response.etag.empty()) return response;
  if (!MatchesEtag(request.fields->if_none_match, response.etag)) return response;
  response.status = 304;
  response.body = nullptr;
  return response;
}

bool MatchesEtag(std::string_view if_none_match, std::string_view etag) {
  if (etag.empty()) return false;  // not even "*", because there is no representation
  std::string_view rest = Trim(if_none_match);
  if (rest == "*") return true;
  const auto skip_empty_elements = [&rest] {  // RFC 9110, section 5.6.1.2
    while (rest.starts_with(',')) rest = Trim(rest.substr(1));
  };
  skip_empty_elements();
  while (!rest.empty()) {
    if (rest.starts_with("W/")) rest.remove_prefix(2);
    if (!rest.starts_with('"')) return false;  // not a list of ETags: treated as absent
    const std::size_t close = rest.find('"', 1);
    if (close == std::string_view::npos) return false;
    if (rest.substr(0, close + 1) == etag) return true;
    rest = Trim(rest.substr(close + 1));
    if (!rest.empty() && rest.front() != ',') return false;
    skip_empty_elements();
  }
  return false;
}

bool NamesEtag(std::string_view if_none_match, std::string_view etag) {
  return Trim(if_none_match) != "*" && MatchesEtag(if_none_match, etag);
}

}  // namespace terrace::server
