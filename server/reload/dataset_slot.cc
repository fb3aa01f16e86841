#include "server/reload/dataset_slot.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <system_error>
#include <utility>

#include "archive/archive.h"
#include "engine/gdal/stamped_files.h"
#include "server/tiles/catalog.h"
#include "tiler/encoder_version.h"
#include "tiler/store/baked_tiles.h"

namespace terrace::server {
namespace {

// A file that was written to within this time may be incomplete.
constexpr std::chrono::nanoseconds kSettleTime = std::chrono::seconds(1);
// Delay between attempts at unchanged files; doubled each time.
constexpr std::chrono::seconds kFirstRetry{1}, kLastRetry{60};
// Delay between reopenings after data in the cache folder was lost or an archive was replaced; doubled each time,
// because the loss may recur.
constexpr std::chrono::minutes kFirstRecovery{1}, kLastRecovery{60};
// A replacement that takes longer than this is reported as kReopening.
constexpr std::chrono::seconds kPatience{10};
// Opening a large source keeps a processor busy: building tiles has priority.
constexpr int kNiceness = 10;

std::vector<tiler::WatchedFile> FilesOf(const tiler::Dataset& dataset) {
  std::vector<tiler::WatchedFile> files = dataset.baked_files;
  const auto add = [&](const dem::StampedFiles& more) {
    for (std::size_t i = 0; i < more.size(); ++i) files.push_back({more.path(i), more.stamp(i)});
  };
  if (dataset.model) add(dataset.model->files());
  if (dataset.water.mask) add(dataset.water.mask->files());
  if (dataset.imagery.image) add(dataset.imagery.image->files());
  return files;
}

// The files that the configuration names. Other files that GDAL reads are not known before the source is open.
std::vector<std::string> NamedFiles(const config::DatasetConfig& dataset) {
  std::vector<std::string> files;
  for (const config::SourceConfig& source : dataset.sources) {
    files.insert(files.end(), source.files.begin(), source.files.end());
  }
  files.insert(files.end(), dataset.edits.begin(), dataset.edits.end());
  if (!dataset.water.mask.empty()) files.push_back(dataset.water.mask);
  if (!dataset.imagery.image.empty()) files.push_back(dataset.imagery.image);
  if (!dataset.baked.empty()) {
    const std::vector<std::string> baked = archive::Archive::FilesOf(dataset.baked);
    files.insert(files.end(), baked.begin(), baked.end());
  }
  return files;
}

// For messages.
const std::string& PlaceOf(const config::DatasetConfig& dataset) {
  return dataset.sources.empty() ? dataset.baked : dataset.sources.front().path;
}

std::vector<std::optional<dem::FileStamp>> StampsOf(const std::vector<std::string>& files) {
  std::vector<std::optional<dem::FileStamp>> stamps;
  for (const std::string& file : files) stamps.push_back(dem::StampOf(file));
  return stamps;
}

Result<tiler::Dataset> OpenQuietly(const DatasetOpener& open, const config::DatasetConfig& wanted,
                                   std::stop_token stop) {
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNiceness);  // on Linux, only of this thread
  try {
    return open(wanted, std::move(stop));
  } catch (const std::exception& exception) {
    return MakeError(ErrorCode::kInternal, "{}", exception.what());
  }
}

}  // namespace

DatasetSlot::DatasetSlot(config::DatasetConfig wanted, tiler::Dataset serving)
    : wanted_(std::move(wanted)), serving_(std::move(serving)), files_(FilesOf(*serving_)) {}

DatasetSlot::DatasetSlot(config::DatasetConfig wanted, std::future<Result<tiler::Dataset>> opening,
                         std::stop_source stop)
    : wanted_(std::move(wanted)),
      opening_(std::move(opening)),
      stop_opening_(std::move(stop)),
      tried_(StampsOf(KnownFiles())) {}

DatasetSlot::~DatasetSlot() { stop_opening_.request_stop(); }

std::string DatasetSlot::Problem(Clock::time_point now) const {
  const bool is_tried_again = !serving_ && is_opening();
  if (!problem_.empty() && !is_tried_again) return problem_;
  if (serving_ && stale_since_ && now - *stale_since_ > kPatience) return kReopening;
  return {};
}

void DatasetSlot::MarkStale() {
  if (!stale_since_) stale_since_ = Clock::now();
}

void DatasetSlot::Want(config::DatasetConfig wanted) {
  wanted_ = std::move(wanted);
  files_.clear();  // perhaps not those of the wanted dataset
  next_file_ = 0;
  MarkStale();
  StopOpening();
  tried_.clear();
  retry_at_ = {};
}

void DatasetSlot::StopOpening() {
  reopen_ = is_opening();
  stop_opening_.request_stop();
}

