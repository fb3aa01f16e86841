#include "engine/sources/prepare.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <deque>
#include <filesystem>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "engine/common/open_file.h"
#include "engine/common/source_log.h"
#include "engine/core/bytes.h"

namespace terrace::dem {
namespace {

// Incremented whenever blocks are read differently from the same overviews, because the statistics compare samples with
// blocks.
constexpr std::uint32_t kOverviewReading = 2;
// Incremented whenever detection finds other voids in the same raster (undeclared_nodata.h).
constexpr std::uint32_t kNodataDetection = 3;

// A hash of everything that the statistics of a raster depend on and that is known in advance.
std::uint64_t HashOf(const RasterLayout& layout, bool find_voids, const std::string& path, const StampedFiles& files) {
  ByteWriter writer;
  writer.PutBytes(AbsolutePath(path).string());  // one file with two names has one cache file
  writer.Put(files.fingerprint());
  for (const int part : {layout.width, layout.height, layout.columns, layout.wraps ? 1 : 0}) writer.Put(part);
  const SampleRules& rules = layout.rules;
  writer.Put(rules.nodata.value_or(0));
  for (const bool rule :
       {rules.nodata.has_value(), rules.compare_as_float, rules.has_mask, rules.is_indicator, find_voids}) {
    writer.Put<std::uint8_t>(rule ? 1 : 0);
  }
  for (const double rule :
       {rules.scale, rules.offset, rules.metres_per_unit, rules.lowest, rules.highest, double(rules.void_margin)}) {
    writer.Put(rule);
  }
  writer.Put(static_cast<std::uint32_t>(rules.extra_nodata.size()));
  for (const double value : rules.extra_nodata) writer.Put(value);
  for (const int factor : layout.overview_factors) writer.Put(factor);
  if (!layout.overview_factors.empty()) writer.Put(kOverviewReading);
  if (find_voids) writer.Put(kNodataDetection);
  writer.Put(layout.coast_step_m);
  const std::string bytes = writer.Take();
  return XXH3_64bits(bytes.data(), bytes.size());
}

// Loads or computes the statistics of one raster. Without a cache file they stay only in memory.
class Preparer {
 public:
  Preparer(GDALDataset& dataset, const RasterLayout& layout, const std::string& path, const StampedFiles& files,
           const PrepareOptions& options)
      : dataset_(dataset),
        path_(path),
        files_(files),
        options_(options),
        key_{layout, HashOf(layout, options.find_voids, path, files), {}},
        chunks_(layout.width, layout.height) {
    if (options.cache.folder) {
      cache_file_ = StatisticsPath(options.cache.folder->path(), path, layout.rules.extra_nodata, options.find_voids,
                                   !layout.overview_factors.empty(), layout.rules.metres_per_unit);
      prepared_.use = std::make_shared<const CacheFileUse>(options.cache.folder, cache_file_);
    }
    prepared_.preparation.chunks = chunks_.count();
  }

  Result<PreparedRaster> Run() {
    if (!cache_file_.empty()) {
      if (Load()) return std::move(prepared_);
    }
    if (options_.only_cached) {
      return MakeError(ErrorCode::kCancelled, "{}: its statistics are not in the cache", path_);
    }
    if (!cache_file_.empty()) {
      if (auto opened = OpenWriter(); !opened) return tl::unexpected(opened.error());
      if (!writer_ && Load()) return std::move(prepared_);
    }
    if (const std::string wide = DescribeWideBlocks(dataset_); !wide.empty()) {
      LogSource(SourceLog::Level::kWarn, path_, "{}", wide);
    }
    auto statistics = ReadStatistics();
    if (statistics && LacksChunks()) statistics = ReadStatistics();
    if (statistics && options_.find_voids && !key_.detected.any())
      statistics = WithoutFoundVoids(*std::move(statistics));
    if (!statistics) return Named(statistics.error());
    prepared_.detected = key_.detected;
    prepared_.statistics = *std::move(statistics);
    FinishCache();
    return std::move(prepared_);
  }

 private:
  tl::unexpected<Error> Named(const Error& error) const {
    return MakeError(error.code, "{}: {}", path_, error.message);
  }

  bool Load() {
    auto known = LoadStatistics(cache_file_, key_);
    if (!known) return false;
    prepared_.detected = std::move(known->detected);
    prepared_.statistics = std::move(known->statistics);
    prepared_.averages = std::move(known->averages);
    prepared_.cache_file = cache_file_;
    prepared_.key = key_;
    prepared_.preparation.from_cache = true;
    prepared_.use->Succeed();
    return true;
  }

  // The folder logs the first failure.
  void GiveUpCache(const Error& error) {
    LogSource(SourceLog::Level::kDebug, path_, "what is learnt of it is not kept: {}", error.message);
    const std::size_t at = error.message.starts_with(cache_file_) ? error.message.find(": ", cache_file_.size()) : 0;
    prepared_.use->Fail(at == 0 || at == std::string::npos ? error.message : error.message.substr(at + 2));
    writer_.reset();
  }

  // The averages of chunks that an interrupted run has read are only in its file, which is lost.
  bool LacksChunks() const { return !writer_ && averages_ != nullptr && !averages_are_whole_; }

  // kCancelled: stopped.
  Result<void> OpenWriter() {
    auto writer = StatisticsCacheWriter::Open(options_.cache.folder, cache_file_, key_, options_.stop);
    if (writer) {
      writer_ = *std::move(writer);
      if (writer_) key_ = writer_->key();
      return {};
    }
    if (writer.error().code == ErrorCode::kCancelled) return tl::unexpected(writer.error());
    GiveUpCache(writer.error());
    return {};
  }

