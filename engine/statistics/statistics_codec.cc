#include "engine/statistics/statistics_codec.h"

#include <cstring>
#include <vector>

#include "engine/core/bytes.h"

namespace terrace::dem {
namespace {

// Writer and Reader take the same calls, so that each format below is one list of fields for both directions.
class Writer {
 public:
  static constexpr bool kReads = false;

  template <typename... T>
  void operator()(const T&... values) {
    (bytes_.Put(values), ...);
  }
  // The reader's vector has the size that the raster's shape gives it: it is not stored.
  void Floats(const std::vector<float>& values) {
    bytes_.PutBytes({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)});
  }
  template <typename T>
  void Size(const std::vector<T>& values) {
    bytes_.Put(static_cast<std::uint32_t>(values.size()));
  }
  void Rest(const std::string& text) { bytes_.PutBytes(text); }
  std::string Take() { return bytes_.Take(); }

 private:
  ByteWriter bytes_;
};

class Reader {
 public:
  static constexpr bool kReads = true;

  explicit Reader(std::string_view bytes) : bytes_(bytes) {}

  template <typename... T>
  void operator()(T&... values) {
    ((values = bytes_.Get<T>()), ...);
  }
  void Floats(std::vector<float>& values) {
    const std::string_view raw = bytes_.GetBytes(values.size() * sizeof(float));
    if (!raw.empty()) std::memcpy(values.data(), raw.data(), raw.size());
  }
  // Returns nothing if there are fewer bytes than stated.
  template <typename T>
  void Size(std::vector<T>& values) {
    const auto count = bytes_.Get<std::uint32_t>();
    fits_ = fits_ && count <= bytes_.remaining() / sizeof(T);
    values.resize(fits_ ? count : 0);
  }
  void Rest(std::string& text) { text = bytes_.GetBytes(bytes_.remaining()); }
  // Whether all bytes were read, and no more.
  bool ok() const { return fits_ && bytes_.ok() && bytes_.remaining() == 0; }

 private:
  ByteReader bytes_;
  bool fits_ = true;
};

template <typename Archive, typename Ranges>
void RangeFields(Archive& archive, Ranges& ranges) {
  for (auto& range : ranges) {
    auto voids = static_cast<std::uint8_t>((range.has_voids ? 1 : 0) | (range.has_enclosed_voids ? 2 : 0));
    archive(range.min, range.max, voids);
    if constexpr (Archive::kReads) {
      range.has_voids = (voids & 1) != 0;
      range.has_enclosed_voids = (voids & 2) != 0;
    }
  }
}

template <typename Archive, typename Zeros>
void ZeroFields(Archive& archive, Zeros& zeros) {
  archive(zeros.steep, zeros.gentle, zeros.zeros, zeros.at_border, zeros.west, zeros.east, zeros.north, zeros.south);
  archive(zeros.lowest, zeros.highest);
}

template <typename Archive, typename Statistics>
void ChunkFields(Archive& archive, Statistics& chunk) {
  archive(chunk.content.high, chunk.content.low, chunk.valid);
  ZeroFields(archive, chunk.zeros);
  archive(chunk.first_row.sum, chunk.first_row.weight, chunk.last_row.sum, chunk.last_row.weight);
  RangeFields(archive, chunk.ranges);
  archive.Size(chunk.voids);
  for (auto& run : chunk.voids) archive(run.row, run.first, run.last);
  for (auto& errors : chunk.errors) archive.Floats(errors);
  if (!chunk.averages.empty()) archive.Floats(chunk.averages.back());
  for (auto& sums : chunk.sums) {
    for (auto& sum : sums) archive(sum.sum, sum.weight);
  }
}

// The parts of immutable tables.
struct TableParts {
  std::uint8_t is_everything = 0;
  std::uint32_t regions = 0;
  std::vector<RimVoids::Run> runs;
  std::vector<BlockRange> ranges;
};

template <typename Archive, typename Statistics>
void StatisticsFields(Archive& archive, Statistics& statistics, TableParts& parts, const RasterLayout& layout) {
  archive(statistics.content.high, statistics.content.low);
  archive(statistics.lowest, statistics.highest, statistics.valid, statistics.voids, statistics.enclosed_samples);
  auto has_stray_overviews = static_cast<std::uint8_t>(statistics.has_stray_overviews ? 1 : 0);
  archive(has_stray_overviews);
  if constexpr (Archive::kReads) statistics.has_stray_overviews = has_stray_overviews != 0;
  archive(parts.is_everything, parts.regions);
  archive.Size(parts.runs);
  for (auto& run : parts.runs) archive(run.row, run.first, run.last, run.region);
  ZeroFields(archive, statistics.zeros);
  for (auto& mean : statistics.edge_row_means) {
    auto has = static_cast<std::uint8_t>(mean ? 1 : 0);
    double value = mean.value_or(0);
    archive(has, value);
    if constexpr (Archive::kReads) mean = has != 0 ? std::optional(value) : std::nullopt;
  }
  RangeFields(archive, parts.ranges);
  for (auto& level : statistics.errors.levels()) archive.Floats(level.errors);
  auto has_coarse = static_cast<std::uint8_t>(statistics.coarse.grids.empty() ? 0 : 1);
  archive(has_coarse);
  if constexpr (Archive::kReads) {
    if (has_coarse != 0) statistics.coarse = CoarseAverages::ShapedFor(layout);
  }
  for (auto& grid : statistics.coarse.grids) archive.Floats(grid.heights);
}

template <typename Archive, typename Detected>
void DetectedFields(Archive& archive, Detected& detected) {
  archive.Size(detected.values);
  for (auto& value : detected.values) archive(value);
  archive(detected.lowest, detected.highest, detected.void_margin);
  archive.Rest(detected.text);
}

}  // namespace

