#include "server/cli/common/open_cache.h"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <memory>
#include <string>
#include <system_error>

#include "config/common/cache_place.h"
#include "engine/common/averages_budget.h"
#include "engine/statistics/cache_folder.h"
#include "server/cli/common/check_folder.h"

namespace terrace::cli {

dem::RasterCache OpenStatisticsCache(const config::Config& config) {
  dem::RasterCache cache;
  cache.memory = std::make_shared<dem::AveragesBudget>();
  const auto none = [&](const std::string& why) {
    spdlog::info("cache_dir: none, {}; averages of sources are kept in memory as far as they fit", why);
    return cache;
  };
  if (config.cache_dir.empty() || config.cache_dir_bytes == 0) return none("as the configuration says");
  std::string place = config.cache_dir;
  if (place == config::kDefaultCacheDir) {
    place = config::CacheDirFromEnvironment();
    if (place.empty()) return none("as neither CACHE_DIRECTORY nor XDG_CACHE_HOME nor HOME names a folder");
    std::error_code unknown;
    const bool exists = std::filesystem::is_directory(place, unknown);
    if (const auto folder = CheckFolder(place); !exists && !folder) return none(folder.error().message);
  }
  spdlog::info("cache_dir: {}, for up to {} MiB of statistics and averages of sources", place,
               config.cache_dir_bytes >> 20);
  cache.folder = std::make_shared<dem::CacheFolder>(place, config.cache_dir_bytes);
  return cache;
}

}  // namespace terrace::cli
