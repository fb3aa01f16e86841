#include "server/tiles/dataset_view.h"

#include <algorithm>
#include <array>

namespace terrace::server {

bool IsAvailable(const DatasetView& dataset, const geo::TileKey& key) {
  if (!geo::IsValid(key) || key.level > dataset.max_level()) return false;
  const auto& ranges = dataset.available[static_cast<std::size_t>(key.level)];
  return std::any_of(ranges.begin(), ranges.end(), [&](const geo::TileRange& range) { return range.Contains(key); });
}

bool IsReservedName(std::string_view name) {
  static constexpr std::array<std::string_view, 5> kReserved = {"datasets", "viewer", "livez", "readyz", "metrics"};
  return std::find(kReserved.begin(), kReserved.end(), name) != kReserved.end();
}

}  // namespace terrace::server
