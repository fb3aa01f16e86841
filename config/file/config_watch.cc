#include "config/file/config_watch.h"

#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <iterator>

#include "config/input/source_paths.h"

namespace terrace::config {
namespace {

// File times advance in ticks of up to 10 ms, or of a second on old file systems: a file that was read within this time
// after a change may have changed again without a new stamp.
constexpr std::int64_t kFreshNs = 2'000'000'000;

std::int64_t InNanoseconds(const timespec& time) { return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec; }

}  // namespace

std::int64_t ConfigWatch::SystemTimeNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::optional<ConfigWatch::Stamp> ConfigWatch::StampOf(const std::filesystem::path& file) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
  return Stamp{status.st_dev, status.st_ino, static_cast<std::uint64_t>(status.st_size), InNanoseconds(status.st_mtim),
               InNanoseconds(status.st_ctim)};
}

ConfigResult ConfigWatch::Load() {
  // Taken before the file is read, so that the next check notices a change during the read.
  stamp_ = StampOf(file_);
  is_fresh_ = stamp_ && std::abs(now_ns_() - stamp_->status_changed_ns) < kFreshNs;
  is_loaded_ = false;
  ConfigResult loaded = load_();
  is_loaded_ = loaded.has_value();
  expandable_.clear();
  if (!loaded) return loaded;
  for (const DatasetConfig& dataset : loaded->datasets) {
    std::copy_if(dataset.sources.begin(), dataset.sources.end(), std::back_inserter(expandable_), IsExpanded);
  }
  return loaded;
}

bool ConfigWatch::MayHaveChanged() const {
  if (!is_loaded_ || is_fresh_ || StampOf(file_) != stamp_) return true;
  return std::any_of(expandable_.begin(), expandable_.end(), HoldsOtherFiles);
}

}  // namespace terrace::config