  // One pass through the raster, continued after the chunks of an earlier run.
  Result<RasterStatistics> ReadStatistics() {
    const RasterLayout layout = key_.EffectiveLayout();
    StatisticsAssembler assembler(layout);
    averages_.reset();  // before others take their place
    if (options_.cache.memory) averages_ = MemoryAverages::Make(layout, options_.cache.memory);
    int done = 0;
    if (writer_) {
      auto resumed = writer_->Resume([&](const ChunkStatistics& part) { assembler.Add(chunks_.At(done++), part); });
      if (!resumed) GiveUpCache(resumed.error());
      prepared_.preparation.chunks_kept += done;
      if (done > 0)
        LogSource(SourceLog::Level::kInfo, path_, "{} of {} parts were prepared before", done, chunks_.count());
    }
    if (options_.progress && done > 0) options_.progress(static_cast<double>(done) / chunks_.count());
    averages_are_whole_ = done == 0;
    // One thread at a time reads samples, because the dataset cannot be shared. Computing takes most of the time.
    const std::size_t threads = CanShareDataset(layout) ? options_.threads : 1;
    // Without a thread to be had, this one computes.
    const std::launch where = threads > 1 ? std::launch::async | std::launch::deferred : std::launch::deferred;
    std::mutex turn;
    std::deque<std::future<Result<ChunkStatistics>>> ahead;  // in order; each waits when it is destroyed
    for (int next = done; done < chunks_.count(); ++done) {
      for (; next < chunks_.count() && ahead.size() < threads; ++next) {
        ahead.push_back(std::async(where, [this, &layout, &turn, next] {
          return ReadChunkStatistics(dataset_, layout, chunks_.At(next), prepared_.preparation.chunks_read,
                                     options_.stop, &turn);
        }));
      }
      const Result<ChunkStatistics> part = ahead.front().get();
      ahead.pop_front();
      if (!part) return tl::unexpected(part.error());
      assembler.Add(chunks_.At(done), *part);
      if (averages_) averages_->Add(chunks_.At(done), *part);
      if (writer_) {
        if (auto added = writer_->Add(*part); !added) GiveUpCache(added.error());
      }
      if (options_.progress) options_.progress((done + 1.0) / chunks_.count());
    }
    return assembler.Finish(dataset_, options_.stop);
  }

  // The statistics, or those of another pass if nodata was detected.
  Result<RasterStatistics> WithoutFoundVoids(RasterStatistics statistics) {
    const SampleRules& rules = key_.layout.rules;
    const bool has_collar = statistics.zeros.IsCollar(key_.layout.width, key_.layout.height);
    if (statistics.valid == 0) return statistics;
    if (!MayHideVoids(rules, statistics.lowest, statistics.highest, statistics.voids > 0, has_collar))
      return statistics;
    auto detected = FindVoids(*dataset_.GetRasterBand(1), rules, has_collar, key_.layout.coast_step_m, options_.stop);
    if (!detected) return tl::unexpected(detected.error());
    if (!detected->any()) return statistics;
    key_.detected = *std::move(detected);
    if (writer_) {
      if (auto restarted = writer_->Restart(key_.detected); !restarted) GiveUpCache(restarted.error());
    }
    return ReadStatistics();
  }

  // Keeps averages in the folder; if that fails, in memory.
  void FinishCache() {
    // If a file changed meanwhile, the statistics are a mixture; the caller will refuse them.
    if (files_.FirstChanged()) return;
    if (writer_) {
      if (auto finished = writer_->Finish(prepared_.statistics); !finished) GiveUpCache(finished.error());
    }
    if (auto known = writer_ ? LoadStatistics(cache_file_, key_) : std::nullopt) {
      prepared_.averages = std::move(known->averages);
      prepared_.cache_file = cache_file_;
      prepared_.key = key_;
      prepared_.use->Succeed();
    } else if (averages_are_whole_) {
      prepared_.memory_averages = std::move(averages_);
    }
  }

  GDALDataset& dataset_;
  const std::string& path_;
  const StampedFiles& files_;
  const PrepareOptions& options_;
  StatisticsKey key_;
  const ChunkGrid chunks_;
  std::string cache_file_;  // its path; empty: none
  std::optional<StatisticsCacheWriter> writer_;
  std::unique_ptr<MemoryAverages> averages_;  // for the case that the file cannot be kept; null: they do not fit
  bool averages_are_whole_ = true;            // have all chunks
  PreparedRaster prepared_;
};

}  // namespace

std::string StatisticsPath(const std::string& cache_dir, const std::string& path,
                           const std::vector<double>& extra_nodata, bool find_voids, bool has_overviews,
                           double metres_per_unit) {
  const std::filesystem::path whole = AbsolutePath(path);
  ByteWriter writer;
  writer.PutBytes(whole.string());
  for (const double value : extra_nodata) writer.Put(value);
  writer.Put(metres_per_unit);
  for (const bool option : {find_voids, has_overviews}) writer.Put<std::uint8_t>(option ? 1 : 0);
  const std::string bytes = writer.Take();
  return (std::filesystem::path(cache_dir) /
          fmt::format("{}-{:016x}.statistics", whole.filename().string(), XXH3_64bits(bytes.data(), bytes.size())))
      .string();
}

Result<PreparedRaster> PrepareRaster(GDALDataset& dataset, const RasterLayout& layout, const std::string& path,
                                     const StampedFiles& files, const PrepareOptions& options) {
  return Preparer(dataset, layout, path, files, options).Run();
}

}  // namespace terrace::dem
