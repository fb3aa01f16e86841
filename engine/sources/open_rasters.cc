#include "engine/sources/open_rasters.h"

#include <cpl_conv.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>

#include "engine/common/parallel_for.h"
#include "engine/common/source_log.h"
#include "engine/core/ascii.h"
#include "engine/gdal/driver_list.h"
#include "engine/gdal/raster_file.h"
#include "engine/gdal/source_policy.h"

namespace terrace::dem {
namespace {

// File extensions of rasters: a file with one of them that is not a raster is probably damaged.
bool LooksLikeRaster(const std::string& path) {
  constexpr std::string_view kEndings[] = {".tif", ".tiff", ".hgt", ".hgt.zip", ".hgt.gz", ".dt0", ".dt1",
                                           ".dt2", ".dem",  ".asc", ".img",     ".bil",    ".flt", ".nc"};
  std::string name = path;
  std::ranges::transform(name, name.begin(), ToLower);
  return std::ranges::any_of(kEndings, [&](std::string_view ending) { return name.ends_with(ending); });
}

// The reason why a file of a folder is left out.
struct LeftOut {
  bool looks_like_raster = false;
  std::string text;
};

// Nothing: the file is used.
std::optional<LeftOut> LeftOutOf(const DemFile& file) {
  if (!file.skip_if_no_raster) return std::nullopt;
  if (!IsOneLine(file.path)) {
    return LeftOut{true, EscapeControls(file.path) + " (a control character in its name: rename it)"};
  }
  if (IsRaster(file.path)) return std::nullopt;
  if (const auto format = LeftOutDriverOf(file.path)) {
    return LeftOut{true, fmt::format("{} ({} is not among the allowed_drivers)", file.path, *format)};
  }
  if (LooksLikeRaster(file.path)) {
    return LeftOut{true, file.path + " (no raster, whatever its name says: is it whole?)"};
  }
  return LeftOut{false, file.path};
}

void LogFiles(spdlog::level::level_enum level, const std::vector<std::string>& names) {
  constexpr std::size_t kMaxNamed = 5;
  if (names.empty()) return;
  const auto end = names.begin() + static_cast<std::ptrdiff_t>(std::min(names.size(), kMaxNamed));
  spdlog::log(level, "left out of a folder: {}{}", fmt::join(names.begin(), end, ", "),
              names.size() > kMaxNamed ? fmt::format(" and {} more", names.size() - kMaxNamed) : "");
}

// Files of folders that are no rasters, with reasons.
struct LeftOutFiles {
  std::vector<std::string> missed, others;  // look like rasters; do not

  void Log() const {
    LogFiles(spdlog::level::warn, missed);
    LogFiles(spdlog::level::debug, others);
  }
};

// Removes them from `files`.
LeftOutFiles LeaveOutOthers(std::vector<DemFile>& files) {
  std::vector<std::optional<LeftOut>> verdicts(files.size());
  ParallelFor(files.size(), [&](std::size_t i) {
    verdicts[i] = LeftOutOf(files[i]);
    return true;
  });
  LeftOutFiles left_out;
  std::vector<DemFile> kept;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (verdicts[i]) {
      (verdicts[i]->looks_like_raster ? left_out.missed : left_out.others).push_back(std::move(verdicts[i]->text));
    } else {
      kept.push_back(std::move(files[i]));
    }
  }
  files = std::move(kept);
  return left_out;
}

// Limits, in bytes, of a dataset's statistics: kept in memory, and paged. A raster of 3600 x 3600 samples takes 70 to
// 90 KB.
constexpr std::size_t kKeptTables = std::size_t{192} << 20, kPagedTables = std::size_t{64} << 20;

// Files are opened on as many threads as there are cores. A few large files leave cores to their statistics. The limit
// is one of memory: each thread holds the samples of a chunk, their sums and their averages.
unsigned ThreadsOfEach(std::size_t files) {
  constexpr std::size_t kMaxThreads = 8;
  return static_cast<unsigned>(std::clamp<std::size_t>(std::thread::hardware_concurrency() / files, 1, kMaxThreads));
}

tl::unexpected<Error> LackOfHeights(const RasterSource& raster) {
  return MakeError(ErrorCode::kNotFound, "{}", raster.DescribeLackOfHeights());
}

// Opens files from several threads.
class Opening {
 public:
  using Opened = Result<std::unique_ptr<RasterSource>>;

  Opening(const std::vector<DemFile>& files, const DemOptions& options, bool only_cached)
      : files_(files),
        options_(options),
        only_cached_(only_cached),
        threads_(ThreadsOfEach(files.size())),
        shares_(files.size()),
        opened_(files.size()) {}

