// One dataset of the configuration, and how far what is served has come to what is wanted.
//
// Belongs to one thread, the reloader's. Opening runs on a thread of its own.
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
#include "engine/core/result.h"
#include "engine/dem/gdal/file_stamp.h"
#include "tiler/tile_pipeline.h"

namespace terrace::server {

// Blocking. kCancelled: stopped.
using DatasetOpener = std::function<Result<tiler::Dataset>(const config::DatasetConfig&, std::stop_token)>;

class DatasetSlot {
 public:
  using Clock = std::chrono::steady_clock;

  // Serves nothing yet; opens as soon as it may.
  explicit DatasetSlot(config::DatasetConfig wanted) : wanted_(std::move(wanted)) {}
  // Serves `serving`, opened from `wanted`.
  DatasetSlot(config::DatasetConfig wanted, tiler::Dataset serving);
  DatasetSlot(DatasetSlot&&) = default;
  DatasetSlot& operator=(DatasetSlot&&) = default;
  ~DatasetSlot();  // stops an opening that is under way, and waits for it

  const config::DatasetConfig& wanted() const { return wanted_; }
  const std::optional<tiler::Dataset>& serving() const { return serving_; }
  bool is_opening() const { return opening_.valid(); }
  // Or given up for now.
  bool is_current() const { return serving_ ? !stale_since_ || !problem_.empty() : !problem_.empty(); }

  // For people; empty: nothing is wrong, or not for long yet.
  std::string Trouble() const;

  // What is served goes on until the new one is there.
  void Want(config::DatasetConfig wanted);

  // Looks at files from the one where the last call ended, at `most` of them; how many it looked at.
  std::size_t LookAtFiles(std::size_t most);

  // Begins to open what is wanted where that is due: a file must not have been written to for a moment.
  void OpenIfDue(const DatasetOpener& open);

  void StopOpening() { stop_opening_.request_stop(); }

  // True: there is something new to serve.
  bool TakeOpened();

 private:
  bool IsSettled();
  void Fail(const Error& error);
  void MarkStale();
  bool HasToRecoverCache();

  config::DatasetConfig wanted_;
  std::optional<tiler::Dataset> serving_;
  dem::StampedFiles files_;                       // of serving_
  std::size_t next_file_ = 0;                     // to look at
  std::optional<Clock::time_point> stale_since_;  // when serving_ was found not to be what is wanted

  std::future<Result<tiler::Dataset>> opening_;
  std::stop_source stop_opening_;
  bool reopen_ = false;                               // what is being opened is not what is wanted any more
  std::string problem_;                               // of the last attempt
  std::vector<std::optional<dem::FileStamp>> tried_;  // the named files at the last attempt that failed
  Clock::time_point recover_at_;        // when to open it anew next for what the cache folder has lost
  Clock::duration recover_delay_{0};
  Clock::time_point retry_at_;
  Clock::duration retry_delay_{0};
  bool said_unsettled_ = false;
};

}  // namespace terrace::server
