#include "config/option_table.h"

#include <algorithm>

#include "config/disk_cache_option.h"
#include "config/edge_options.h"
#include "config/layer_options.h"
#include "config/nearest_name.h"
#include "config/source_options.h"

namespace terrace::config {
namespace {

constexpr std::int64_t kMaxCacheBytes = std::int64_t{1} << 40;

// The value goes into a response header as it is: a line break there would let it add headers.
std::string CheckCacheControl(const std::string& text) {
  const bool ascii = std::all_of(text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 0x7f; });
  if (ascii && !text.empty() && !HasControlCharacter(text)) return {};
  return "must be the value of a Cache-Control header in ASCII, such as \"public, max-age=3600\" or \"no-cache\"";
}

Codec<Config> Listen() {
  return {[](const Json& value, const Place& place, Config& config) {
            if (!value.is_string()) return place.Expected("text such as \"127.0.0.1:8080\"");
            Result<ListenAddress> address = ParseListenAddress(value.get_ref<const std::string&>());
            if (!address) return place.Fail(address.error().message);
            config.listen = *std::move(address);
          },
          [](const Config& config) { return Json(ToString(config.listen)); }, TextToJson};
}

Codec<Config> Viewer() {
  return {[](const Json& value, const Place& place, Config& config) {
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
          SwitchToJson};
}

Codec<Config> CacheDir() {
  return {[](const Json& value, const Place& place, Config& config) {
            if (!value.is_string()) return place.Expected("the path of a folder");
            const auto& path = value.get_ref<const std::string&>();
            config.cache_dir = path.empty() ? path : place.Resolve(path);
          },
          [](const Config& config) { return Json(config.cache_dir); }, TextToJson};
}

Codec<Config> AccessLogFile() {
  return {[](const Json& value, const Place& place, Config& config) {
            if (!value.is_string() || value.get_ref<const std::string&>().empty()) {
              return place.Expected("the path of a file");
            }
            config.access_log_file = place.Resolve(value.get<std::string>());
          },
          [](const Config& config) { return config.access_log_file.empty() ? Json() : Json(config.access_log_file); },
          TextToJson};
}

Codec<Config> Datasets() {
  return {[](const Json& value, const Place& place, Config& config) {
            if (!value.is_array()) return place.Expected("a list of datasets");
            for (std::size_t i = 0; i < value.size() && !place.has_failed_often(); ++i) {
              DatasetConfig& dataset = config.datasets.emplace_back();
              ReadObject(value[i], place.At(i), DatasetOptionTable(), dataset);
              for (const std::string_view required : {"name", "sources"}) {
                if (value[i].is_object() && !value[i].contains(required)) {
                  place.At(i).Fail(fmt::format("\"{}\" is missing; every dataset needs one", required));
                }
              }
            }
          },
          [](const Config& config) {
            Json list = Json::array();
            for (const DatasetConfig& dataset : config.datasets)
              list.push_back(WriteObject(dataset, DatasetOptionTable()));
            return list;
          }};
}

}  // namespace

const std::vector<Option<Config>>& ServerOptionTable() {
  static const std::vector<Option<Config>> table = {
      {"listen", "HOST:PORT", "Where to listen; port 0 picks a free one", Listen()},
      {"datasets", "", "What to serve; DEMs on the command line come on top", Datasets()},
      {"viewer", "DIR|false", "Folder of the web page at /; true is the one that comes with terrace, false is none",
       Viewer()},
      {"cache_control", "TEXT", "The Cache-Control header of tiles and descriptions",
       Text(&Config::cache_control, CheckCacheControl)},
      {"io_threads", "N", "Threads that talk to clients", Integer(&Config::io_threads, 1, 64)},
      {"worker_threads", "N", "Threads that build tiles; 0 is one per processor",
       Integer(&Config::worker_threads, 0, 1024)},
      {"cache_dir", "DIR", "Folder for what is learnt of sources once: a second start needs no scan; empty is none",
       CacheDir()},
      {"queue_length", "N", "Builds that may wait for a worker; of more the newest of who has most get 503",
       Integer(&Config::queue_length, 1, 1'000'000)},
      {"cache_bytes", "BYTES", "Memory for finished tiles, such as 512MB or 1GiB; 0 is no cache",
       Bytes(&Config::cache_bytes, kMaxCacheBytes)},
      {"refinement_cache_bytes", "BYTES",
       "Memory for what tiles are made from: other errors of a tile cost a fraction then; 0 is no cache",
       Bytes(&Config::refinement_cache_bytes, kMaxCacheBytes)},
      {"disk_cache", "DIR", "Keep finished tiles and refinements in this directory, across restarts",
       DiskCacheOption()},
      {"gdal_cache_bytes", "BYTES", "Memory for blocks of the sources, as they are read",
       Bytes(&Config::gdal_cache_bytes, kMaxCacheBytes)},
      {"max_open_sources", "N", "Files of sources, of all datasets, that are kept open between reads",
       Integer(&Config::max_open_sources, 0, 100'000)},
      {"max_connections", "N", "Connections at a time; above it one of the client that has most is closed",
       Integer(&Config::max_connections, 1, 1'000'000)},
      {"max_connections_per_client", "N", "Connections of one address at a time; 0 is no limit of its own",
       Integer(&Config::max_connections_per_client, 0, 1'000'000)},
      {"transfer_bytes", "BYTES", "Memory for replies that clients have not taken yet, and for request bodies",
       Bytes(&Config::transfer_bytes, kMaxCacheBytes)},
      {"requests_per_second", "N",
       "Requests of one address or token in the long run; more wait, or get 429; 0 is any number",
       Number(&Config::requests_per_second, 0, 1'000'000)},
      {"request_burst", "N", "Requests of one address or token at once; 0 is twice requests_per_second",
       Number(&Config::request_burst, 0, 1'000'000)},
      {"tokens", "", "Who may see which datasets; none: everybody sees all", TokensCodec()},
      {"cors_origins", "LIST", "Web pages that may read replies, with commas between them; * is any", OriginsCodec()},
      {"trusted_proxies", "LIST", "Proxies whose word on the client counts: addresses and ranges", ProxiesCodec()},
      {"forwarded_header", "NAME", "What trusted proxies write: x-forwarded (-for, -proto, -host) or forwarded",
       Choice(&Config::forwarded_header,
              {{"x-forwarded", ForwardedHeader::kXForwarded}, {"forwarded", ForwardedHeader::kForwarded}})},
      {"tls", "CERT,KEY", "PEM files for HTTPS; without them plain HTTP is spoken", TlsCodec()},
      {"max_locations", "N", "Points that one request for heights may name",
       Integer(&Config::max_locations, 1, 1'000'000)},
      {"max_mesh_samples", "N", "Height samples that one mesh of an area may be made from",
       Integer(&Config::max_mesh_samples, 4, 100'000'000)},
      {"request_deadline_s", "SECONDS", "A request that takes longer gets 503",
       Seconds(&Config::request_deadline, 0.1, 3600)},
      {"header_timeout_s", "SECONDS", "Time for a client to send its request",
       Seconds(&Config::header_timeout, 0.1, 3600)},
      {"idle_timeout_s", "SECONDS", "Time an idle connection is kept open", Seconds(&Config::idle_timeout, 0.1, 3600)},
      {"write_timeout_s", "SECONDS", "Time for a client to take a response",
       Seconds(&Config::write_timeout, 0.1, 3600)},
      {"min_read_rate", "BYTES", "Bytes a second that a client takes of a response or sends of a body; 0 is any",
       Integer(&Config::min_read_rate, 0, 1'000'000'000)},
      {"drain_timeout_s", "SECONDS", "Time for open requests to finish when the server stops",
       Seconds(&Config::drain_timeout, 0, 3600)},
      {"data_roots", "DIR[,DIR]", "Folders that hold every source; by default any folder may",
       TextList(&Config::data_roots, "a list of folders", true)},
      {"allowed_prefixes", "PREFIX[,PREFIX]", "Beginnings of remote sources, such as /vsis3/bucket/; by default none",
       TextList(&Config::allowed_prefixes, "a list of prefixes such as [\"/vsis3/bucket/\"]", false)},
      {"allowed_drivers", "NAME[,NAME]", "Formats that sources may have, by GDAL's short names",
       TextList(&Config::allowed_drivers, "a list of formats such as [\"GTiff\", \"VRT\"]", false)},
      {"watch", "true|false", "Take over changes of sources and of the configuration file while serving",
       Switch(&Config::watch)},
      {"log_level", "LEVEL", "The least important messages to log: debug, info, warn, error or off",
       Choice(&Config::log_level, {{"debug", LogLevel::kDebug},
                                   {"info", LogLevel::kInfo},
                                   {"warn", LogLevel::kWarn},
                                   {"error", LogLevel::kError},
                                   {"off", LogLevel::kOff}})},
      {"log_format", "FORMAT", "text for people, json for machines (one object a line); both on stderr",
       Choice(&Config::log_format, {{"text", LogFormat::kText}, {"json", LogFormat::kJson}})},
      {"access_log", "FORM", "How requests are told of: log (lines of the log), combined, json or off",
       Choice(&Config::access_log, {{"log", AccessLogForm::kLog},
                                    {"combined", AccessLogForm::kCombined},
                                    {"json", AccessLogForm::kJson},
                                    {"off", AccessLogForm::kOff}})},
      {"access_log_file", "FILE", "Where the access log goes if it is combined or json; by default stderr",
       AccessLogFile()},
  };
  return table;
}

const std::vector<Option<DatasetConfig>>& DatasetOptionTable() {
  static const std::vector<Option<DatasetConfig>> table = {
      {"name", "NAME", "The dataset's name in URLs; by default that of the file",
       Text(&DatasetConfig::name, CheckDatasetName)},
      {"sources", "", "Files, globs and folders of rasters; the first that has a height at a place gives it",
       SourcesCodec()},
      {"vertical", "DATUM",
       "What the heights count from: crs (as the source states), unknown, ellipsoid, egm96, egm2008, EPSG:N or a grid",
       VerticalCodec()},
      {"nodata", "VALUE", "Voids: auto finds undeclared ones, declared trusts the source, a number is one more",
       NodataCodec()},
      {"attribution", "TEXT", "Who to thank for the data; clients show it",
       Text(&DatasetConfig::attribution, CheckOneLine)},
      {"error_fraction", "SHARE", "Default error of a level as a share of the error that clients assume there",
       Number(&DatasetConfig::error_fraction, 0.05, 1)},
      {"finest_error", "METRES",
       "Go as deep as needed for this default error; by default a tenth of the source's spacing",
       Number(&DatasetConfig::finest_error, 0.001, 100'000)},
      {"floor", "METRES", "Height outside the source and in voids that touch its rim; by default its lowest height",
       Number(&DatasetConfig::floor, -kMostHeight, kMostHeight)},
      {"max_void_gap", "SAMPLES", "Voids narrower than this many source samples are filled from their edges",
       Integer(&DatasetConfig::max_void_gap, 0, 4096)},
      {"voids", "NAME",
       "What larger voids with data all around them show: smooth (a surface between their edges) or floor",
       Choice(&DatasetConfig::voids, {{"smooth", dem::HoleFill::kSmooth}, {"floor", dem::HoleFill::kFloor}})},
      {"feather", "METRES", "Blend a source of a mosaic with what lies below it so far from its edges; 0: no blending",
       Number(&DatasetConfig::feather, 0, 1'000'000)},
      {"criterion", "NAME", "How triangles are joined: delaunay, or data-dependent: smaller tiles, more time to build",
       Choice(&DatasetConfig::criterion,
              {{"delaunay", tin::Criterion::kDelaunay}, {"data-dependent", tin::Criterion::kDataDependent}})},
      {"compact", "true|false",
       "Drop the vertices that a tile's error does not need: smaller tiles, more time to build",
       Switch(&DatasetConfig::compact)},
      {"glb_compression", "NAME", "How GLB tiles are compressed by default: draco, none, quantized or meshopt",
       Choice(&DatasetConfig::glb_compression, {{"draco", proto::GlbCompression::kDraco},
                                                {"none", proto::GlbCompression::kNone},
                                                {"quantized", proto::GlbCompression::kQuantized},
                                                {"meshopt", proto::GlbCompression::kMeshopt}})},
      {"draco_speed", "N", "Draco's effort for GLB tiles: 0 is smallest, 10 is fastest",
       Integer(&DatasetConfig::draco_speed, 0, 10)},
      {"draco_normal_bits", "N", "Bits of each of the two coordinates of a normal in Draco tiles",
       Integer(&DatasetConfig::draco_normal_bits, 4, 16)},
      {"water", "METRES|FILE", "Water masks: a sea level, or a raster that is not zero on water", WaterCodec()},
      {"imagery", "FILE", "An image that the textures of GLB tiles are cut from", ImageryCodec()},
      {"public", "true|false", "Seen without a token, where there are tokens", Switch(&DatasetConfig::is_public)},
      {"metadata_availability", "LEVELS", "Tiles of every so many levels tell which tiles are below them; 0: none do",
       Integer(&DatasetConfig::metadata_availability, 0, 24)},
  };
  return table;
}

template <typename Target>
void ReadObject(const Json& object, const Place& place, const std::vector<Option<Target>>& table, Target& target) {
  if (!object.is_object())
    return place.Expected("an object with keys such as \"" + std::string(table.front().key) + "\"");
  std::vector<std::string_view> keys;
  keys.reserve(table.size());
  for (const Option<Target>& option : table) keys.push_back(option.key);
  std::size_t number = 0;
  for (const auto& [key, value] : object.items()) {
    ++number;
    const auto found = std::find(keys.begin(), keys.end(), key);
    if (found != keys.end()) {
      table[static_cast<std::size_t>(found - keys.begin())].codec.read(value, place.At(key), target);
      continue;
    }
    const std::string_view nearest = NearestName(key, keys);
    if (nearest.empty()) {
      place.Fail(fmt::format("key {} of this object is unknown; known are {}", number, fmt::join(keys, ", ")));
    } else {
      place.At(key).Fail(fmt::format("unknown key; did you mean \"{}\"?", nearest));
    }
  }
}

template <typename Target>
Json WriteObject(const Target& source, const std::vector<Option<Target>>& table) {
  Json object = Json::object();
  for (const Option<Target>& option : table) {
    Json value = option.codec.write(source);
    if (!value.is_null()) object[std::string(option.key)] = std::move(value);
  }
  return object;
}

template void ReadObject(const Json&, const Place&, const std::vector<Option<Config>>&, Config&);
template void ReadObject(const Json&, const Place&, const std::vector<Option<DatasetConfig>>&, DatasetConfig&);
template void ReadObject(const Json&, const Place&, const std::vector<Option<ImageryConfig>>&, ImageryConfig&);
template void ReadObject(const Json&, const Place&, const std::vector<Option<DiskCacheConfig>>&, DiskCacheConfig&);
template void ReadObject(const Json&, const Place&, const std::vector<Option<SourceConfig>>&, SourceConfig&);
template void ReadObject(const Json&, const Place&, const std::vector<Option<TokenConfig>>&, TokenConfig&);
template Json WriteObject(const Config&, const std::vector<Option<Config>>&);
template Json WriteObject(const DatasetConfig&, const std::vector<Option<DatasetConfig>>&);
template Json WriteObject(const ImageryConfig&, const std::vector<Option<ImageryConfig>>&);
template Json WriteObject(const SourceConfig&, const std::vector<Option<SourceConfig>>&);
template Json WriteObject(const TokenConfig&, const std::vector<Option<TokenConfig>>&);
template Json WriteObject(const DiskCacheConfig&, const std::vector<Option<DiskCacheConfig>>&);

}  // namespace terrace::config