  // Returns false after a fatal error. Files before this one are still opened, because the error of the first file
  // counts.
  bool Open(std::size_t i) {
    const SourceLog::Use use(log_);
    std::stop_source stop;
    const std::stop_callback stopped(options_.stop, [&stop] { stop.request_stop(); });
    {
      const std::lock_guard lock(mutex_);
      running_.emplace(i, stop);
    }
    Opened opened = RasterSource::Open(files_[i].path, files_[i].options.value_or(options_.source), options_.cache,
                                       ProgressOf(i), stop.get_token(), pages_, threads_, only_cached_);
    if (options_.progress) AddProgress(i, 1);
    // Datasets that are split into files may have files without a height.
    if (opened && !(*opened)->has_heights() && !files_[i].skip_if_no_raster) opened = LackOfHeights(**opened);
    const bool goes_on = opened || LacksStatistics(opened) || (options_.fault && !options_.stop.stop_requested());
    const std::lock_guard lock(mutex_);
    running_.erase(i);
    if (!goes_on) {
      for (auto later = running_.upper_bound(i); later != running_.end(); ++later) later->second.request_stop();
    }
    opened_[i] = std::move(opened);
    return goes_on;
  }

  bool LacksStatistics(const Opened& opened) const {
    return only_cached_ && !options_.stop.stop_requested() && !opened && opened.error().code == ErrorCode::kCancelled;
  }

  // Nothing: not begun.
  std::vector<std::optional<Opened>>& opened() { return opened_; }
  // Writes the lines that were held back.
  void Log() { log_.Release(); }

 private:
  std::function<void(double)> ProgressOf(std::size_t i) {
    if (!options_.progress) return {};
    return [this, i](double share) { AddProgress(i, share); };
  }

  // A pass over a file may restart.
  void AddProgress(std::size_t i, double share) {
    const std::lock_guard lock(mutex_);
    done_ += share - std::exchange(shares_[i], share);
    options_.progress(done_ / static_cast<double>(files_.size()));
  }

  const std::vector<DemFile>& files_;
  const DemOptions& options_;
  const bool only_cached_;
  const unsigned threads_;  // of each file
  const std::shared_ptr<StatisticsPages> pages_ = std::make_shared<StatisticsPages>(kKeptTables, kPagedTables);
  SourceLog log_{only_cached_};  // if statistics are missing, the files are opened again, and log then
  std::mutex mutex_;
  std::map<std::size_t, std::stop_source> running_;  // guarded by mutex_, as are these
  std::vector<double> shares_;                       // done of each file
  double done_ = 0;                                  // their sum
  std::vector<std::optional<Opened>> opened_;
};

}  // namespace

Result<Rasters> OpenRasters(std::vector<DemFile>& files, const DemOptions& options, std::vector<std::string>& left_out,
                            bool only_cached) {
  const std::string folder = EscapeControls(std::filesystem::path(files.front().path).parent_path().string());
  LeftOutFiles others = LeaveOutOthers(files);
  // If statistics are missing, the files are opened once more, and told then.
  if (!only_cached) others.Log();
  if (files.empty()) {
    if (only_cached) others.Log();
    return MakeError(ErrorCode::kNotFound,
                     "{}: none of the files in this folder is a raster; name a folder of rasters or a raster", folder);
  }
  Opening opening(files, options, only_cached);
  ParallelFor(files.size(), [&opening](std::size_t i) { return opening.Open(i); });
  Rasters rasters;
  std::vector<DemFile> kept;
  std::optional<Error> fault;    // the first
  std::optional<Error> lacking;  // the first file without statistics
  for (std::size_t i = 0; i < files.size() && opening.opened()[i]; ++i) {
    Opening::Opened& opened = *opening.opened()[i];
    if (opened && !lacking && !fault && i + 1 == files.size() && !(*opened)->has_heights() &&
        std::ranges::none_of(rasters, [](const auto& raster) { return raster->has_heights(); })) {
      opened = LackOfHeights(**opened);
    }
    if (opened) {
      rasters.push_back(*std::move(opened));
    } else if (opening.LacksStatistics(opened)) {
      if (!lacking) lacking = opened.error();
    } else {
      if (only_cached) others.Log(), opening.Log();
      if (!options.fault || options.stop.stop_requested()) return tl::unexpected(opened.error());
      options.fault(opened.error());
      if (!fault) fault = opened.error();
    }
    kept.push_back(std::move(files[i]));
  }
  if (lacking) return tl::unexpected(*std::move(lacking));
  if (only_cached) others.Log(), opening.Log();
  left_out = std::move(others.missed);
  if (fault) return tl::unexpected(*std::move(fault));
  files = std::move(kept);
  return rasters;
}

void LogLeftOut(const std::vector<std::string>& texts) { LogFiles(spdlog::level::warn, texts); }

}  // namespace terrace::dem
