// One dataset of the configuration: the configuration that is wanted, the dataset that is served, and the state of
// opening it. Used only by the reloader's thread. Opening runs on a separate thread.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <future>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "config/config.h"
#include "engine/common/file_stamp.h"
#include "engine/core/result.h"
#include "tiler/tile_pipeline.h"

namespace terrace::server {

// Blocking. kCancelled: stopped.
using DatasetOpener = std::function<Result<tiler::Dataset>(const config::DatasetConfig&, std::stop_token)>;

class DatasetSlot {
 public:
  using Clock = std::chrono::steady_clock;

  // Serves nothing yet; opens as soon as possible.
  explicit DatasetSlot(config::DatasetConfig wanted) : wanted_(std::move(wanted)) {}
  // Serves nothing yet; `opening` has begun to open it, until `stop` is requested.
  DatasetSlot(config::DatasetConfig wanted, std::future<Result<tiler::Dataset>> opening, std::stop_source stop);
  // Serves `serving`, opened from `wanted`.
  DatasetSlot(config::DatasetConfig wanted, tiler::Dataset serving);
  DatasetSlot(DatasetSlot&&) = default;
  DatasetSlot& operator=(DatasetSlot&&) = default;
  ~DatasetSlot();  // stops an opening in progress, and waits for it

  const config::DatasetConfig& wanted() const { return wanted_; }
  const std::optional<tiler::Dataset>& serving() const { return serving_; }
  bool is_opening() const { return opening_.valid(); }
  // Whether something else is wanted than what is served, or nothing is served.
  bool lacks_wanted() const { return !serving_ || stale_since_; }
  // Whether nothing is left to open: the wanted dataset is served, or the last attempt to open it failed.
  bool is_current() const { return serving_ ? !stale_since_ || !problem_.empty() : !problem_.empty(); }

  // The problem, for people: why the last attempt failed, or kReopening if the wanted dataset is not open some time
  // after the change was seen. Empty: there is none.
  std::string Problem(Clock::time_point now) const;

  // Changes the wanted configuration. The old dataset is served until the new one is open.
  void Want(config::DatasetConfig wanted);

  // Checks up to `max_files` files for changes, beginning where the last call ended. Returns the number of files
  // checked.
  std::size_t CheckFiles(std::size_t max_files);

  // Begins to open the wanted dataset if that is due. Waits until its files have not been written to for a moment.
  void OpenIfDue(const DatasetOpener& open);

  // The outcome of an opening in progress is not wanted any more.
  void StopOpening();

  // Takes over an opened dataset. Returns true if there is a new one to serve.
  bool TakeOpened();

 private:
  bool IsSettled();
  std::vector<std::string> KnownFiles() const;
  void Fail(const Error& error);
  void MarkStale();
  bool HasToRecover();

  config::DatasetConfig wanted_;
  std::optional<tiler::Dataset> serving_;
  std::vector<tiler::WatchedFile> files_;         // of serving_
  std::size_t next_file_ = 0;                     // to check
  std::optional<Clock::time_point> stale_since_;  // since when serving_ differs from what is wanted

  std::future<Result<tiler::Dataset>> opening_;
  std::stop_source stop_opening_;
  bool reopen_ = false;                               // the dataset being opened is no longer the wanted one
  std::string problem_;                               // of the last attempt
  std::vector<std::optional<dem::FileStamp>> tried_;  // the named files at the last attempt that failed
  // When to reopen it next, after data in the cache folder was lost, or an archive was replaced.
  Clock::time_point recover_at_;
  Clock::duration recover_delay_{0};
  Clock::time_point retry_at_;
  Clock::duration retry_delay_{0};
  bool said_unsettled_ = false;
};

}  // namespace terrace::server
