#include <arpa/inet.h>

#include <algorithm>
#include <filesystem>
#include <string_view>

#include "config/common/token_hash.h"
#include "config/options/option_table.h"
#include "engine/core/ascii.h"
#include "engine/core/parse_number.h"

namespace terrace::config {
namespace {

constexpr std::size_t kMaxTokenBytes = 256, kHashDigits = 64;
constexpr double kMaxRequests = 1e6;

bool IsAlphanumeric(char c) { return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'); }

bool ConsistsOf(std::string_view text, std::string_view others) {
  return std::all_of(text.begin(), text.end(),
                     [&](char c) { return IsAlphanumeric(c) || others.find(c) != std::string_view::npos; });
}

// RFC 6750 lets a Bearer token have these characters.
std::string CheckToken(const std::string& text) {
  const bool fits = text.size() >= kMinTokenBytes && text.size() <= kMaxTokenBytes;
  if (fits && ConsistsOf(text, "-._~+/=")) return {};
  return fmt::format("must be {} to {} letters, digits or any of -._~+/=; openssl rand -hex 24 makes one",
                     kMinTokenBytes, kMaxTokenBytes);
}

std::string CheckHash(const std::string& text) {
  const bool is_hex = text.find_first_not_of("0123456789abcdefABCDEF") == std::string::npos;
  return text.size() == kHashDigits && is_hex ? "" : "must be 64 hexadecimal digits, as sha256sum prints them";
}

std::string CheckTokenName(const std::string& text) {
  const bool fits = !text.empty() && text.size() <= 64 && ConsistsOf(text, "-._");
  return fits ? "" : "must be 1 to 64 letters, digits, '.', '_' or '-'; the log shows it instead of the token";
}

// The value goes into a response header as it is.
std::string CheckOrigin(const std::string& text) {
  if (text == "*") return {};
  for (const std::string_view scheme : {"https://", "http://"}) {
    if (!text.starts_with(scheme)) continue;
    const std::string_view host = std::string_view(text).substr(scheme.size());
    if (!host.empty() && host.size() <= 255 && ConsistsOf(host, "-.:[]")) return {};
  }
  return "must be \"*\" or what browsers send as Origin, such as \"https://maps.example\" or "
         "\"http://localhost:3000\", "
         "without a path";
}

// Browsers send origins in lower case and without the default port of the scheme (RFC 6454, section 6.2).
std::string AsBrowsersSend(std::string origin) {
  std::ranges::transform(origin, origin.begin(), ToLower);
  const std::string_view default_port = origin.starts_with("https:") ? ":443" : ":80";
  if (origin.ends_with(default_port)) origin.resize(origin.size() - default_port.size());
  return origin;
}

std::string CheckRange(const std::string& text) {
  const std::size_t slash = std::min(text.find('/'), text.size());
  const std::string base = text.substr(0, slash);
  in6_addr address{};  // has room for either kind
  const bool is_v4 = ::inet_pton(AF_INET, base.c_str(), &address) == 1;
  const bool is_v6 = !is_v4 && ::inet_pton(AF_INET6, base.c_str(), &address) == 1;
  if (is_v6 && slash < text.size() && IN6_IS_ADDR_V4MAPPED(&address)) {
    return "must be written as an IPv4 range, such as \"10.0.0.0/8\"";
  }
  bool fits = (is_v4 || is_v6) && base.find('\0') == std::string::npos;  // c_str() ends there
  if (slash < text.size()) {
    const std::string_view digits = std::string_view(text).substr(slash + 1);
    const auto bits = ParseNumber<unsigned>(digits);
    fits = fits && bits && digits == std::to_string(*bits) && *bits <= (is_v4 ? 32u : 128u);
  }
  return fits ? ""
              : "must be an address or a range of addresses, such as \"127.0.0.1\", \"10.0.0.0/8\" or \"fd00::/8\"";
}

// "a,b", or a list as in the file.
Json ListToJson(const std::string& text) {
  if (text.starts_with('[')) {
    const Json parsed = Json::parse(text, nullptr, /*allow_exceptions=*/false);
    if (parsed.is_array()) return parsed;
  }
  Json list = TextsToJson(text);
  if (list.back() == "") list.erase(list.size() - 1);  // an empty text is the empty list
  return list;
}

// Texts that pass `check`, which returns "must be ..." or an empty string.
template <typename Target>
Codec<Target> List(std::vector<std::string> Target::*member, std::string (*check)(const std::string&),
                   const char* example, Json schema) {
  return {[=](const Json& value, const ConfigLocation& place, Target& target) {
            if (!value.is_array()) return place.Expected(fmt::format("a list such as {}", example));
            std::vector<std::string> texts;
            for (std::size_t i = 0; i < value.size(); ++i) {
              if (!value[i].is_string()) {
                place.At(i).Expected("text");
                continue;
              }
              texts.push_back(value[i].template get<std::string>());
              const std::string problem = check(texts.back());
              if (!problem.empty()) place.At(i).Fail(problem);
            }
            target.*member = std::move(texts);
          },
          [=](const Target& target) { return Json(target.*member); }, ListToJson, std::move(schema)};
}

// Only its hash is stored and written.
Codec<TokenConfig> TokenText() {
  return {[](const Json& value, const ConfigLocation& place, TokenConfig& token) {
            if (!value.is_string()) return place.Expected("text");
            const std::string& text = value.get_ref<const std::string&>();
            if (const std::string problem = CheckToken(text); !problem.empty()) return place.Fail(problem);
            token.sha256 = TokenHash(text);
          },
          [](const TokenConfig&) { return Json(); }, nullptr, TextLike("^[A-Za-z0-9._~+/=-]{16,256}$")};
}

Codec<TokenConfig> TokenHashText() {
  Codec<TokenConfig> codec = Text(&TokenConfig::sha256, CheckHash, TextLike("^[0-9a-fA-F]{64}$"));
  codec.read = [read = codec.read](const Json& value, const ConfigLocation& place, TokenConfig& token) {
    read(value, place, token);
    std::transform(token.sha256.begin(), token.sha256.end(), token.sha256.begin(), ToLower);
  };
  return codec;
}

// Checks a token for duplicates of earlier ones.
void CompareToken(const std::vector<TokenConfig>& tokens, std::size_t i, const ConfigLocation& place) {
  const TokenConfig& token = tokens[i];
  for (std::size_t j = 0; j < i; ++j) {
    if (!token.name.empty() && tokens[j].name == token.name) {
      place.Fail(fmt::format("has the name of /tokens/{}; every token needs its own", j));
    }
    if (!token.sha256.empty() && tokens[j].sha256 == token.sha256) {
      place.Fail(
          fmt::format("is the same token as /tokens/{}; make a new one, or give the other one more datasets", j));
    }
  }
}

void ReadTokens(const Json& value, const ConfigLocation& place, Config& config) {
  if (!value.is_array()) return place.Expected("a list of tokens");
  for (std::size_t i = 0; i < value.size(); ++i) {
    TokenConfig& token = config.tokens.emplace_back();
    ReadObject(value[i], place.At(i), TokenOptionTable(), token);
    if (!value[i].is_object()) continue;
    if (value[i].contains("token") == value[i].contains("sha256")) {
      place.At(i).Fail("must have exactly one of \"token\" and \"sha256\"");
    }
    CompareToken(config.tokens, i, place.At(i));
  }
  // Names are logged and printed.
  for (std::size_t i = 0; i < config.tokens.size(); ++i) {
    const std::string hash = TokenHash(config.tokens[i].name);
    if (std::any_of(config.tokens.begin(), config.tokens.end(),
                    [&](const auto& other) { return other.sha256 == hash; })) {
      place.At(i).At("name").Fail("is a token itself, and the log shows names; choose another name");
    }
  }
}

Json TlsToJson(const std::string& text) {
  const std::size_t comma = text.find(',');
  if (comma == std::string::npos) return text;
  return Json{{"certificate", text.substr(0, comma)}, {"key", text.substr(comma + 1)}};
}

// Refuses a key as text: the log would contain it as the name of a missing file.
bool IsPathOfFile(const std::string& text) {
  return !text.empty() && !HasControlCharacter(text) && text.find("-----BEGIN") == std::string::npos;
}

void ReadTls(const Json& value, const ConfigLocation& place, Config& config) {
  const auto is_path = [&](const char* key) {
    return value.contains(key) && value[key].is_string() && IsPathOfFile(value[key].get_ref<const std::string&>());
  };
  if (!value.is_object() || value.size() != 2 || !is_path("certificate") || !is_path("key")) {
    return place.Expected(
        R"({"certificate": "server.pem", "key": "server.key"}, the paths of two PEM files; as a flag server.pem,server.key)");
  }
  config.tls = {place.Resolve(value["certificate"].get<std::string>()), place.Resolve(value["key"].get<std::string>())};
}

Json WriteTls(const Config& config) {
  if (config.tls.certificate.empty()) return {};
  return Json{{"certificate", config.tls.certificate}, {"key", config.tls.key}};
}

Json TokensSchema() {
  Json schema = ObjectSchema(TokenOptionTable());
  schema["oneOf"] = Json::parse(R"([{"required": ["token"]}, {"required": ["sha256"]}])");
  return ListOf(std::move(schema));
}

constexpr const char* kTlsSchema = R"({
  "type": "object", "additionalProperties": false, "required": ["certificate", "key"],
  "properties": {
    "certificate": {"description": "The certificate, and the chain above it", "type": "string", "minLength": 1},
    "key": {"description": "Its private key, without a passphrase", "type": "string", "minLength": 1}
  }
})";
constexpr const char* kOriginsSchema = R"({
  "type": "array", "items": {"type": "string", "pattern": "^(\\*|https?://[A-Za-z0-9.:\\[\\]-]{1,255})$"},
  "examples": [["https://maps.example", "http://localhost:3000"]]
})";
constexpr const char* kProxiesSchema = R"({
  "type": "array", "items": {"type": "string", "pattern": "^[0-9A-Fa-f.:]+(/(0|[1-9][0-9]{0,2}))?$"},
  "examples": [["127.0.0.1", "10.0.0.0/8", "fd00::/8"]]
})";

}  // namespace

