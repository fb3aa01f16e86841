#include "config/options/option_table.h"

namespace terrace::config {
namespace {

constexpr std::int64_t kMaxTileBytes = std::int64_t{64} << 20;

// Only the form: the server parses the URL. The value is shown by --print-config, so a password must not be in it, nor
// in the message.
std::string CheckUrl(const std::string& url) {
  const std::size_t scheme = url.find("://");
  const std::string_view name = std::string_view(url).substr(0, scheme == std::string::npos ? 0 : scheme);
  if (HasControlCharacter(url) || (name != "redis" && name != "rediss")) {
    return "must be redis://[user@]HOST:PORT/DATABASE, or rediss:// for TLS";
  }
  const std::string_view rest = std::string_view(url).substr(scheme + 3);
  const std::size_t at = rest.rfind('@');
  if (at != std::string_view::npos && rest.substr(0, at).find(':') != std::string_view::npos) {
    return "must not contain a password; name a password_file, or set TERRACE_SHARED_CACHE_PASSWORD";
  }
  return {};
}

}  // namespace

const std::vector<Option<SharedCacheConfig>>& SharedCacheOptionTable() {
  static const std::vector<Option<SharedCacheConfig>> table = {
      {.key = "url",
       .value = "URL",
       .help = "The Redis: redis://[user@]HOST:PORT/DATABASE, or rediss:// for TLS",
       .details = "Without a password. A Redis that does not answer is no error: the server goes on without it",
       .codec = Text(&SharedCacheConfig::url, CheckUrl, TextLike("^rediss?://[^:@]*@?[^@]*$")),
       .missing = ": where the Redis is"},
      {.key = "password_file",
       .value = "FILE",
       .help = "File whose first line is the password; without it, TERRACE_SHARED_CACHE_PASSWORD is used, if set",
       .details = "The server reads it once, at the start, and never prints it",
       .codec = Path(&SharedCacheConfig::password_file, "the path of a file")},
      {.key = "ca_file",
       .value = "FILE",
       .help = "Certificates (PEM) of authorities for a rediss:// server; by default those of the system",
       .codec = Path(&SharedCacheConfig::ca_file, "the path of a file"),
       .needs = "a `url` with rediss://",
       .is_used = [](const SharedCacheConfig& cache) { return cache.url.starts_with("rediss://"); }},
      {.key = "timeout_ms",
       .value = "MS",
       .help = "Longest time that a request waits for a reply of Redis",
       .details = "After a time-out or an error the server waits 1 s, and uses Redis again when it has answered a test",
       .codec = Integer(&SharedCacheConfig::timeout_ms, 1, 1000)},
      {.key = "min_build_ms",
       .value = "MS",
       .help = "Tiles that took less to build are not stored; 0 stores all",
       .details = "[Which tiles it pays for](decisions/0021-shared-cache.md)",
       .codec = Number(&SharedCacheConfig::min_build_ms, 0, 60'000)},
      {.key = "max_bytes_per_tile",
       .value = "BYTES",
       .help = "Larger tiles are not stored",
       .codec = Bytes(&SharedCacheConfig::max_bytes_per_tile, kMaxTileBytes)},
      {.key = "ttl_s",
       .value = "SECONDS",
       .help = "Time after which Redis forgets a tile; 0 is never",
       .details = "Tiles of older versions are no longer found; this time or Redis's `maxmemory-policy` removes them",
       .codec = Seconds(&SharedCacheConfig::ttl, 0, 31'536'000)},
      {.key = "lease_ms",
       .value = "MS",
       .help = "Time that a server waits for a tile that another one builds; 0 builds it at once",
       .details =
           "A worker waits meanwhile. Use it if tiles take longer to build than a few look-ups and a balancer sends "
           "requests for a tile to any server. Behind a ring a tile has one server anyway",
       .codec = Integer(&SharedCacheConfig::lease_ms, 0, 60'000)},
  };
  return table;
}

Codec<Config> SharedCacheCodec() {
  return ObjectOf(&Config::shared_cache, &SharedCacheConfig::url, SharedCacheOptionTable(),
                  R"({"url": "redis://HOST:6379/0"})");
}

}  // namespace terrace::config
