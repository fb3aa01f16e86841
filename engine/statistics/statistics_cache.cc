#include "engine/statistics/statistics_cache.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "engine/common/dem_types.h"
#include "engine/common/source_log.h"
#include "engine/core/bytes.h"
#include "engine/core/errno_text.h"
#include "engine/statistics/statistics_codec.h"

namespace terrace::dem {
namespace {

// Increases with every change of the format or its meaning.
constexpr std::uint32_t kCacheVersion = 9;
constexpr std::uint64_t kFooterMagic = 0x44'4e'45'53'54'41'54'53;  // "STATSEND"
constexpr std::uint32_t kChunkMagic = 0x4b'4e'48'43;               // "CHNK"
constexpr std::size_t kHeaderBytes = 36, kChunkHeaderBytes = 32, kFooterBytes = 24;
constexpr int kMaxUnsynced = 64;                    // chunks: a few seconds
constexpr std::uint64_t kMaxHeaderBytes = 1 << 16;  // a few numbers and a line of text

std::uint64_t HashOf(std::string_view bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

std::string HeaderOf(const StatisticsKey& key) {
  const std::string detected = EncodeDetectedNodata(key.detected);
  ByteWriter writer;
  writer.Put(CacheFolder::Files::kMagic);
  writer.Put(kCacheVersion);
  writer.Put(static_cast<std::uint32_t>(key.kept_factors()));
  writer.Put(key.hash);
  writer.Put<std::uint32_t>(ChunkGrid::kSide);
  writer.Put<std::uint32_t>(kLargestMeasuredFactor);
  writer.Put(static_cast<std::uint32_t>(detected.size()));
  writer.PutBytes(detected);
  std::string bytes = writer.Take();
  ByteWriter sum;
  sum.Put(HashOf(bytes));
  return bytes + sum.Take();
}

// Whether a file begins with the header of `key`. If so, sets its detected nodata.
enum class HeaderState { kDamaged, kOther, kSame };
HeaderState ReadHeader(int file, StatisticsKey& key, std::uint64_t& bytes) {
  const std::uint64_t size = SizeOf(file);
  const auto front = ReadAt(file, 0, kHeaderBytes, size);
  if (!front) return HeaderState::kDamaged;
  ByteReader reader(std::string_view(*front).substr(kHeaderBytes - sizeof(std::uint32_t)));
  bytes = kHeaderBytes + std::uint64_t{reader.Get<std::uint32_t>()} + sizeof(std::uint64_t);
  const auto header = bytes > kMaxHeaderBytes ? std::nullopt : ReadAt(file, 0, bytes, size);
  if (!header || ByteReader(*header).Get<std::uint64_t>() != CacheFolder::Files::kMagic) return HeaderState::kDamaged;
  const std::string_view checked = std::string_view(*header).substr(0, bytes - sizeof(std::uint64_t));
  if (HashOf(checked) != ByteReader(std::string_view(*header).substr(checked.size())).Get<std::uint64_t>()) {
    return HeaderState::kDamaged;
  }
  auto detected = DecodeDetectedNodata(checked.substr(kHeaderBytes));
  if (!detected) return HeaderState::kOther;
  StatisticsKey found = key;
  found.detected = *std::move(detected);
  if (HeaderOf(found) != *header) return HeaderState::kOther;
  key = std::move(found);
  return HeaderState::kSame;
}

struct ChunkHeader {
  std::uint32_t index = 0, statistics_bytes = 0;
  std::uint64_t averages_bytes = 0, checksum = 0;  // of the preceding header and the statistics

  static ChunkHeader Of(std::string_view bytes) {
    ByteReader reader(bytes);
    ChunkHeader header;
    if (reader.Get<std::uint32_t>() != kChunkMagic) return header;
    header.index = reader.Get<std::uint32_t>();
    header.statistics_bytes = reader.Get<std::uint32_t>();
    reader.Get<std::uint32_t>();
    header.averages_bytes = reader.Get<std::uint64_t>();
    header.checksum = reader.Get<std::uint64_t>();
    return header;
  }
};

std::string EncodeCachedChunk(std::uint32_t index, const ChunkStatistics& chunk_statistics, unsigned factors) {
  const std::string statistics = chunk_statistics.is_void() ? std::string() : EncodeChunk(chunk_statistics);
  ByteWriter averages;
  if (chunk_statistics.has_averages(factors)) {
    for (std::size_t k = 0; (2 << k) < kLargestMeasuredFactor; ++k) {
      if ((factors & (2U << k)) == 0) continue;
      const std::string_view floats(reinterpret_cast<const char*>(chunk_statistics.averages[k].data()),
                                    chunk_statistics.averages[k].size() * sizeof(float));
      averages.Put(HashOf(floats));
      averages.PutBytes(floats);
    }
  }
  ByteWriter writer;
  writer.Put(kChunkMagic);
  writer.Put(index);
  writer.Put(static_cast<std::uint32_t>(statistics.size()));
  writer.Put<std::uint32_t>(0);
  writer.Put<std::uint64_t>(averages.size());
  std::string bytes = writer.Take();
  ByteWriter sum;
  sum.Put(HashOf(bytes + statistics));
  return bytes + sum.Take() + statistics + averages.Take();
}

void SyncFolderOf(const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  const OpenFile opened(::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (opened.is_open()) ::fsync(opened.get());
}

}  // namespace

RasterLayout WithDetectedNodata(RasterLayout layout, const DetectedNodata& detected) {
  detected.AddTo(layout.rules);
  // The overviews were averaged from heights and nodata values.
  if (detected.any()) layout.overview_factors.clear();
  return layout;
}

namespace {

// LoadStatistics, with or without its lines in the log.
std::optional<CachedStatistics> FindStatistics(const std::string& path, const StatisticsKey& wanted, bool is_logged) {
  OpenFile file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file.is_open()) return std::nullopt;
  const std::uint64_t size = SizeOf(file.get());
  const auto damaged = [&](const char* what) {
    if (is_logged)
      LogSource(SourceLog::Level::kWarn, path, "{} does not fit its checksum, or was cut; the source is prepared anew",
                what);
    return std::nullopt;
  };
  StatisticsKey key = wanted;
  std::uint64_t header_bytes = 0;
  switch (ReadHeader(file.get(), key, header_bytes)) {
    case HeaderState::kDamaged:
      return damaged("its header");
    case HeaderState::kOther:
      if (is_logged)
        LogSource(SourceLog::Level::kInfo, path,
                  "was made from another state of the source, or by another version; the source is prepared anew");
      return std::nullopt;
    case HeaderState::kSame:
      break;
  }
  const RasterLayout layout = key.EffectiveLayout();
  if (size < kFooterBytes) return damaged("its end");
  const auto footer = ReadAt(file.get(), size - kFooterBytes, kFooterBytes, size);
  if (!footer) return damaged("its end");
  ByteReader reader(*footer);
  const auto offset = reader.Get<std::uint64_t>(), checksum = reader.Get<std::uint64_t>();
  if (reader.Get<std::uint64_t>() != kFooterMagic || offset > size - kFooterBytes) return damaged("its end");
  const auto tail = ReadAt(file.get(), offset, size - kFooterBytes - offset, size);
  if (!tail || HashOf(*tail) != checksum) return damaged("its statistics");

  ByteReader whole(*tail);
  std::vector<std::uint64_t> offsets(static_cast<std::size_t>(ChunkGrid(layout.width, layout.height).count()));
  for (std::uint64_t& at : offsets) at = whole.Get<std::uint64_t>();
  auto statistics = DecodeStatistics(whole.GetBytes(whole.remaining()), layout);
  if (!statistics) return damaged("its statistics");
  Touch(file.get());
  CachedStatistics cached{key.detected, *std::move(statistics), nullptr};
  if (KeptFactors(layout) != 0) {
    cached.averages = std::make_shared<const CachedAverages>(file, HeaderOf(key), path, layout, std::move(offsets));
  }
  return cached;
}

}  // namespace

std::optional<CachedStatistics> LoadStatistics(const std::string& path, const StatisticsKey& key) {
  return FindStatistics(path, key, /*is_logged=*/true);
}

StatisticsCacheWriter::StatisticsCacheWriter(std::shared_ptr<CacheFolder> folder, OpenFile file, std::string path,
                                             const StatisticsKey& key)
    : folder_(std::move(folder)),
      file_(std::move(file)),
      path_(std::move(path)),
      key_(key),
      layout_(key.EffectiveLayout()),
      chunks_(layout_.width, layout_.height) {}

Result<std::optional<StatisticsCacheWriter>> StatisticsCacheWriter::Open(std::shared_ptr<CacheFolder> folder,
                                                                         const std::string& path,
                                                                         const StatisticsKey& key,
                                                                         const std::stop_token& stop) {
  std::error_code failed;
  std::filesystem::create_directories(folder->path(), failed);
  const std::string partial = path + ".partial";
  for (bool waiting = false;;) {
    OpenFile file(::open(partial.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
    if (!file.is_open()) {
      // A folder that could not be created is the reason why the file cannot be.
      const std::string reason = failed ? failed.message() : ErrorText();
      return MakeError(ErrorCode::kUnavailable, "{}: cannot be written: {}", partial, reason);
    }
    if (::flock(file.get(), LOCK_EX | LOCK_NB) != 0) {
      if (errno != EWOULDBLOCK) {
        return MakeError(ErrorCode::kUnavailable, "{}: cannot be locked: {}", partial, ErrorText());
      }
      if (!std::exchange(waiting, true))
        LogSource(SourceLog::Level::kInfo, path, "somebody else makes it; waiting for that");
      if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "{}: waiting for it was stopped", path);
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      continue;
    }
    // The previous owner of the lock may have renamed or removed the file.
    if (const auto opened = IdentityOf(file.get()); !opened || opened != IdentityOf(partial)) continue;
    // Another process may have finished the file before this one locked the partial one, whether or not it waited. What
    // does not fit was reported when it was first looked for.
    if (FindStatistics(path, key, /*is_logged=*/false)) {
      ::unlink(partial.c_str());
      return std::nullopt;
    }
    StatisticsCacheWriter writer(std::move(folder), std::move(file), path, key);
    if (auto begun = writer.Begin(); !begun) return tl::unexpected(begun.error());
    return std::optional(std::move(writer));
  }
}

Result<void> StatisticsCacheWriter::Begin() {
  if (ReadHeader(file_.get(), key_, end_) != HeaderState::kSame) return Restart(key_.detected);
  layout_ = key_.EffectiveLayout();
  return {};
}

Result<void> StatisticsCacheWriter::Restart(const DetectedNodata& detected) {
  key_.detected = detected;
  layout_ = key_.EffectiveLayout();
  offsets_.clear();
  end_ = 0;
  folder_->files().Release(std::exchange(reserved_, 0));
  if (auto cut = Cut(); !cut) return cut;
  return Write(HeaderOf(key_));
}

Result<void> StatisticsCacheWriter::Cut() {
  if (::ftruncate(file_.get(), static_cast<off_t>(end_)) == 0) return {};
  return MakeError(ErrorCode::kUnavailable, "{}.partial: cannot be cut: {}", path_, ErrorText());
}

Result<void> StatisticsCacheWriter::Resume(const std::function<void(const ChunkStatistics&)>& keep) {
  KeepWholeChunks(keep);
  return Cut();
}

void StatisticsCacheWriter::KeepWholeChunks(const std::function<void(const ChunkStatistics&)>& keep) {
  const std::uint64_t size = SizeOf(file_.get());
  while (static_cast<int>(offsets_.size()) < chunks_.count()) {
    const auto head = ReadAt(file_.get(), end_, kChunkHeaderBytes, size);
    if (!head) return;
    const ChunkHeader header = ChunkHeader::Of(*head);
    const auto statistics = ReadAt(file_.get(), end_ + kChunkHeaderBytes, header.statistics_bytes, size);
    const std::uint64_t averages = end_ + kChunkHeaderBytes + header.statistics_bytes;
    if (!statistics || averages > size || header.averages_bytes > size - averages || header.index != offsets_.size() ||
        HashOf(head->substr(0, kChunkHeaderBytes - 8) + *statistics) != header.checksum) {
      return;
    }
    const Chunk chunk = chunks_.At(static_cast<int>(offsets_.size()));
    const std::optional<ChunkStatistics> chunk_statistics =
        statistics->empty() ? VoidStatistics(chunk, layout_) : DecodeChunk(*statistics, chunk, layout_);
    if (!chunk_statistics) return;
    keep(*chunk_statistics);
    offsets_.push_back(header.averages_bytes > 0 ? averages : 0);
    end_ = averages + header.averages_bytes;
  }
}

// Also with all chunks in it: the space is needed.
void StatisticsCacheWriter::Remove() {
  ::unlink((path_ + ".partial").c_str());
  folder_->files().Release(std::exchange(reserved_, 0));
}

Result<void> StatisticsCacheWriter::Write(std::string_view bytes) {
  if (auto reserved = folder_->files().Reserve(bytes.size()); !reserved) {
    Remove();
    return MakeError(reserved.error().code, "{}.partial: {}", path_, reserved.error().message);
  }
  reserved_ += bytes.size();
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(file_.get(), bytes.data(), bytes.size(), static_cast<off_t>(end_));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      const std::string why = ErrorText();
      Remove();
      return MakeError(ErrorCode::kUnavailable, "{}.partial: cannot be written: {}", path_, why);
    }
    end_ += static_cast<std::uint64_t>(written);
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return {};
}

Result<void> StatisticsCacheWriter::Add(const ChunkStatistics& chunk_statistics) {
  const std::uint64_t begin = end_;
  const std::string bytes =
      EncodeCachedChunk(static_cast<std::uint32_t>(offsets_.size()), chunk_statistics, KeptFactors(layout_));
  if (auto written = Write(bytes); !written) return written;
  const ChunkHeader header = ChunkHeader::Of(bytes);
  offsets_.push_back(header.averages_bytes > 0 ? begin + kChunkHeaderBytes + header.statistics_bytes : 0);
  return {};
}

Result<void> StatisticsCacheWriter::Finish(const RasterStatistics& statistics) {
  ByteWriter tail;
  for (const std::uint64_t offset : offsets_) tail.Put(offset);
  tail.PutBytes(EncodeStatistics(statistics));
  const std::string bytes = tail.Take();
  ByteWriter footer;
  footer.Put(end_);
  footer.Put(HashOf(bytes));
  footer.Put(kFooterMagic);
  if (auto written = Write(bytes); !written) return written;
  if (auto written = Write(footer.Take()); !written) return written;
  // Files damaged by a power failure are detected and made again. If that is quick, the file is not synced: for tens of
  // thousands of sources, syncing would take most of the time.
  const bool is_waited_for = chunks_.count() > kMaxUnsynced;
  if ((is_waited_for && ::fsync(file_.get()) != 0) || ::rename((path_ + ".partial").c_str(), path_.c_str()) != 0) {
    return MakeError(ErrorCode::kUnavailable, "{}: cannot be finished: {}", path_, ErrorText());
  }
  if (is_waited_for) SyncFolderOf(path_);
  return {};
}

}  // namespace terrace::dem
