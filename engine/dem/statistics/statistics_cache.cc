#include "engine/dem/statistics/statistics_cache.h"

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

#include "engine/core/bytes.h"
#include "engine/dem/common/source_log.h"
#include "engine/dem/statistics/statistics_codec.h"

namespace terrace::dem {
namespace {

// Increases with every change of the format or its meaning.
constexpr std::uint32_t kCacheVersion = 3;
constexpr std::uint64_t kHeaderMagic = 0x31'53'54'41'54'53'52'54;  // "TRSTATS1"
constexpr std::uint64_t kFooterMagic = 0x44'4e'45'53'54'41'54'53;  // "STATSEND"
constexpr std::uint32_t kChunkMagic = 0x4b'4e'48'43;               // "CHNK"
constexpr std::size_t kHeaderBytes = 36, kChunkHeaderBytes = 32, kFooterBytes = 24;
constexpr int kMaxUnsynced = 64;                    // chunks: a few seconds
constexpr std::uint64_t kMaxHeaderBytes = 1 << 16;  // a few numbers and a line of text

constexpr int CeilingOf(int a, int b) { return (a + b - 1) / b; }

std::uint64_t HashOf(std::string_view bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }
std::string ErrorText() { return std::generic_category().message(errno); }

std::string HeaderOf(const StatisticsShape& shape) {
  const std::string detected = EncodeDetectedNodata(shape.detected);
  ByteWriter writer;
  writer.Put(kHeaderMagic);
  writer.Put(kCacheVersion);
  writer.Put(static_cast<std::uint32_t>(shape.least_kept_factor()));
  writer.Put(shape.key);
  writer.Put<std::uint32_t>(ChunkGrid::kSide);
  writer.Put<std::uint32_t>(kLargestDirect);
  writer.Put(static_cast<std::uint32_t>(detected.size()));
  writer.PutBytes(detected);
  std::string bytes = writer.Take();
  ByteWriter sum;
  sum.Put(HashOf(bytes));
  return bytes + sum.Take();
}

// Reads all bytes, or returns false.
bool ReadAt(int file, std::uint64_t offset, void* to, std::size_t bytes) {
  auto* at = static_cast<char*>(to);
  while (bytes > 0) {
    const ssize_t got = ::pread(file, at, bytes, static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    at += got;
    offset += static_cast<std::uint64_t>(got);
    bytes -= static_cast<std::size_t>(got);
  }
  return true;
}
std::optional<std::string> ReadAt(int file, std::uint64_t offset, std::uint64_t bytes, std::uint64_t file_bytes) {
  if (offset > file_bytes || bytes > file_bytes - offset) return std::nullopt;
  std::string read(bytes, '\0');
  if (!ReadAt(file, offset, read.data(), bytes)) return std::nullopt;
  return read;
}

std::uint64_t SizeOf(int file) {
  struct stat status {};
  return ::fstat(file, &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

// Size and offset of a chunk's averages of one factor. Each factor is preceded by its checksum.
struct AveragesPlace {
  std::uint64_t offset = 0;
  int columns = 0, rows = 0;
  std::size_t bytes() const {
    return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows) * sizeof(float);
  }
};
AveragesPlace PlaceOf(const Chunk& chunk, const RasterLayout& layout, int factor) {
  AveragesPlace place;
  const int used = std::clamp(layout.columns - chunk.col, 0, chunk.cols);
  for (int f = LeastKeptFactor(layout);; f *= 2) {
    place.columns = CeilingOf(used, f);
    place.rows = CeilingOf(chunk.rows, f);
    if (f == factor) return place;
    place.offset += sizeof(std::uint64_t) + place.bytes();
  }
}

// Whether a file begins with the header of this shape. If so, sets the detected nodata of `shape`.
enum class HeaderState { kDamaged, kOther, kSame };
HeaderState ReadHeader(int file, StatisticsShape& shape, std::uint64_t& bytes) {
  const std::uint64_t size = SizeOf(file);
  const auto front = ReadAt(file, 0, kHeaderBytes, size);
  if (!front) return HeaderState::kDamaged;
  ByteReader reader(std::string_view(*front).substr(kHeaderBytes - sizeof(std::uint32_t)));
  bytes = kHeaderBytes + std::uint64_t{reader.Get<std::uint32_t>()} + sizeof(std::uint64_t);
  const auto header = bytes > kMaxHeaderBytes ? std::nullopt : ReadAt(file, 0, bytes, size);
  if (!header || ByteReader(*header).Get<std::uint64_t>() != kHeaderMagic) return HeaderState::kDamaged;
  const std::string_view checked = std::string_view(*header).substr(0, bytes - sizeof(std::uint64_t));
  if (HashOf(checked) != ByteReader(std::string_view(*header).substr(checked.size())).Get<std::uint64_t>()) {
    return HeaderState::kDamaged;
  }
  auto detected = DecodeDetectedNodata(checked.substr(kHeaderBytes));
  if (!detected) return HeaderState::kOther;
  StatisticsShape found = shape;
  found.detected = *std::move(detected);
  if (HeaderOf(found) != *header) return HeaderState::kOther;
  shape = std::move(found);
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

std::string EncodeCachedChunk(std::uint32_t index, const ChunkStatistics& chunk_statistics, int least_kept) {
  const std::string statistics = chunk_statistics.is_void() ? std::string() : EncodeChunk(chunk_statistics);
  ByteWriter averages;
  if (!chunk_statistics.is_void()) {
    for (std::size_t k = 0; (2 << k) < kLargestDirect; ++k) {
      if ((2 << k) < least_kept) continue;
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

std::optional<FileIdentity> IdentityOf(int file) {
  struct stat status {};
  if (::fstat(file, &status) != 0) return std::nullopt;
  return FileIdentity{status.st_dev, status.st_ino};
}

std::optional<FileIdentity> IdentityOf(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return std::nullopt;
  return FileIdentity{status.st_dev, status.st_ino};
}

bool IsSameFile(int file, const std::string& path) {
  const auto opened = IdentityOf(file);
  return opened && opened == IdentityOf(path);
}

}  // namespace

OpenFile::~OpenFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

bool NeedsAverages(const RasterLayout& layout) {
  return layout.overview_factors.empty() && std::int64_t{layout.width} * layout.height > kMaxSamplesWithoutAverages;
}

int LeastKeptFactor(const RasterLayout& layout) {
  constexpr std::int64_t kMaxReadWhole = std::int64_t{1024} * 1024;
  constexpr int kMinOfOthers = 4;
  if (NeedsAverages(layout)) return 2;
  const bool is_small = std::int64_t{layout.width} * layout.height < kMaxReadWhole;
  return layout.overview_factors.empty() && !is_small ? kMinOfOthers : kLargestDirect;
}

RasterLayout WithDetectedNodata(RasterLayout layout, const DetectedNodata& detected) {
  detected.AddTo(layout.rules);
  // The overviews were averaged from heights and nodata values.
  if (detected.any()) layout.overview_factors.clear();
  return layout;
}

CachedAverages::CachedAverages(const OpenFile& file, std::string path, RasterLayout layout,
                               std::vector<std::uint64_t> offsets)
    : identity_(IdentityOf(file.get()).value_or(FileIdentity())),
      path_(std::move(path)),
      layout_(std::move(layout)),
      least_(LeastKeptFactor(layout_)),
      chunks_(layout_.width, layout_.height),
      offsets_(std::move(offsets)) {}

Result<OpenFile> CachedAverages::Open() const {
  OpenFile file(::open(path_.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file.is_open() && errno != ENOENT) {
    return MakeError(ErrorCode::kUnavailable, "{}: cannot be opened: {}", path_, ErrorText());
  }
  if (!file.is_open() || IdentityOf(file.get()) != identity_) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: is gone", path_);
  }
  return file;
}

// The window does not wrap here: columns of the chunk lie at `window.column` + multiples of the grid's width.
Result<void> CachedAverages::CopyChunk(const OpenFile& file, int factor, int index, const GridWindow& window,
                                       float* out) const {
  const Chunk chunk = chunks_.At(index);
  const AveragesPlace place = PlaceOf(chunk, layout_, factor);
  const std::int64_t left = chunk.col / factor, top = chunk.row / factor;
  const std::int64_t west = std::max(left, window.column),
                     east = std::min(left + place.columns, window.column + window.columns);
  const std::int64_t north = std::max(top, window.row), south = std::min(top + place.rows, window.row + window.rows);
  if (west >= east || north >= south || offsets_[static_cast<std::size_t>(index)] == 0) return {};
  std::string bytes(sizeof(std::uint64_t) + place.bytes(), '\0');
  std::uint64_t checksum = 0;
  const bool read =
      ReadAt(file.get(), offsets_[static_cast<std::size_t>(index)] + place.offset, bytes.data(), bytes.size());
  std::memcpy(&checksum, bytes.data(), sizeof checksum);
  const char* floats = bytes.data() + sizeof checksum;
  if (!read || XXH3_64bits(floats, place.bytes()) != checksum) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: the averages of chunk {} by factor {} are damaged", path_, index,
                     factor);
  }
  bytes_read_ += bytes.size();
  for (std::int64_t row = north; row < south; ++row) {
    std::memcpy(out + (row - window.row) * window.columns + (west - window.column),
                floats + ((row - top) * place.columns + west - left) * std::ptrdiff_t{sizeof(float)},
                static_cast<std::size_t>(east - west) * sizeof(float));
  }
  return {};
}

Result<std::vector<float>> CachedAverages::Read(int factor, const GridWindow& window) const {
  const Result<OpenFile> file = Open();
  if (!file) return tl::unexpected(file.error());
  std::vector<float> heights(static_cast<std::size_t>(window.columns * window.rows), SampleRules::kVoid);
  const std::int64_t count = CeilingOf(layout_.columns, factor), side = ChunkGrid::kSide / factor;
  const auto turn = [&](std::int64_t column) { return column >= 0 ? column / count : -((count - 1 - column) / count); };
  for (std::int64_t t = turn(window.column); t <= turn(window.column + window.columns - 1); ++t) {
    GridWindow here = window;
    here.column -= t * count;
    const std::int64_t west = std::max<std::int64_t>(here.column, 0) / side;
    const std::int64_t east = (std::min(here.column + here.columns, count) - 1) / side;
    for (std::int64_t row = here.row / side; row <= (here.row + here.rows - 1) / side; ++row) {
      for (std::int64_t column = west; column <= east; ++column) {
        auto copied =
            CopyChunk(*file, factor, static_cast<int>(row * chunks_.columns() + column), here, heights.data());
        if (!copied) return tl::unexpected(copied.error());
      }
    }
  }
  return heights;
}

void CachedAverages::Discard() const {
  if (IdentityOf(path_) == identity_) ::unlink(path_.c_str());
}

std::optional<CachedStatistics> LoadStatistics(const std::string& path, const StatisticsShape& wanted) {
  OpenFile file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file.is_open()) return std::nullopt;
  const std::uint64_t size = SizeOf(file.get());
  const auto damaged = [&](const char* what) {
    LogSource(SourceLog::Level::kWarn, path, "{} does not fit its checksum, or was cut; the source is prepared anew",
              what);
    return std::nullopt;
  };
  StatisticsShape shape = wanted;
  std::uint64_t header_bytes = 0;
  switch (ReadHeader(file.get(), shape, header_bytes)) {
    case HeaderState::kDamaged:
      return damaged("its header");
    case HeaderState::kOther:
      LogSource(SourceLog::Level::kInfo, path, "was made from another state of the source, or by another version");
      return std::nullopt;
    case HeaderState::kSame:
      break;
  }
  const RasterLayout layout = shape.EffectiveLayout();
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
  CachedStatistics cached{std::move(shape.detected), *std::move(statistics), nullptr};
  if (LeastKeptFactor(layout) < kLargestDirect) {
    cached.averages = std::make_shared<const CachedAverages>(file, path, layout, std::move(offsets));
  }
  return cached;
}

StatisticsCacheWriter::StatisticsCacheWriter(OpenFile file, std::string path, const StatisticsShape& shape)
    : file_(std::move(file)),
      path_(std::move(path)),
      shape_(shape),
      layout_(shape.EffectiveLayout()),
      chunks_(layout_.width, layout_.height) {}

Result<std::optional<StatisticsCacheWriter>> StatisticsCacheWriter::Open(const std::string& path,
                                                                         const StatisticsShape& shape,
                                                                         const std::stop_token& stop) {
  const std::string partial = path + ".partial";
  for (bool waiting = false;;) {
    OpenFile file(::open(partial.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
    if (!file.is_open()) return MakeError(ErrorCode::kUnavailable, "{}: cannot be written: {}", partial, ErrorText());
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
    if (!IsSameFile(file.get(), partial)) continue;
    if (waiting && LoadStatistics(path, shape)) {
      ::unlink(partial.c_str());
      return std::nullopt;
    }
    StatisticsCacheWriter writer(std::move(file), path, shape);
    if (auto begun = writer.Begin(); !begun) return tl::unexpected(begun.error());
    return std::optional(std::move(writer));
  }
}

Result<void> StatisticsCacheWriter::Begin() {
  if (ReadHeader(file_.get(), shape_, end_) != HeaderState::kSame) return Restart(shape_.detected);
  layout_ = shape_.EffectiveLayout();
  return {};
}

Result<void> StatisticsCacheWriter::Restart(const DetectedNodata& detected) {
  shape_.detected = detected;
  layout_ = shape_.EffectiveLayout();
  offsets_.clear();
  end_ = 0;
  if (auto cut = Cut(); !cut) return cut;
  return Write(HeaderOf(shape_));
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

Result<void> StatisticsCacheWriter::Write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(file_.get(), bytes.data(), bytes.size(), static_cast<off_t>(end_));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      const std::string why = ErrorText();
      ::unlink((path_ + ".partial").c_str());  // complete or not, it takes disk space that is needed
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
      EncodeCachedChunk(static_cast<std::uint32_t>(offsets_.size()), chunk_statistics, LeastKeptFactor(layout_));
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
