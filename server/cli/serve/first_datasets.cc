#include "server/cli/serve/first_datasets.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <future>
#include <limits>
#include <system_error>
#include <utility>

#include "server/cli/common/open_dataset.h"
#include "server/cli/common/progress.h"
#include "server/cli/common/source_files.h"
#include "tiler/encoder_version.h"
#include "tiler/store/baked_tiles.h"

namespace terrace::cli {
namespace {

using Clock = std::chrono::steady_clock;

// Small sources are read within this time, and the server is complete when it begins to answer.
constexpr std::chrono::seconds kPatience{2};
// Building tiles has priority over preparing.
constexpr int kNiceness = 10;

void LogOpened(const config::DatasetConfig& wanted, const tiler::Dataset& dataset) {
  const int max_level =
      dataset.model ? dataset.model->max_level() : static_cast<int>(dataset.baked->extent().available.size()) - 1;
  const std::string archive = dataset.model && dataset.baked ? ", archive " + wanted.baked : "";
  spdlog::info("dataset {}: {}{}, levels 0 to {}, version {}", dataset.name, NameOf(wanted), archive, max_level,
               tiler::VersionText(dataset.generation));
}

// Unknown, as of a remote file: the largest number.
std::uintmax_t BytesOf(const config::DatasetConfig& dataset) {
  std::uintmax_t bytes = 0;
  for (const config::SourceConfig& source : dataset.sources) {
    for (const std::string& file : source.files) {
      std::error_code unreadable;
      const std::uintmax_t size = std::filesystem::file_size(file, unreadable);
      if (unreadable) return std::numeric_limits<std::uintmax_t>::max();
      bytes += size;
    }
  }
  return bytes;
}

// Of this thread; on Linux, the threads that it has started keep theirs.
void LowerPriority() {
  thread_local bool is_low = false;
  if (std::exchange(is_low, true)) return;
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNiceness);
}

// Called by the threads that read.
Result<tiler::Dataset> Prepare(const config::DatasetConfig& wanted, const dem::RasterCache& cache,
                               const std::stop_token& stop, PreparationProgress& shares) {
  Progress progress((cache.folder ? "preparing " : "reading ") + NameOf(wanted), FileCount(wanted.sources));
  shares.Begin(wanted.name);
  const auto tell = [&](double share) {
    shares.Raise(wanted.name, share);
    if (shares.is_in_background()) {
      LowerPriority();
      progress.UseLines();
    }
    progress.Update(share);
  };
  try {
    return OpenDataset(wanted, cache, TERRACE_VERSION, tell, stop);
  } catch (const std::exception& exception) {
    return MakeError(ErrorCode::kInternal, "{}", exception.what());
  }
}

struct Opening {
  std::future<Result<tiler::Dataset>> dataset;
  std::stop_source stop;
};

// Ends early if `stop` or the opening's own source asks for it.
Opening Begin(const config::DatasetConfig& wanted, const dem::RasterCache& cache, const std::stop_token& stop,
              const std::shared_ptr<PreparationProgress>& shares) {
  Opening opening;
  opening.dataset = std::async(std::launch::async, [wanted, cache, stop, shares, source = opening.stop]() mutable {
    const std::stop_callback linked(stop, [&source] { source.request_stop(); });
    return Prepare(wanted, cache, source.get_token(), *shares);
  });
  return opening;
}

}  // namespace

void PrintFault(const std::string& dataset, const std::string& message) {
  std::fprintf(stderr, "terrace: dataset %s: %s\n", dataset.c_str(), message.c_str());
}

double PreparationProgress::Of(const std::string& dataset) const {
  const std::lock_guard lock(mutex_);
  const auto known = shares_.find(dataset);
  return known == shares_.end() ? 0 : known->second;
}

void PreparationProgress::Begin(const std::string& dataset) {
  const std::lock_guard lock(mutex_);
  shares_[dataset] = 0;
}

void PreparationProgress::Raise(const std::string& dataset, double share) {
  const std::lock_guard lock(mutex_);
  double& known = shares_[dataset];
  known = std::max(known, share);
}

void PreparationProgress::GoToBackground() {
  const std::lock_guard lock(mutex_);
  is_in_background_ = true;
}

bool PreparationProgress::is_in_background() const {
  const std::lock_guard lock(mutex_);
  return is_in_background_;
}

std::optional<FirstDatasets> OpenFirstDatasets(const config::Config& config, const dem::RasterCache& cache,
                                               const std::stop_token& stop,
                                               const std::shared_ptr<PreparationProgress>& shares) {
  const std::vector<config::DatasetConfig>& wanted = config.datasets;
  std::vector<std::optional<tiler::Dataset>> open(wanted.size());
  std::vector<std::size_t> lacking;
  bool all_fine = true;
  const auto take = [&](std::size_t i, Result<tiler::Dataset> dataset) {
    if (!dataset) {
      if (!stop.stop_requested()) PrintFault(wanted[i].name, dataset.error().message);
      all_fine = false;
      return;
    }
    LogOpened(wanted[i], *dataset);
    open[i] = *std::move(dataset);
  };
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    auto kept = OpenFromCache(wanted[i], cache, TERRACE_VERSION, stop);
    if (stop.stop_requested()) return std::nullopt;
    if (kept && !*kept) {
      lacking.push_back(i);
    } else if (kept) {
      take(i, **std::move(kept));
    } else {
      take(i, tl::unexpected(kept.error()));
    }
  }
  if (!all_fine) return std::nullopt;

  std::ranges::stable_sort(lacking, {}, [&](std::size_t i) { return BytesOf(wanted[i]); });
  std::optional<Opening> unfinished;
  std::size_t begun = wanted.size();  // the dataset that it opens
  const auto until = Clock::now() + kPatience;
  for (const std::size_t i : lacking) {
    if (stop.stop_requested()) return std::nullopt;
    Opening opening = Begin(wanted[i], cache, stop, shares);
    if (opening.dataset.wait_until(until) != std::future_status::ready) {
      begun = i;
      unfinished = std::move(opening);
      break;
    }
    take(i, opening.dataset.get());
  }
  if (!all_fine || stop.stop_requested()) {
    if (unfinished) unfinished->stop.request_stop();  // its thread is joined
    return std::nullopt;
  }

  FirstDatasets first;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (open[i]) {
      first.open.push_back(*open[i]);
      first.slots.emplace_back(wanted[i], *std::move(open[i]));
      continue;
    }
    first.pending.push_back(wanted[i].name);
    if (i == begun) {
      first.slots.emplace_back(wanted[i], std::move(unfinished->dataset), std::move(unfinished->stop));
    } else {
      first.slots.emplace_back(wanted[i]);
    }
  }
  return first;
}

}  // namespace terrace::cli
