// The table of options at the top of the configuration file.
#include <algorithm>

#include "config/options/option_table.h"

namespace terrace::config {
namespace {

constexpr std::int64_t kMaxCacheBytes = std::int64_t{1} << 40;

// The value goes into a response header as it is: a line break there would let it add headers.
std::string CheckCacheControl(const std::string& text) {
  const bool ascii = std::all_of(text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 0x7f; });
  if (ascii && !text.empty() && !HasControlCharacter(text)) return {};
  return "must be the value of a Cache-Control header in ASCII, such as \"public, max-age=3600\" or \"no-cache\"";
}

constexpr const char* kCacheControlSchema = R"({
  "type": "string", "pattern": "^[ -~]+$",
  "examples": ["no-cache", "public, max-age=86400, stale-while-revalidate=604800"]
})";

// Port numbers up to 65535, with or without leading zeros.
constexpr const char* kListenSchema = R"({
  "type": "string",
  "pattern": "^(\\[[0-9A-Fa-f:.]+\\]|[A-Za-z0-9][A-Za-z0-9.-]{0,252}):0*([0-9]{1,4}|[1-5][0-9]{4}|6[0-4][0-9]{3}|65[0-4][0-9]{2}|655[0-2][0-9]|6553[0-5])$",
  "examples": ["0.0.0.0:8080", "[::1]:8080", "localhost:0"]
})";

Json WriteAddress(const ListenAddress& address) { return ToString(address); }
Json WriteAddress(const std::optional<ListenAddress>& address) { return address ? WriteAddress(*address) : Json(); }

// A path of at most 107 bytes, or as above.
constexpr const char* kListenOrPathSchema = R"({
  "type": "string",
  "pattern": "^(unix:/.{0,105}[^/]|(\\[[0-9A-Fa-f:.]+\\]|[A-Za-z0-9][A-Za-z0-9.-]{0,252}):0*([0-9]{1,4}|[1-5][0-9]{4}|6[0-4][0-9]{3}|65[0-4][0-9]{2}|655[0-2][0-9]|6553[0-5]))$",
  "examples": ["127.0.0.1:9090", "unix:/run/terrace/admin.sock"]
})";

template <typename Member>
Codec<Config> Address(Member Config::*member, Result<ListenAddress> (*parse)(std::string_view) = ParseListenAddress,
                      const char* schema = kListenSchema) {
  return {[=](const Json& value, const ConfigLocation& place, Config& config) {
            if (!value.is_string()) return place.Expected("text such as \"127.0.0.1:8080\"");
            Result<ListenAddress> address = parse(value.get_ref<const std::string&>());
            if (!address) return place.Fail(address.error().message);
            config.*member = *std::move(address);
          },
          [=](const Config& config) { return WriteAddress(config.*member); }, TextToJson, Json::parse(schema)};
}

Codec<Config> Viewer() {
  return {[](const Json& value, const ConfigLocation& place, Config& config) {
            if (value.is_boolean()) {
              config.viewer = {value.get<bool>(), {}};
            } else if (value.is_string() && !value.get_ref<const std::string&>().empty()) {
              config.viewer = {true, place.Resolve(value.get<std::string>())};
            } else {
              place.Expected("the folder of a viewer, true (the viewer that comes with terrace) or false (none)");
            }
          },
          [](const Config& config) {
            return config.viewer.directory.empty() ? Json(config.viewer.enabled)
                                                   : Json(config.viewer.directory.string());
          },
          SwitchToJson, Json::parse(R"({"anyOf": [{"type": "boolean"}, {"type": "string", "minLength": 1}]})")};
}

// "default" and "none" are words, everything else is a path.
Codec<Config> CacheDir() {
  constexpr const char* kNone = "none";
  return {[=](const Json& value, const ConfigLocation& place, Config& config) {
            if (!value.is_string()) return place.Expected("the path of a folder, \"default\" or \"none\"");
            const auto& path = value.get_ref<const std::string&>();
            const bool is_off = path.empty() || path == kNone;
            config.cache_dir = is_off ? "" : path == kDefaultCacheDir ? path : place.Resolve(path);
          },
          [=](const Config& config) { return Json(config.cache_dir.empty() ? kNone : config.cache_dir); }, TextToJson,
          Json::parse(R"({"type": "string", "examples": ["/var/cache/terrace/sources", "default", "none"]})")};
}

