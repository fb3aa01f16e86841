// The configuration of a server, with its defaults: plain values that file/parse.h or options/options.h have checked.
// A Config is not changed once threads share it, so they need no locks. A reload makes a new one.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/common/listen_address.h"
#include "engine/common/dem_types.h"
#include "engine/tin/criterion.h"
#include "proto/gltf/gltf_types.h"

namespace terrace::config {

// The samples of a source that are voids, in addition to those that a mask hides.
struct NodataConfig {
  bool detect = true;               // detects undeclared nodata values
  std::vector<double> values = {};  // further raw values that are voids

  friend bool operator==(const NodataConfig&, const NodataConfig&) = default;
};

// The header that trusted proxies write. Only one is used, because a proxy forwards the other one as the client sent
// it.
enum class ForwardedHeader : std::uint8_t { kXForwarded, kForwarded };
enum class LogLevel : std::uint8_t { kDebug, kInfo, kWarn, kError, kOff };
enum class LogFormat : std::uint8_t { kText, kJson };
// The destination and format of the access log.
enum class AccessLogForm : std::uint8_t { kLog, kCombined, kJson, kOff };

// The source of a dataset's water mask: a raster, a sea level, or none.
struct WaterConfig {
  std::string mask;                 // a raster that is not zero on water; empty: none
  std::optional<double> sea_level;  // metres in the source's vertical datum; heights at or below it are water

  bool any() const { return !mask.empty() || sea_level.has_value(); }
  friend bool operator==(const WaterConfig&, const WaterConfig&) = default;
};

// The image from which textures of GLB tiles are made.
struct ImageryConfig {
  std::string image;  // empty: none
  std::string attribution;
  proto::TextureFormat texture = proto::TextureFormat::kJpeg;  // for requests that name none
  int size = 512;                                              // limit of pixels along the edge of a tile
  int quality = 80;

  friend bool operator==(const ImageryConfig&, const ImageryConfig&) = default;
};

// One entry of a dataset's sources: a file, a glob or a folder. Its files are of equal rank.
struct SourceConfig {
  SourceConfig() = default;
  // One file. Implicit, because a path is a source.
  SourceConfig(std::string file) : path(std::move(file)), files{path} {}  // NOLINT(google-explicit-constructor)
  SourceConfig(const char* file) : SourceConfig(std::string(file)) {}     // NOLINT(google-explicit-constructor)

  std::string path;                // of a file or a folder, or a glob; absolute
  std::vector<std::string> files;  // the files that it stands for
  bool is_folder = false;          // files that are not rasters are left out
  // Default: the option of the dataset.
  std::optional<std::string> vertical = {};
  std::optional<NodataConfig> nodata = {};

  friend bool operator==(const SourceConfig&, const SourceConfig&) = default;
};

struct DatasetConfig {
  std::string name;                   // the first part of its URLs: [A-Za-z0-9._-]{1,64}
  std::vector<SourceConfig> sources;  // where several have a height, the first one is used; none: `baked` alone
  std::vector<std::string> edits;     // GeoJSON files, absolute; later edits over earlier ones
  std::string baked;                  // place of an archive with finished tiles; empty: none
  std::string vertical = "crs";       // vertical datum: a keyword, "EPSG:5703", or the path of a grid
  NodataConfig nodata;
  std::string attribution;
  double error_fraction = 0.5;         // default error of a level, as a share of the error that clients assume there
  std::optional<double> finest_error;  // metres; decides the deepest level
  std::optional<double> floor;         // metres; height outside the source and in collars
  int max_void_gap = 64;               // source samples; narrower voids are filled
  dem::HoleFill voids = dem::HoleFill::kSmooth;  // surface in larger voids with data all around them
  double feather = 0;  // metres: width of the blend between a source and the next one, inwards from its edges
  tin::Criterion criterion = tin::Criterion::kDelaunay;
  bool compact = false;                                                   // vertices are removed (engine/tin/decimate)
  proto::GlbCompression glb_compression = proto::GlbCompression::kDraco;  // for requests that name none
  int draco_speed = 7;                                                    // 0 smallest tiles .. 10 fastest
  int draco_normal_bits = 8;                                              // of each of the two coordinates of a normal
  WaterConfig water;
  ImageryConfig imagery;
  bool is_public = false;         // visible without a token even if there are tokens
  int metadata_availability = 0;  // levels; tiles at multiples of this level list the tiles below them; 0: none

  friend bool operator==(const DatasetConfig&, const DatasetConfig&) = default;
};

// The page at "/". Empty directory: the viewer that is installed with the program.
struct ViewerConfig {
  bool enabled = true;
  std::filesystem::path directory;

  friend bool operator==(const ViewerConfig&, const ViewerConfig&) = default;
};

// A cache of tiles and refinements on disk, which outlives the process.
struct DiskCacheConfig {
  std::string directory;                                // empty: none
  std::size_t tile_bytes = std::size_t{8} << 30;        // of files; 0: no tiles
  std::size_t refinement_bytes = std::size_t{4} << 30;  // of files; 0: no refinements

