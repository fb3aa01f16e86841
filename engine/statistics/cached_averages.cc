#include "engine/statistics/cached_averages.h"

#include <fcntl.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <memory>
#include <utility>

#include "engine/common/dem_types.h"
#include "engine/common/lru_block_cache.h"
#include "engine/core/errno_text.h"
#include "engine/raster/nan_heights.h"

namespace terrace::dem {
namespace {

std::int64_t SteadySeconds() {
  return std::chrono::duration_cast<std::chrono::seconds>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Size and offset of a chunk's averages of one factor, of the stored `factors`. Each factor is preceded by its
// checksum.
struct AveragesPlace {
  std::uint64_t offset = 0;
  int columns = 0, rows = 0;
  std::size_t bytes() const { return Area(columns, rows) * sizeof(float); }
};
AveragesPlace PlaceOf(const Chunk& chunk, const RasterLayout& layout, unsigned factors, int factor) {
  AveragesPlace place;
  const int used = std::clamp(layout.columns - chunk.col, 0, chunk.cols);
  for (int f = 2;; f *= 2) {
    place.columns = DivideUp(used, f);
    place.rows = DivideUp(chunk.rows, f);
    if (f == factor) return place;
    if ((factors & static_cast<unsigned>(f)) != 0) place.offset += sizeof(std::uint64_t) + place.bytes();
  }
}

struct ChunkKey {
  std::uint64_t averages = 0;  // CachedAverages' number in this process
  int factor = 0, chunk = 0;

  friend bool operator==(const ChunkKey&, const ChunkKey&) = default;
};

struct ChunkKeyHash {
  std::size_t operator()(const ChunkKey& key) const noexcept {
    const std::uint64_t numbers[] = {key.averages, static_cast<std::uint64_t>(key.factor),
                                     static_cast<std::uint64_t>(key.chunk)};
    return XXH3_64bits(numbers, sizeof numbers);
  }
};

std::uint64_t NextId() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

}  // namespace

struct CachedAverages::ChunkAverages {
  std::unique_ptr<char[]> bytes;  // as in the file: the checksum, then floats, row by row
  const char* floats() const { return bytes.get() + sizeof(std::uint64_t); }
};

CachedAverages::CachedAverages(const OpenFile& file, std::string header, std::string path, RasterLayout layout,
                               std::vector<std::uint64_t> offsets)
    : id_(NextId()),
      identity_(IdentityOf(file.get()).value_or(FileIdentity())),
      header_(std::move(header)),
      path_(std::move(path)),
      layout_(std::move(layout)),
      factors_(KeptFactors(layout_)),
      chunks_(layout_.width, layout_.height),
      offsets_(std::move(offsets)),
      touched_s_(SteadySeconds()) {}

Result<OpenFile> CachedAverages::Open() const {
  OpenFile file(::open(path_.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file.is_open()) {
    const bool passes = errno == EMFILE || errno == ENFILE || errno == ENOMEM || errno == EINTR;
    return MakeError(passes ? ErrorCode::kUnavailable : ErrorCode::kNotFound, "{}: cannot be opened: {}", path_,
                     ErrorText());
  }
  if (IdentityOf(file.get()) != identity_ || ReadAt(file.get(), 0, header_.size(), header_.size()) != header_)
    return MakeError(ErrorCode::kNotFound, "{}: was replaced", path_);
  TouchHourly(file);
  return file;
}

// Processes that share the folder remove what was not used for longest.
void CachedAverages::TouchHourly(const OpenFile& file) const {
  constexpr std::int64_t kHour = 3600;
  const std::int64_t now = SteadySeconds();
  std::int64_t last = touched_s_.load(std::memory_order_relaxed);
  if (now - last >= kHour && touched_s_.compare_exchange_strong(last, now)) Touch(file.get());
}

Result<std::shared_ptr<const CachedAverages::ChunkAverages>> CachedAverages::ReadChunk(const OpenFile& file, int factor,
                                                                                       int index, std::uint64_t offset,
                                                                                       std::size_t size) const {
  // Never destroyed: worker threads may outlive static objects.
  static auto* const recent = new LruBlockCache<ChunkKey, ChunkAverages, ChunkKeyHash>(kMaxBytesInMemory);
  const ChunkKey key{id_, factor, index};
  if (auto known = recent->Find(key)) return known;
  const std::size_t size_with_checksum = sizeof(std::uint64_t) + size * sizeof(float);
  const auto chunk =
      std::make_shared<const ChunkAverages>(ChunkAverages{std::make_unique_for_overwrite<char[]>(size_with_checksum)});
  std::uint64_t checksum = 0;
  const bool read =
      ReadAt(file.get(), offsets_[static_cast<std::size_t>(index)] + offset, chunk->bytes.get(), size_with_checksum);
  std::memcpy(&checksum, chunk->bytes.get(), sizeof checksum);
  if (!read || XXH3_64bits(chunk->floats(), size * sizeof(float)) != checksum) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: the averages of chunk {} by factor {} are damaged", path_, index,
                     factor);
  }
  bytes_read_ += size_with_checksum;
  constexpr std::size_t kEntryBytes = 200;  // of lists and allocations, about
  recent->Insert(key, chunk, size_with_checksum + kEntryBytes);
  return chunk;
}

// The window does not wrap here: columns of the chunk lie at `window.column` + multiples of the grid's width.
Result<void> CachedAverages::CopyChunk(const OpenFile& file, int factor, int index, const GridWindow& window,
                                       float* out) const {
  const Chunk chunk = chunks_.At(index);
  const AveragesPlace place = PlaceOf(chunk, layout_, factors_, factor);
  const std::int64_t left = chunk.col / factor, top = chunk.row / factor;
  const std::int64_t west = std::max(left, window.column),
                     east = std::min(left + place.columns, window.column + window.columns);
  const std::int64_t north = std::max(top, window.row), south = std::min(top + place.rows, window.row + window.rows);
  if (west >= east || north >= south || offsets_[static_cast<std::size_t>(index)] == 0) return {};
  const auto averages = ReadChunk(file, factor, index, place.offset, Area(place.columns, place.rows));
  if (!averages) return tl::unexpected(averages.error());
  for (std::int64_t row = north; row < south; ++row) {
    std::memcpy(out + (row - window.row) * window.columns + (west - window.column),
                (*averages)->floats() + ((row - top) * place.columns + west - left) * std::ptrdiff_t{sizeof(float)},
                static_cast<std::size_t>(east - west) * sizeof(float));
  }
  return {};
}

Result<std::vector<float>> CachedAverages::Read(int factor, const GridWindow& window) const {
  const Result<OpenFile> file = Open();
  if (!file) return tl::unexpected(file.error());
  std::vector<float> heights = NaNHeights(static_cast<std::size_t>(window.columns * window.rows));
  const std::int64_t count = DivideUp(layout_.columns, factor), side = ChunkGrid::kSide / factor;
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

}  // namespace terrace::dem
