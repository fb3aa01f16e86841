#include "engine/dem/statistics/statistics_codec.h"

#include <cstring>
#include <type_traits>
#include <vector>

#include "engine/core/bytes.h"

namespace terrace::dem {
namespace {

static_assert(std::is_trivially_copyable_v<BlockRange> && sizeof(BlockRange) == 12);

void PutRanges(ByteWriter& writer, const std::vector<BlockRange>& ranges) {
  for (const BlockRange& range : ranges) {
    writer.Put(range.min);
    writer.Put(range.max);
    writer.Put(static_cast<std::uint8_t>((range.has_voids ? 1 : 0) | (range.has_holes ? 2 : 0)));
  }
}

// The sizes of vectors are not stored, because they follow from the raster's shape.
void GetRanges(ByteReader& reader, std::vector<BlockRange>& ranges) {
  for (BlockRange& range : ranges) {
    range.min = reader.Get<float>();
    range.max = reader.Get<float>();
    const auto voids = reader.Get<std::uint8_t>();
    range.has_voids = (voids & 1) != 0;
    range.has_holes = (voids & 2) != 0;
  }
}

void PutFloats(ByteWriter& writer, const std::vector<float>& values) {
  writer.PutBytes({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)});
}
void GetFloats(ByteReader& reader, std::vector<float>& values) {
  const std::string_view raw = reader.GetBytes(values.size() * sizeof(float));
  if (raw.size() == values.size() * sizeof(float) && !raw.empty()) std::memcpy(values.data(), raw.data(), raw.size());
}

void Put(ByteWriter& writer, const BlockSum& sum) {
  writer.Put(sum.sum);
  writer.Put(sum.weight);
}
void Put(ByteWriter& writer, const ZeroEdges& zeros) {
  for (const std::int64_t count : {zeros.high, zeros.low, zeros.zeros, zeros.at_border}) writer.Put(count);
  for (const std::int32_t side : {zeros.west, zeros.east, zeros.north, zeros.south}) writer.Put(side);
  writer.Put(zeros.lowest);
  writer.Put(zeros.highest);
}
ZeroEdges GetZeros(ByteReader& reader) {
  ZeroEdges zeros;
  for (std::int64_t* count : {&zeros.high, &zeros.low, &zeros.zeros, &zeros.at_border}) {
    *count = reader.Get<std::int64_t>();
  }
  for (std::int32_t* side : {&zeros.west, &zeros.east, &zeros.north, &zeros.south}) *side = reader.Get<std::int32_t>();
  zeros.lowest = reader.Get<float>();
  zeros.highest = reader.Get<float>();
  return zeros;
}

// Returns nothing if there are fewer bytes than stated.
std::optional<std::uint32_t> GetCount(ByteReader& reader, std::size_t bytes_each) {
  const auto count = reader.Get<std::uint32_t>();
  return count <= reader.remaining() / bytes_each ? std::optional(count) : std::nullopt;
}

void Put(ByteWriter& writer, const RimVoids& voids) {
  writer.Put<std::uint8_t>(voids.is_everything() ? 1 : 0);
  writer.Put(voids.regions());
  const std::vector<RimVoids::Run> runs = voids.Runs();
  writer.Put(static_cast<std::uint32_t>(runs.size()));
  for (const RimVoids::Run& run : runs) {
    for (const std::int32_t place : {run.row, run.first, run.last}) writer.Put(place);
    writer.Put(run.region);
  }
}
std::optional<RimVoids> GetRimVoids(ByteReader& reader, const RasterLayout& layout) {
  const bool is_everything = reader.Get<std::uint8_t>() != 0;
  const auto regions = reader.Get<std::uint32_t>();
  const auto count = GetCount(reader, sizeof(RimVoids::Run));
  if (!count) return std::nullopt;
  std::vector<RimVoids::Run> runs(*count);
  for (RimVoids::Run& run : runs) {
    for (std::int32_t* place : {&run.row, &run.first, &run.last}) *place = reader.Get<std::int32_t>();
    run.region = reader.Get<std::uint32_t>();
    if (run.row < (&run == runs.data() ? 0 : (&run - 1)->row) || run.row >= layout.height || run.region >= regions) {
      return std::nullopt;
    }
  }
  return is_everything ? RimVoids::Everything() : RimVoids(runs, regions);
}

BlockSum GetSum(ByteReader& reader) {
  const auto sum = reader.Get<double>();
  return {sum, reader.Get<double>()};
}

}  // namespace

std::string EncodeChunk(const ChunkStatistics& chunk_statistics) {
  ByteWriter writer;
  writer.Put(chunk_statistics.valid);
  Put(writer, chunk_statistics.zeros);
  Put(writer, chunk_statistics.first_row);
  Put(writer, chunk_statistics.last_row);
  PutRanges(writer, chunk_statistics.ranges);
  writer.Put(static_cast<std::uint32_t>(chunk_statistics.voids.size()));
  for (const VoidRun& run : chunk_statistics.voids) {
    for (const std::uint16_t place : {run.row, run.first, run.last}) writer.Put(place);
  }
  for (const auto& errors : chunk_statistics.errors) PutFloats(writer, errors);
  if (!chunk_statistics.averages.empty()) PutFloats(writer, chunk_statistics.averages.back());
  for (const auto& sums : chunk_statistics.sums) {
    for (const BlockSum& sum : sums) Put(writer, sum);
  }
  return writer.Take();
}