const std::vector<Option<TokenConfig>>& TokenOptionTable() {
  static const std::vector<Option<TokenConfig>> table = {
      {.key = "name",
       .value = "NAME",
       .help = "Name of the token in the log; no other token may have it",
       .details = "1 to 64 letters, digits, `.`, `_` or `-`; not the token itself",
       .codec = Text(&TokenConfig::name, CheckTokenName, TextLike(kNamePattern)),
       .missing = "; every token needs one"},
      {.key = "token",
       .value = "TEXT",
       .help = "Token that clients send",
       .details = "16 to 256 letters, digits or any of `-._~+/=`. `openssl rand -hex 24` makes a good one. The server "
                  "keeps only its hash",
       .codec = TokenText()},
      {.key = "sha256",
       .value = "HEX",
       .help = "SHA-256 of the token in hexadecimal, instead of the token",
       .details = "The file then holds no secret. `printf %s \"$TOKEN\" | sha256sum | cut -c1-64` prints it",
       .codec = TokenHashText()},
      {.key = "datasets",
       .value = "NAMES",
       .help = "Datasets that the token opens; an empty list is all",
       .details = "The empty list opens `/metrics` and `/version` as well",
       .codec = List(&TokenConfig::datasets, CheckDatasetName, "[\"maui\"]", ListOf(TextLike(kNamePattern)))},
      {.key = "requests_per_second",
       .value = "N",
       .help = "Rate of requests with this token; 0 is the server's rate",
       .details = "The burst is twice this rate",
       .codec = Number(&TokenConfig::requests_per_second, 0, kMaxRequests)},
  };
  return table;
}

Codec<Config> TokensCodec() {
  return {ReadTokens,
          [](const Config& config) {
            Json list = Json::array();
            for (const TokenConfig& token : config.tokens) list.push_back(WriteObject(token, TokenOptionTable()));
            return list;
          },
          nullptr, TokensSchema()};
}

Codec<Config> TlsCodec() { return {ReadTls, WriteTls, TlsToJson, Json::parse(kTlsSchema)}; }

Codec<Config> OriginsCodec() {
  Codec<Config> codec =
      List(&Config::cors_origins, CheckOrigin, R"(["https://maps.example"])", Json::parse(kOriginsSchema));
  codec.read = [read = codec.read](const Json& value, const ConfigLocation& place, Config& config) {
    read(value, place, config);
    std::ranges::transform(config.cors_origins, config.cors_origins.begin(), AsBrowsersSend);
  };
  return codec;
}

Codec<Config> ProxiesCodec() {
  return List(&Config::trusted_proxies, CheckRange, R"(["127.0.0.1", "10.0.0.0/8"])", Json::parse(kProxiesSchema));
}

}  // namespace terrace::config
