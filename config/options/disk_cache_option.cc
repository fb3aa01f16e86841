#include "config/options/option_table.h"

namespace terrace::config {
namespace {

constexpr std::int64_t kMaxBytes = std::int64_t{1} << 40;
constexpr std::size_t kMinBytes = std::size_t{16} << 20;  // the smallest size for which a store has several files

Codec<DiskCacheConfig> FileBytes(std::size_t DiskCacheConfig::*member) {
  Codec<DiskCacheConfig> codec = Bytes(member, kMaxBytes);
  codec.read = [read_bytes = codec.read, member](const Json& value, const ConfigLocation& place,
                                                 DiskCacheConfig& cache) {
    read_bytes(value, place, cache);
    if (cache.*member > 0 && cache.*member < kMinBytes) {
      place.Fail(fmt::format("must be 0, which keeps none, or at least {} (16 MiB)", kMinBytes));
    }
  };
  return codec;
}

}  // namespace

const std::vector<Option<DiskCacheConfig>>& DiskCacheOptionTable() {
  static const std::vector<Option<DiskCacheConfig>> table = {
      {.key = "directory",
       .value = "DIR",
       .help = "Folder of the cache; only one server at a time can use it",
       .details = "The server creates it if it is missing. It should contain nothing else. A second server with the "
                  "same folder does not start",
       .codec = Path(&DiskCacheConfig::directory, "the path of a directory"),
       .missing = ": where the cache is kept"},
      {.key = "tile_bytes",
       .value = "BYTES",
       .help = "Disk for finished tiles; 0 keeps none",
       .details = "At least 16 MiB, or 0",
       .codec = FileBytes(&DiskCacheConfig::tile_bytes)},
      {.key = "refinement_bytes",
       .value = "BYTES",
       .help = "Disk for refinements, the records from which a tile is made at any error; 0 keeps none",
       .details = "At least 16 MiB, or 0: about 50 kB a tile at default errors. With refinements on disk, another "
                  "error, format or coding of a tile takes little time after a restart as well",
       .codec = FileBytes(&DiskCacheConfig::refinement_bytes)},
  };
  return table;
}

Codec<Config> DiskCacheCodec() {
  return ObjectOf(&Config::disk_cache, &DiskCacheConfig::directory, DiskCacheOptionTable(),
                  R"({"directory": "/var/cache/terrace/tiles"})");
}

}  // namespace terrace::config