  friend bool operator==(const DiskCacheConfig&, const DiskCacheConfig&) = default;
};

// A cache of finished tiles that servers share: a Redis.
struct SharedCacheConfig {
  std::string url;            // redis://[user@]HOST:PORT/DATABASE, or rediss://; without a password; empty: none
  std::string password_file;  // its first line is the password; empty: the environment's
  std::string ca_file;        // PEM; empty: the system's authorities
  int timeout_ms = 25;        // of a look-up
  double min_build_ms = 2;    // cheaper tiles are not stored
  std::size_t max_bytes_per_tile = std::size_t{256} << 10;  // larger tiles are not stored
  std::chrono::milliseconds ttl{7 * 86'400'000};            // of a tile; 0: as long as Redis keeps it
  int lease_ms = 0;  // how long a server waits for a tile that another one builds; 0: it builds the tile itself

  friend bool operator==(const SharedCacheConfig&, const SharedCacheConfig&) = default;
};

// A token that gives access to datasets.
struct TokenConfig {
  std::string name;                   // in the log
  std::string sha256;                 // TokenHash of the token, which is not stored
  std::vector<std::string> datasets;  // empty: all
  double requests_per_second = 0;     // 0: the server's limit

  friend bool operator==(const TokenConfig&, const TokenConfig&) = default;
};

// PEM files; empty: plain HTTP.
struct TlsConfig {
  std::string certificate, key;

  friend bool operator==(const TlsConfig&, const TlsConfig&) = default;
};

// Means the default folder of common/cache_place.h.
inline constexpr std::string_view kDefaultCacheDir = "default";

struct Config {
  ListenAddress listen{"127.0.0.1", 8080};
  std::optional<ListenAddress> admin_listen;  // of operators; nothing: none
  unsigned admin_socket_mode = 0600;          // of its file, if it is a path
  std::vector<DatasetConfig> datasets;
  ViewerConfig viewer;
  std::string cache_control = "public, max-age=3600";

  unsigned io_threads = 2;      // sockets only; everything that computes runs on workers
  unsigned worker_threads = 0;  // 0: one per processor
  std::size_t queue_length = 10'000;
  std::size_t cache_bytes = std::size_t{256} << 20;             // 0: no cache
  std::size_t refinement_cache_bytes = std::size_t{128} << 20;  // 0: no cache
  DiskCacheConfig disk_cache;
  SharedCacheConfig shared_cache;
  std::string cache_dir = std::string(kDefaultCacheDir);  // folder of the statistics cache; empty: none
  std::size_t cache_dir_bytes = std::size_t{8} << 30;     // limit of its files; 0: no cache
  std::size_t gdal_cache_bytes = std::size_t{256} << 20;  // blocks of sources
  std::size_t max_open_sources = 256;                     // files of all datasets kept open between reads
  std::size_t max_connections = 1024;
  std::size_t max_connections_per_client = 0;          // 0: no limit per client
  std::size_t transfer_bytes = std::size_t{32} << 20;  // memory for bodies in transfer
  double requests_per_second = 0;                      // of each client or token; 0: no limit
  double request_burst = 0;                            // 0: two seconds' worth
  std::size_t max_mesh_samples = 1025 * 1025;          // a height map of a Unity terrain
  std::size_t max_locations = 10'000;                  // in one request for heights, or rays of one for sight

  std::vector<TokenConfig> tokens;  // none: all datasets are public
  std::vector<std::string> cors_origins = {"*"};
  std::vector<std::string> trusted_proxies;  // addresses and ranges
  ForwardedHeader forwarded_header = ForwardedHeader::kXForwarded;
  TlsConfig tls;

  std::chrono::milliseconds request_deadline{30'000};
  std::chrono::milliseconds header_timeout{5'000};
  std::chrono::milliseconds idle_timeout{30'000};
  std::chrono::milliseconds write_timeout{20'000};
  std::size_t min_read_rate = 4096;  // bytes per second; 0: no limit
  std::chrono::milliseconds drain_delay{0};
  std::chrono::milliseconds drain_timeout{10'000};

  std::vector<std::string> data_roots;        // folders that hold every source; none: any folder
  std::vector<std::string> allowed_prefixes;  // of remote sources; none: no remote sources
  std::vector<std::string> allowed_drivers;   // GDAL's short names of drivers; none: the default drivers

  bool watch = true;  // watch sources and the configuration file for changes

  LogLevel log_level = LogLevel::kInfo;
  LogFormat log_format = LogFormat::kText;
  AccessLogForm access_log = AccessLogForm::kLog;
  std::string access_log_file;  // of kCombined and kJson; empty: stderr

  friend bool operator==(const Config&, const Config&) = default;
};

// One error in the configuration. All errors (at most kMaxConfigErrors) are collected and shown together.
struct ConfigError {
  std::string path;     // JSON Pointer (RFC 6901) such as "/datasets/0/sources/1", or a flag such as "--listen"
  std::string message;  // what is wrong and how to correct it

  std::string Text() const { return path.empty() ? message : path + ": " + message; }
  friend bool operator==(const ConfigError&, const ConfigError&) = default;
};

// Returns what is wrong with the name of a dataset; empty: nothing.
std::string CheckDatasetName(const std::string& name);

// Converts any text, such as a file's stem, to a valid dataset name: invalid characters become '-'.
std::string SanitizeDatasetName(const std::string& text);

// Finds names that several datasets have. Each is reported at the later dataset.
std::vector<ConfigError> FindDuplicateNames(const std::vector<DatasetConfig>& datasets);

}  // namespace terrace::config
