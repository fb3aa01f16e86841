#include "config/disk_cache_option.h"

#include "config/option_table.h"

namespace terrace::config {
namespace {

constexpr std::int64_t kMaxBytes = std::int64_t{1} << 40;
constexpr std::size_t kMinBytes = std::size_t{16} << 20;  // what a store of records needs to have several files

Codec<DiskCacheConfig> Directory() {
  return {[](const Json& value, const Place& place, DiskCacheConfig& cache) {
            if (!value.is_string() || value.get_ref<const std::string&>().empty()) {
              return place.Expected("the path of a directory");
            }
            cache.directory = place.Resolve(value.get<std::string>());
          },
          [](const DiskCacheConfig& cache) { return Json(cache.directory); }, TextToJson};
}

Codec<DiskCacheConfig> FileBytes(std::size_t DiskCacheConfig::*member) {
  Codec<DiskCacheConfig> codec = Bytes(member, kMaxBytes);
  codec.read = [read_bytes = codec.read, member](const Json& value, const Place& place, DiskCacheConfig& cache) {
    read_bytes(value, place, cache);
    if (cache.*member > 0 && cache.*member < kMinBytes) {
      place.Fail(fmt::format("must be 0, which keeps none, or at least {} (16 MiB)", kMinBytes));
    }
  };
  return codec;
}

const std::vector<Option<DiskCacheConfig>>& DiskCacheOptionTable() {
  static const std::vector<Option<DiskCacheConfig>> table = {
      {"directory", "DIR", "Where; used by one server at a time", Directory()},
      {"tile_bytes", "BYTES", "Disk for finished tiles; 0 is none", FileBytes(&DiskCacheConfig::tile_bytes)},
      {"refinement_bytes", "BYTES", "Disk for the refinements that tiles are made from; 0 is none",
       FileBytes(&DiskCacheConfig::refinement_bytes)},
  };
  return table;
}

}  // namespace

Codec<Config> DiskCacheOption() {
  return {[](const Json& value, const Place& place, Config& config) {
            if (!value.is_object()) return place.Expected(R"({"directory": "/var/cache/terrace"})");
            ReadObject(value, place, DiskCacheOptionTable(), config.disk_cache);
            if (!value.contains("directory")) place.Fail("\"directory\" is missing: where the cache is kept");
          },
          [](const Config& config) {
            return config.disk_cache.directory.empty() ? Json()
                                                       : WriteObject(config.disk_cache, DiskCacheOptionTable());
          },
          [](const std::string& text) {
            return Json{{"directory", text}};
          }};
}

}  // namespace terrace::config