std::string EncodeChunk(const ChunkStatistics& chunk_statistics) {
  Writer writer;
  ChunkFields(writer, chunk_statistics);
  return writer.Take();
}

std::optional<ChunkStatistics> DecodeChunk(std::string_view bytes, const Chunk& chunk, const RasterLayout& layout) {
  ChunkStatistics chunk_statistics = VoidStatistics(chunk, layout);
  if (!chunk_statistics.averages.empty()) {
    chunk_statistics.averages.back().resize(AveragesIn(chunk, layout, 1 << chunk_statistics.averages.size()));
  }
  for (std::size_t k = 0; k < chunk_statistics.sums.size(); ++k) {
    chunk_statistics.sums[k].resize(AveragesIn(chunk, layout, kLargestMeasuredFactor << (k + 1)));
  }
  Reader reader(bytes);
  ChunkFields(reader, chunk_statistics);
  return reader.ok() ? std::optional(std::move(chunk_statistics)) : std::nullopt;
}

std::string EncodeStatistics(const RasterStatistics& statistics) {
  const RimVoids& voids = statistics.rim_voids;
  TableParts parts{voids.is_everything(), voids.regions(), voids.Runs(), statistics.ranges.finest()};
  Writer writer;
  StatisticsFields(writer, statistics, parts, {});
  return writer.Take();
}

std::optional<RasterStatistics> DecodeStatistics(std::string_view bytes, const RasterLayout& layout) {
  RasterStatistics statistics;
  statistics.ranges = RangeTable(layout.width, layout.height);
  statistics.errors = AveragingErrors(layout.width, layout.height);
  TableParts parts{0, 0, {}, statistics.ranges.finest()};
  Reader reader(bytes);
  StatisticsFields(reader, statistics, parts, layout);
  if (!reader.ok()) return std::nullopt;
  std::int32_t row = 0;
  for (const RimVoids::Run& run : parts.runs) {
    if (run.row < row || run.row >= layout.height || run.region >= parts.regions) return std::nullopt;
    row = run.row;
  }
  statistics.rim_voids = parts.is_everything != 0 ? RimVoids::Everything() : RimVoids(parts.runs, parts.regions);
  statistics.ranges.AddBlocks(0, 0, DivideUp(layout.width, RangeTable::kBlock), parts.ranges);
  statistics.ranges.Finish();
  return statistics;
}

std::string EncodeDetectedNodata(const DetectedNodata& detected) {
  Writer writer;
  if (detected.any()) DetectedFields(writer, detected);
  return writer.Take();
}

std::optional<DetectedNodata> DecodeDetectedNodata(std::string_view bytes) {
  DetectedNodata detected;
  if (bytes.empty()) return detected;
  Reader reader(bytes);
  DetectedFields(reader, detected);
  return reader.ok() && detected.any() ? std::optional(std::move(detected)) : std::nullopt;
}

}  // namespace terrace::dem