std::optional<ChunkStatistics> DecodeChunk(std::string_view bytes, const Chunk& chunk, const RasterLayout& layout) {
  ByteReader reader(bytes);
  ChunkStatistics chunk_statistics = VoidStatistics(chunk, layout);
  if (!chunk_statistics.averages.empty()) {
    chunk_statistics.averages.back().resize(AveragesIn(chunk, layout, 1 << chunk_statistics.averages.size()));
  }
  for (std::size_t k = 0; k < chunk_statistics.sums.size(); ++k) {
    chunk_statistics.sums[k].resize(AveragesIn(chunk, layout, kLargestDirect << (k + 1)));
  }
  chunk_statistics.valid = reader.Get<std::int64_t>();
  chunk_statistics.zeros = GetZeros(reader);
  chunk_statistics.first_row = GetSum(reader);
  chunk_statistics.last_row = GetSum(reader);
  GetRanges(reader, chunk_statistics.ranges);
  const auto runs = GetCount(reader, sizeof(VoidRun));
  if (!runs) return std::nullopt;
  chunk_statistics.voids.resize(*runs);
  for (VoidRun& run : chunk_statistics.voids) {
    for (std::uint16_t* place : {&run.row, &run.first, &run.last}) *place = reader.Get<std::uint16_t>();
  }
  for (auto& errors : chunk_statistics.errors) GetFloats(reader, errors);
  if (!chunk_statistics.averages.empty()) GetFloats(reader, chunk_statistics.averages.back());
  for (auto& sums : chunk_statistics.sums) {
    for (BlockSum& sum : sums) sum = GetSum(reader);
  }
  if (!reader.ok() || reader.remaining() > 0) return std::nullopt;
  return chunk_statistics;
}

std::string EncodeStatistics(const RasterStatistics& statistics) {
  ByteWriter writer;
  writer.Put(statistics.lowest);
  writer.Put(statistics.highest);
  writer.Put(statistics.valid);
  writer.Put(statistics.voids);
  writer.Put(statistics.hole_samples);
  Put(writer, statistics.rim_voids);
  Put(writer, statistics.zeros);
  for (const auto& mean : statistics.edge_row_means) {
    writer.Put<std::uint8_t>(mean ? 1 : 0);
    writer.Put(mean.value_or(0));
  }
  PutRanges(writer, statistics.table.finest());
  for (const AveragingErrors::Level& level : statistics.errors.levels()) PutFloats(writer, level.errors);
  writer.Put<std::uint8_t>(statistics.coarse.grids.empty() ? 0 : 1);
  for (const CoarseAverages::Grid& grid : statistics.coarse.grids) PutFloats(writer, grid.heights);
  return writer.Take();
}

std::optional<RasterStatistics> DecodeStatistics(std::string_view bytes, const RasterLayout& layout) {
  ByteReader reader(bytes);
  RasterStatistics statistics;
  statistics.lowest = reader.Get<float>();
  statistics.highest = reader.Get<float>();
  statistics.valid = reader.Get<std::uint64_t>();
  statistics.voids = reader.Get<std::uint64_t>();
  statistics.hole_samples = reader.Get<std::uint64_t>();
  auto rim_voids = GetRimVoids(reader, layout);
  if (!rim_voids) return std::nullopt;
  statistics.rim_voids = *std::move(rim_voids);
  statistics.zeros = GetZeros(reader);
  for (auto& mean : statistics.edge_row_means) {
    const bool has = reader.Get<std::uint8_t>() != 0;
    const auto value = reader.Get<double>();
    if (has) mean = value;
  }
  statistics.table = RangeTable(layout.width, layout.height);
  std::vector<BlockRange> ranges(statistics.table.finest().size());
  GetRanges(reader, ranges);
  statistics.table.AddBlocks(0, 0, (layout.width + RangeTable::kBlock - 1) / RangeTable::kBlock, ranges);
  statistics.table.Finish();
  statistics.errors = AveragingErrors(layout.width, layout.height);
  for (AveragingErrors::Level& level : statistics.errors.levels()) GetFloats(reader, level.errors);
  if (reader.Get<std::uint8_t>() != 0) {
    statistics.coarse = CoarseAverages::ShapedFor(layout);
    for (CoarseAverages::Grid& grid : statistics.coarse.grids) GetFloats(reader, grid.heights);
  }
  if (!reader.ok() || reader.remaining() > 0) return std::nullopt;
  return statistics;
}

std::string EncodeDetectedNodata(const DetectedNodata& detected) {
  if (!detected.any()) return {};
  ByteWriter writer;
  writer.Put(static_cast<std::uint32_t>(detected.values.size()));
  for (const double value : detected.values) writer.Put(value);
  writer.Put(detected.lowest);
  writer.Put(detected.highest);
  writer.Put<std::int32_t>(detected.rim);
  writer.PutBytes(detected.text);
  return writer.Take();
}

std::optional<DetectedNodata> DecodeDetectedNodata(std::string_view bytes) {
  DetectedNodata detected;
  if (bytes.empty()) return detected;
  ByteReader reader(bytes);
  const auto count = reader.Get<std::uint32_t>();
  if (count > bytes.size() / sizeof(double)) return std::nullopt;
  for (std::uint32_t i = 0; i < count; ++i) detected.values.push_back(reader.Get<double>());
  detected.lowest = reader.Get<double>();
  detected.highest = reader.Get<double>();
  detected.rim = reader.Get<std::int32_t>();
  detected.text = reader.GetBytes(reader.remaining());
  if (!reader.ok() || !detected.any()) return std::nullopt;
  return detected;
}

}  // namespace terrace::dem
