#include "tiler/tile/tile_request.h"

namespace terrace::tiler {
namespace {

// The finalizer of SplitMix64: every input bit reaches every output bit, so that shards and buckets fill evenly.
std::uint64_t Mix(std::uint64_t value) {
  value = (value ^ (value >> 30)) * 0xbf58476d1ce4e5b9;
  value = (value ^ (value >> 27)) * 0x94d049bb133111eb;
  return value ^ (value >> 31);
}

}  // namespace

std::size_t TileRequestHash::operator()(const TileRequest& request) const noexcept {
  const auto variant =
      static_cast<std::uint64_t>(request.side_px) << 48 | static_cast<std::uint64_t>(request.height_encoding) << 40 |
      static_cast<std::uint64_t>(request.texture) << 32 | static_cast<std::uint64_t>(request.compression) << 24 |
      static_cast<std::uint64_t>(request.format) << 16 | static_cast<std::uint64_t>(request.coding) << 8 |
      static_cast<std::uint64_t>(request.extensions.normals) |
      static_cast<std::uint64_t>(request.extensions.water_mask) << 1 |
      static_cast<std::uint64_t>(request.extensions.metadata) << 2;
  std::uint64_t hash = Mix(request.dataset + 0x9e3779b97f4a7c15);
  hash = Mix(hash ^ static_cast<std::uint64_t>(request.key.level));
  hash = Mix(hash ^ static_cast<std::uint64_t>(request.key.x));
  hash = Mix(hash ^ static_cast<std::uint64_t>(request.key.y));
  hash = Mix(hash ^ static_cast<std::uint64_t>(static_cast<std::int64_t>(request.error_step)));
  if (IsMapLayer(request.format)) {
    const MapParameters& map = request.map;
    hash = Mix(hash ^ (static_cast<std::uint64_t>(map.interval_cm) << 32 |
                       static_cast<std::uint64_t>(map.z_factor_hundredths) << 16 | map.azimuth_deg));
    hash = Mix(hash ^ (static_cast<std::uint64_t>(map.altitude_deg) << 16 |
                       static_cast<std::uint64_t>(map.slope_style) << 8 | static_cast<std::uint64_t>(map.picture)));
  }
  return static_cast<std::size_t>(Mix(hash ^ variant));
}

}  // namespace terrace::tiler