Codec<Config> Datasets() {
  return {[](const Json& value, const ConfigLocation& place, Config& config) {
            if (!value.is_array()) return place.Expected("a list of datasets");
            for (std::size_t i = 0; i < value.size() && !place.has_failed_often(); ++i) {
              ReadObject(value[i], place.At(i), DatasetOptionTable(), config.datasets.emplace_back());
            }
          },
          [](const Config& config) {
            Json list = Json::array();
            for (const DatasetConfig& dataset : config.datasets) {
              list.push_back(WriteObject(dataset, DatasetOptionTable()));
            }
            return list;
          },
          nullptr, ListOf(ObjectSchema(DatasetOptionTable()))};
}

}  // namespace

const std::vector<Option<Config>>& ServerOptionTable() {
  static const std::vector<Option<Config>> table = {
      {.key = "listen",
       .value = "HOST:PORT",
       .section = "listening",
       .help = "Address and port to listen on; port 0 picks a free one",
       .details = "An IPv6 address is in brackets: `[::1]:8080`. `0.0.0.0:8080` or `[::]:8080` is every interface. The "
                  "server prints one line with the port that it uses",
       .codec = Address(&Config::listen),
       .other_words = "port host address bind interface ip"},
      {.key = "datasets",
       .section = "datasets",
       .help = "Datasets to serve",
       .details = "A list of objects with the keys below. Each DEM on the command line is appended as one more dataset",
       .codec = Datasets(),
       .other_words = "dems layers rasters",
       .is_live = true},
      {.key = "viewer",
       .value = "DIR|false",
       .section = "listening",
       .help = "Folder of the web page at /; true is the page that comes with terrace, false is none",
       .details = "Without a viewer, `/` is a plain list of datasets. The page is the folder's `index.html`. All files "
                  "of the folder are served below `/viewer/`, so the page links to them as `viewer/...`. The server "
                  "reads them once, at the start. It follows symbolic links to files, not to folders",
       .codec = Viewer(),
       .other_words = "ui web html static www"},
      {.key = "cache_control",
       .value = "TEXT",
       .section = "listening",
       .help = "Cache-Control header of tiles requested without their version",
       .details = "One line of ASCII. Clients keep tiles requested with their version, as in the URLs of all "
                  "documents, for a year. They revalidate documents on each use",
       .codec = Text(&Config::cache_control, CheckCacheControl, Json::parse(kCacheControlSchema)),
       .other_words = "max_age",
       .is_live = true},
      {.key = "admin_listen",
       .value = "HOST:PORT|unix:PATH",
       .section = "listening",
       .help = "A second address, for operators: POST /admin/purge, GET /metrics, GET /version",
       .details = "Plain HTTP without tokens: whoever reaches it may use it, so take the path of a Unix socket, a "
                  "loopback address or one of a closed network ([operations](operations.md#purging-caches))",
       .codec = Address(&Config::admin_listen, ParseListenAddressOrPath, kListenOrPathSchema),
       .other_words = "management control"},
      {.key = "admin_socket_mode",
       .value = "MODE",
       .section = "listening",
       .help = "Who may connect to the Unix socket of admin_listen",
       .details =
           "0600: the user that the server runs as; 0660: also its group; 0666: everybody who may enter the folder",
       .codec = Choice(&Config::admin_socket_mode,
                       std::vector<std::pair<Json, unsigned>>{{"0600", 0600}, {"0660", 0660}, {"0666", 0666}}),
       .other_words = "socket_mode permissions",
       .needs = "`admin_listen` with the path of a Unix socket",
       .is_used = [](const Config& config) { return config.admin_listen && !config.admin_listen->path.empty(); }},
      {.key = "io_threads",
       .value = "N",
       .section = "load",
       .help = "Threads that send and receive",
       .details = "They do not build tiles; one or two are enough for most machines",
       .codec = Integer(&Config::io_threads, 1, 64)},
      {.key = "worker_threads",
       .value = "N",
       .section = "load",
       .help = "Threads that build tiles; 0 is one per processor",
       .codec = Integer(&Config::worker_threads, 0, 1024),
       .other_words = "workers jobs"},
      {.key = "cache_dir",
       .value = "DIR|none",
       .section = "load",
       .help = "Folder for statistics and averages of sources, so that the next start need not read them; default is "
               "$CACHE_DIRECTORY, else $XDG_CACHE_HOME/terrace, else ~/.cache/terrace; none keeps nothing",
       .details =
           "systemd sets `$CACHE_DIRECTORY`. The log names the folder. An empty text is `none`. For a folder with one "
           "of these two names, write `./default` or `./none`. The folder holds the ranges of sources, the errors of "
           "their averages, and the averages for shallow tiles if the source has no such overviews: about 1.4 bytes "
           "per sample, 18 MB for a raster of 3601 x 3601. Progress goes to stderr; an interrupted pass continues at "
           "the next start. Sources are identified by path, size and times, so a replaced source is read again. "
           "Several servers of one machine may share the folder. Without the folder, or if it fails, averages are "
           "[kept in memory](operations.md#cache_dir) as far as they fit. Relative to the folder of the file",
       .codec = CacheDir()},
      {.key = "cache_dir_bytes",
       .value = "BYTES",
       .section = "load",
       .help = "Largest total size of the files in cache_dir; 0 keeps nothing",
       .details = "If the limit would be exceeded, the least recently used files are removed, except those that this "
                  "server uses and those that terrace did not write. Data for which the folder has no space is kept in "
                  "memory as far as it fits, and `/readyz` says `degraded`",
       .codec = Bytes(&Config::cache_dir_bytes, kMaxCacheBytes),
       .other_words = "cache_size",
       .needs = "a `cache_dir`",
       .is_used = [](const Config& config) { return !config.cache_dir.empty(); }},
      {.key = "queue_length",
       .value = "N",
       .section = "load",
       .help = "Builds that may wait for a worker; more are refused with 503",
       .details = "The limit bounds memory. If it is exceeded, the newest build of the client with the most waiting "
                  "builds gets 503 with `Retry-After`. A client is a token or an address (for IPv6, the /64). The "
                  "client that has used the least worker time is served next. Among the builds of one client shallow "
                  "tiles go first; each level counts as a tenth of a second of waiting",
       .codec = Integer(&Config::queue_length, 1, 1'000'000)},
      {.key = "cache_bytes",
       .value = "BYTES",
       .section = "load",
       .help = "Memory for finished tiles, such as 512MB or 1GiB; 0 is no cache",
       .details =
           "A number of bytes, or text with B, kB, MB, GB, TB, KiB, MiB, GiB or TiB; so are all options in bytes",
       .codec = Bytes(&Config::cache_bytes, kMaxCacheBytes),
       .other_words = "cache cache_size memory",
       .is_live = true},
      {.key = "refinement_cache_bytes",
       .value = "BYTES",
       .section = "load",
       .help = "Memory for refinements, the records from which a tile is made at any error; 0 is no cache",
       .details = "About half a megabyte a tile. With its refinement in the cache, another error, format or coding of "
                  "a tile costs a fraction of the first one",
       .codec = Bytes(&Config::refinement_cache_bytes, kMaxCacheBytes),
       .is_live = true},
      {.key = "disk_cache",
       .value = "DIR",
       .section = "load",
       .help = "Folder that keeps finished tiles and refinements across restarts",
       .details = "In the file an object, `{\"directory\": \"/var/cache/terrace/tiles\"}`; as a flag the folder alone. "
                  "Relative to the folder of the file. [More](#disk-cache)",
       .codec = DiskCacheCodec(),
       .other_words = "cache"},
      {.key = "shared_cache",
       .value = "URL",
       .section = "load",
       .help = "Redis in which servers of a fleet share tiles that take long to build",
       .details = "In the file an object, `{\"url\": \"redis://HOST:6379/0\"}`; as a flag the URL alone. "
                  "[More](#shared-cache)",
       .codec = SharedCacheCodec(),
       .other_words = "redis memcached"},
      {.key = "gdal_cache_bytes",
       .value = "BYTES",
       .section = "load",
       .help = "Memory for blocks of the sources that GDAL has read",
       .details = "For all threads together. `/metrics` shows how much is in use",
       .codec = Bytes(&Config::gdal_cache_bytes, kMaxCacheBytes)},
      {.key = "max_open_sources",
       .value = "N",
       .section = "load",
       .help = "Files of sources, of all datasets, that stay open between reads",
       .details = "Rasters, images, grids of PROJ, and units of archives. The least recently used ones are closed. "
                  "Files in use do not "
                  "count; each thread uses at most one. The server lowers the number if "
                  "[descriptors](operations.md#descriptors) are scarce",
       .codec = Integer(&Config::max_open_sources, 0, 100'000)},
      {.key = "max_connections",
       .value = "N",
       .section = "load",
       .help = "Open connections; at the limit a new one closes a connection of the client with the most, or gets 503",
       .details =
           "Idle connections are closed first. If the new connection is from that client itself, and none of its "
           "connections can be closed, the new one gets 503 with `Retry-After`; with `tls` it is closed during the "
           "handshake. The server lowers the number if [descriptors](operations.md#descriptors) are scarce",
       .codec = Integer(&Config::max_connections, 1, 1'000'000)},
      {.key = "max_connections_per_client",
       .value = "N",
       .section = "load",
       .help = "Connections of one client at a time; 0 is no limit",
       .details =
           "A client is an IPv4 address, or the /64 of an IPv6 address. Further connections get 429; with `tls` they "
           "are closed during the handshake. The limit does not apply to [trusted proxies](#behind-a-proxy)",
       .codec = Integer(&Config::max_connections_per_client, 0, 1'000'000)},
      {.key = "transfer_bytes",
       .value = "BYTES",
       .section = "load",
       .help = "Memory for replies that clients have not received yet, and for request bodies",
       .details =
           "[Bodies in transfer](operations.md#bodies-in-transfer): half of it is for replies of up to a sixteenth "
           "of it, a quarter for larger replies, and a quarter for request bodies. Bodies up to 16 KiB do not count",
       .codec = Bytes(&Config::transfer_bytes, kMaxCacheBytes)},
      {.key = "requests_per_second",
       .value = "N",
       .section = "load",
       .help = "Average rate of requests of one client or token; more wait, or get 429; 0 is no limit",
       .details = "A request above the rate waits. It gets 429 with `Retry-After` if it would wait longer than half "
                  "of `request_deadline_s`. `/livez` and `/readyz` do not count; all other requests do, also those "
                  "answered with 404 or 405",
       .codec = Number(&Config::requests_per_second, 0, 1'000'000),
       .other_words = "rate rate_limit"},
      {.key = "request_burst",
       .value = "N",
       .section = "load",
       .help = "Requests that one client or token may send at once; 0 is twice requests_per_second",
       .details = "A viewer requests some hundreds of tiles when it starts",
       .codec = Number(&Config::request_burst, 0, 1'000'000),
       .needs = "`requests_per_second`",
       .is_used = [](const Config& config) { return config.requests_per_second > 0; }},
      {.key = "tokens",
       .section = "access",
       .help = "Tokens, and the datasets that each one opens; without tokens, all datasets are open to everybody",
       .details = "[More](#tokens)",
       .codec = TokensCodec(),
       .other_words = "auth api_keys keys users passwords"},
      {.key = "cors_origins",
       .value = "ORIGIN[,ORIGIN]",
       .section = "access",
       .help = "Origins of web pages that may read replies; * is any, an empty list none",
       .details =
           "As browsers send them in `Origin`: `[\"https://maps.example\"]`. Capital letters and the default port "
           "(443, or 80 with http) are changed to what browsers send. As a flag, separated by commas",
       .codec = OriginsCodec(),
       .other_words = "allowed_origins"},
      {.key = "trusted_proxies",
       .value = "ADDRESS[,ADDRESS]",
       .section = "access",
       .help = "Addresses and ranges of proxies whose headers may state the client's address",
       .details = "`[\"127.0.0.1\", \"10.0.0.0/8\"]`; as a flag, separated by commas. [More](#behind-a-proxy)",
       .codec = ProxiesCodec(),
       .other_words = "proxy"},
      {.key = "forwarded_header",
       .value = "NAME",
       .section = "access",
       .help = "Header that trusted proxies set: x-forwarded (-For, -Proto, -Host) or forwarded (RFC 7239)",
       .details = "The other header is ignored, because a proxy passes it on as the client sent it",
       .codec = Choice(&Config::forwarded_header,
                       {{"x-forwarded", ForwardedHeader::kXForwarded}, {"forwarded", ForwardedHeader::kForwarded}}),
       .needs = "`trusted_proxies`",
       .is_used = [](const Config& config) { return !config.trusted_proxies.empty(); }},
      {.key = "tls",
       .value = "CERT,KEY",
       .section = "access",
       .help = "PEM files of a certificate and its key, for HTTPS; without them the server speaks plain HTTP",
       .details = "In the file `{\"certificate\": \"server.pem\", \"key\": \"server.key\"}`, relative to its folder; "
                  "as a flag, both paths separated by a comma. [More](#tls)",
       .codec = TlsCodec(),
       .other_words = "ssl https cert"},
      {.key = "max_locations",
       .value = "N",
       .section = "load",
       .help = "Largest number of points of one request for heights or of one profile, and of rays of one for lines of "
               "sight",
       .details = "Requests with more get 400. The body of such a request may have 4096 bytes plus 64 for each point "
                  "of this limit, or 192 for each ray; larger bodies get 413",
       .codec = Integer(&Config::max_locations, 1, 1'000'000)},
      {.key = "max_mesh_samples",
       .value = "N",
       .section = "load",
       .help = "Largest number of height samples of one mesh of an area, and of nodes of one grid",
       .details =
           "Larger ones get 400. Meshing takes up to 300 bytes of memory a sample. The default admits 1025 x 1025",
       .codec = Integer(&Config::max_mesh_samples, 4, 100'000'000),
       .is_live = true},
      {.key = "request_deadline_s",
       .value = "SECONDS",
       .section = "limits",
       .help = "Longest time from the head of a request to its reply; after it the reply is 503",
       .details =
           "It includes the wait for the client's turn (`requests_per_second`), for a worker and for memory, but "
           "not the time in which a body arrives or the reply is sent",
       .codec = Seconds(&Config::request_deadline, 0.1, 3600),
       .other_words = "request_timeout",
       .is_live = true},
      {.key = "header_timeout_s",
       .value = "SECONDS",
       .section = "limits",
       .help = "Time for a client to send the head of a request",
       .details = "For a body it is the longest time without a byte, and the time before `min_read_rate` applies",
       .codec = Seconds(&Config::header_timeout, 0.1, 3600)},
      {.key = "idle_timeout_s",
       .value = "SECONDS",
       .section = "limits",
       .help = "Time that a connection without requests stays open",
       .codec = Seconds(&Config::idle_timeout, 0.1, 3600)},
      {.key = "write_timeout_s",
       .value = "SECONDS",
       .section = "limits",
       .help = "Longest time in which a client receives no byte of a response",
       .codec = Seconds(&Config::write_timeout, 0.1, 3600)},
      {.key = "min_read_rate",
       .value = "BYTES",
       .section = "limits",
       .help = "Lowest rate in bytes a second at which a client must receive a response or send a body; 0 is no limit",
       .details = "It applies to a response after `write_timeout_s`, to a body after `header_timeout_s`",
       .codec = Integer(&Config::min_read_rate, 0, 1'000'000'000)},
      {.key = "drain_delay_s",
       .value = "SECONDS",
       .section = "limits",
       .help = "Time for which a stopping server still serves, with /readyz 503, so that balancers stop using it",
       .details = "It precedes `drain_timeout_s`. Behind a balancer that asks `/readyz`: the period of its probe times "
                  "its failure threshold, plus the time until all balancers know. Replies have `Connection: close` "
                  "meanwhile. [More](operations.md#restarts)",
       .codec = Seconds(&Config::drain_delay, 0, 3600),
       .other_words = "lameduck shutdown_delay"},
      {.key = "drain_timeout_s",
       .value = "SECONDS",
       .section = "limits",
       .help = "Time for open requests to finish when the server stops",
       .details = "The server stops after SIGTERM or SIGINT",
       .codec = Seconds(&Config::drain_timeout, 0, 3600)},
      {.key = "data_roots",
       .value = "DIR[,DIR]",
       .section = "sources",
       .help = "Every source must lie in one of these folders; by default sources may be anywhere",
       .details =
           "So must every water mask, image and grid of undulations. A source must be a regular file; "
           "for a symbolic link its target counts. Relative to the folder of the file; as a flag, separated by commas",
       .codec = TextList(&Config::data_roots, "a list of folders", true),
       .other_words = "root data_dir"},
      {.key = "allowed_prefixes",
       .value = "PREFIX[,PREFIX]",
       .section = "sources",
       .help = "Prefixes of remote sources that may be opened, such as /vsis3/bucket/; by default none",
       .details =
           "Another example is `/vsicurl/https://example.org/dems/`. By default GDAL cannot reach the network. Remote "
           "rasters must be GeoTIFFs, because GDAL does not report failed reads of some other formats. Remote files "
           "are not watched: the server sees a changed file at the next start. Give a changed file another name",
       .codec = TextList(&Config::allowed_prefixes, "a list of prefixes such as [\"/vsis3/bucket/\"]", false)},
      {.key = "allowed_drivers",
       .value = "NAME[,NAME]",
       .section = "sources",
       .help = "Formats that sources may have, as GDAL's short names; by default the usual ones",
       .details = "`gdalinfo --formats` lists the names. The list replaces the default",
       .codec = TextList(&Config::allowed_drivers, "a list of formats such as [\"GTiff\", \"VRT\"]", false),
       .other_words = "formats"},
      {.key = "watch",
       .value = "true|false",
       .section = "changes",
       .help = "Follow changes of sources and of the configuration file while serving",
       .details =
           "The server checks the files every second, and also which files the globs match "
           "([operations](operations.md#changing-data-and-configuration)). With `false`, SIGHUP makes it check them",
       .codec = Switch(&Config::watch),
       .other_words = "reload"},
      {.key = "log_level",
       .value = "LEVEL",
       .section = "log",
       .help = "Least important messages to log: debug, info, warn, error or off",
       .details = "Requests are logged at `info`",
       .codec = Choice(&Config::log_level, {{"debug", LogLevel::kDebug},
                                            {"info", LogLevel::kInfo},
                                            {"warn", LogLevel::kWarn},
                                            {"error", LogLevel::kError},
                                            {"off", LogLevel::kOff}}),
       .other_words = "verbose verbosity debug quiet",
       .is_live = true},
      {.key = "log_format",
       .value = "FORMAT",
       .section = "log",
       .help = "Format of the log on stderr: text for people, or json (one object on each line) for programs",
       .codec = Choice(&Config::log_format, {{"text", LogFormat::kText}, {"json", LogFormat::kJson}})},
      {.key = "access_log",
       .value = "FORM",
       .section = "log",
       .help = "Format of the access log: log (lines of the log), combined, json or off",
       .details = "`combined` is the format of Apache and nginx; `json` is one object on each line "
                  "([operations](operations.md#logs))",
       .codec = Choice(&Config::access_log, {{"log", AccessLogForm::kLog},
                                             {"combined", AccessLogForm::kCombined},
                                             {"json", AccessLogForm::kJson},
                                             {"off", AccessLogForm::kOff}})},
      {.key = "access_log_file",
       .value = "FILE",
       .section = "log",
       .help = "File to which a combined or json access log is appended; by default stderr",
       .details = "Relative to the folder of the configuration file. SIGHUP reopens it",
       .codec = Path(&Config::access_log_file, "the path of a file"),
       .needs = "`access_log` to be `combined` or `json`",
       .is_used =
           [](const Config& config) {
             return config.access_log == AccessLogForm::kCombined || config.access_log == AccessLogForm::kJson;
           }},
  };
  return table;
}

}  // namespace terrace::config
