// What a terrace server can be told, with its defaults: plain values, checked by parse.h or options.h before they get
// here.
//
// A Config is made once at the start and never changed afterwards; threads share it without locks.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/listen_address.h"

namespace terrace::config {

// What the heights of a source count from. Further values come with the conversions that they need.
enum class VerticalDatum : std::uint8_t { kUnknown };
// How the triangles of a tile are joined: tin::Criterion, which this room does not know.
enum class Criterion : std::uint8_t { kDelaunay, kDataDependent };
enum class LogLevel : std::uint8_t { kDebug, kInfo, kWarn, kError, kOff };
enum class LogFormat : std::uint8_t { kText, kJson };

struct DatasetConfig {
  std::string name;                  // the first part of its URLs: [A-Za-z0-9._-]{1,64}
  std::vector<std::string> sources;  // files, after globs are expanded; exactly one for now
  VerticalDatum vertical = VerticalDatum::kUnknown;
  std::string attribution;
  double error_fraction = 0.5;         // default error of a level, as a share of the error that clients assume there
  std::optional<double> finest_error;  // metres; decides the deepest level
  std::optional<double> floor;         // metres; height outside the source and in large voids
  int max_void_gap = 64;               // source samples; narrower voids are filled
  Criterion criterion = Criterion::kDelaunay;
  bool compact = false;  // tiles go through the drop pass

  friend bool operator==(const DatasetConfig&, const DatasetConfig&) = default;
};

// The page at "/". An empty directory stands for the one that is installed with the program.
struct ViewerConfig {
  bool enabled = true;
  std::filesystem::path directory;

  friend bool operator==(const ViewerConfig&, const ViewerConfig&) = default;
};

struct Config {
  ListenAddress listen{"127.0.0.1", 8080};
  std::vector<DatasetConfig> datasets;
  ViewerConfig viewer;
  std::string cache_control = "public, max-age=3600";

  unsigned io_threads = 2;      // sockets only; everything that computes runs on workers
  unsigned worker_threads = 0;  // 0: one per processor
  std::size_t queue_length = 256;
  std::size_t cache_bytes = std::size_t{256} << 20;             // 0: no cache
  std::size_t refinement_cache_bytes = std::size_t{128} << 20;  // 0: no cache
  std::size_t max_connections = 1024;
  std::size_t max_mesh_samples = 1'000'000;
  std::size_t max_locations = 10'000;  // in one request for heights

  std::chrono::milliseconds request_deadline{30'000};
  std::chrono::milliseconds header_timeout{5'000};
  std::chrono::milliseconds idle_timeout{30'000};
  std::chrono::milliseconds write_timeout{20'000};
  std::chrono::milliseconds drain_timeout{10'000};

  LogLevel log_level = LogLevel::kInfo;
  LogFormat log_format = LogFormat::kText;

  friend bool operator==(const Config&, const Config&) = default;
};

// One thing that is wrong. Config errors are collected and shown all together.
struct ConfigError {
  std::string path;     // JSON Pointer (RFC 6901) such as "/datasets/0/sources/1", or a flag such as "--listen"
  std::string message;  // what is wrong and what would be right

  friend bool operator==(const ConfigError&, const ConfigError&) = default;
};

// Empty if `name` can name a dataset, else what is wrong with it, to be read after the name.
std::string CheckDatasetName(const std::string& name);

// Turns any text, a file's stem for instance, into a valid dataset name: other characters become '-'.
std::string SanitizeDatasetName(const std::string& text);

// Names that more than one dataset has, each reported at the later dataset.
std::vector<ConfigError> FindDuplicateNames(const std::vector<DatasetConfig>& datasets);

}  // namespace terrace::config