std::size_t DatasetSlot::CheckFiles(std::size_t max_files) {
  if (!serving_ || stale_since_) return 0;
  if (HasToRecover()) {
    MarkStale();
    return 0;
  }
  const std::size_t count = std::min(max_files, files_.size());
  for (std::size_t i = 0; i < count; ++i) {
    const auto& [path, stamp] = files_[next_file_];
    next_file_ = (next_file_ + 1) % files_.size();
    const std::optional<dem::FileStamp> now = dem::StampOf(path);
    if (now == stamp) continue;
    spdlog::info("dataset {}: {} {}", wanted_.name, path, !now ? "is gone" : stamp ? "has changed" : "is new");
    MarkStale();
    return i + 1;
  }
  return count;
}

bool DatasetSlot::HasToRecover() {
  if (Clock::now() < recover_at_) return false;
  const bool has_lost_cache = serving_->model && serving_->model->has_lost_cache();
  if (!has_lost_cache && !(serving_->baked && serving_->baked->is_outdated())) return false;
  spdlog::info("dataset {}: {}; reopening the dataset", wanted_.name,
               has_lost_cache ? "its statistics in cache_dir are missing"
                              : "its archive is no longer the one that was opened, or cannot be read");
  recover_delay_ = std::clamp<Clock::duration>(2 * recover_delay_, kFirstRecovery, kLastRecovery);
  recover_at_ = Clock::now() + recover_delay_;
  return true;
}

// The named files, and the others of the dataset that is served, such as the rasters of edits.
std::vector<std::string> DatasetSlot::KnownFiles() const {
  std::vector<std::string> files = NamedFiles(wanted_);
  for (const tiler::WatchedFile& file : files_) files.push_back(file.path);
  std::ranges::sort(files);
  files.erase(std::unique(files.begin(), files.end()), files.end());
  return files;
}

// Also true for times in the future, which say nothing.
bool DatasetSlot::IsSettled() {
  for (const std::string& file : KnownFiles()) {
    const auto stamp = dem::StampOf(file);
    if (!stamp) continue;
    // Read after the stamp: otherwise a file written to in between would have a time in the future.
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    const auto age = now - std::chrono::nanoseconds(stamp->modified_ns);
    if (age < std::chrono::nanoseconds(0) || age >= kSettleTime) continue;
    if (!std::exchange(said_unsettled_, true)) {
      spdlog::info("dataset {}: {} was written to a moment ago, waiting until it is complete", wanted_.name, file);
    }
    return false;
  }
  said_unsettled_ = false;
  return true;
}

void DatasetSlot::OpenIfDue(const DatasetOpener& open) {
  if (is_opening() || (serving_ && !stale_since_)) return;
  if (Clock::now() < retry_at_ && StampsOf(KnownFiles()) == tried_) return;
  if (!IsSettled()) return;
  spdlog::info("dataset {}: opening {}", wanted_.name, PlaceOf(wanted_));
  tried_ = StampsOf(KnownFiles());
  stop_opening_ = std::stop_source();
  try {
    opening_ = std::async(std::launch::async, OpenQuietly, open, wanted_, stop_opening_.get_token());
  } catch (const std::system_error& error) {
    Fail({ErrorCode::kUnavailable, fmt::format("no thread to open it on: {}", error.code().message())});
  } catch (const std::exception& exception) {
    Fail({ErrorCode::kUnavailable, fmt::format("it cannot be begun: {}", exception.what())});
  }
}

void DatasetSlot::Fail(const Error& error) {
  retry_delay_ = std::clamp<Clock::duration>(2 * retry_delay_, kFirstRetry, kLastRetry);
  retry_at_ = Clock::now() + retry_delay_;
  if (std::exchange(problem_, error.message) == error.message) return;
  spdlog::warn("dataset {}: cannot be opened: {}; {}; the server tries again", wanted_.name, error.message,
               serving_ ? "cached tiles are still served" : "the dataset is not served yet");
}

bool DatasetSlot::TakeOpened() {
  if (!is_opening() || opening_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return false;
  Result<tiler::Dataset> opened = opening_.get();
  const bool is_unwanted = std::exchange(reopen_, false) || (!opened && opened.error().code == ErrorCode::kCancelled);
  if (is_unwanted) return false;
  if (!opened) {
    // The file was replaced again: try again at once.
    if (opened.error().code == ErrorCode::kChanged) {
      tried_.clear();
    } else {
      Fail(opened.error());
    }
    return false;
  }
  const auto took = [this] {
    return std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - *stale_since_);
  };
  spdlog::info("dataset {}: {} is served now, version {}{}", wanted_.name, PlaceOf(wanted_),
               tiler::VersionText(opened->generation),
               stale_since_ ? fmt::format(", {} after the change was seen", took()) : "");
  serving_ = *std::move(opened);
  files_ = FilesOf(*serving_);
  next_file_ = 0;
  stale_since_.reset();
  problem_.clear();
  retry_at_ = {};
  retry_delay_ = {};
  return true;
}

}  // namespace terrace::server
