#include "engine/dem/statistics/survey_codec.h"

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

// Vectors have the size that the raster's shape gives them: it is not stored.
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

// Nothing where the bytes hold fewer than they say.
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

std::string EncodePart(const ChunkSurvey& part) {
  ByteWriter writer;
  writer.Put(part.valid);
  Put(writer, part.zeros);
  Put(writer, part.first_row);
  Put(writer, part.last_row);
  PutRanges(writer, part.ranges);
  writer.Put(static_cast<std::uint32_t>(part.voids.size()));
  for (const VoidRun& run : part.voids) {
    for (const std::uint16_t place : {run.row, run.first, run.last}) writer.Put(place);
  }
  for (const auto& errors : part.errors) PutFloats(writer, errors);
  if (!part.averages.empty()) PutFloats(writer, part.averages.back());
  for (const auto& sums : part.sums) {
    for (const BlockSum& sum : sums) Put(writer, sum);
  }
  return writer.Take();
}

std::optional<ChunkSurvey> DecodePart(std::string_view bytes, const Chunk& chunk, const RasterLayout& layout) {
  ByteReader reader(bytes);
  ChunkSurvey part = VoidSurvey(chunk, layout);
  if (!part.averages.empty()) {
    part.averages.back().resize(AveragesIn(chunk, layout, 1 << part.averages.size()));
  }
  for (std::size_t k = 0; k < part.sums.size(); ++k) {
    part.sums[k].resize(AveragesIn(chunk, layout, kLargestDirect << (k + 1)));
  }
  part.valid = reader.Get<std::int64_t>();
  part.zeros = GetZeros(reader);
  part.first_row = GetSum(reader);
  part.last_row = GetSum(reader);
  GetRanges(reader, part.ranges);
  const auto runs = GetCount(reader, sizeof(VoidRun));
  if (!runs) return std::nullopt;
  part.voids.resize(*runs);
  for (VoidRun& run : part.voids) {
    for (std::uint16_t* place : {&run.row, &run.first, &run.last}) *place = reader.Get<std::uint16_t>();
  }
  for (auto& errors : part.errors) GetFloats(reader, errors);
  if (!part.averages.empty()) GetFloats(reader, part.averages.back());
  for (auto& sums : part.sums) {
    for (BlockSum& sum : sums) sum = GetSum(reader);
  }
  if (!reader.ok() || reader.remaining() > 0) return std::nullopt;
  return part;
}

std::string EncodeSurvey(const RasterSurvey& survey) {
  ByteWriter writer;
  writer.Put(survey.lowest);
  writer.Put(survey.highest);
  writer.Put(survey.valid);
  writer.Put(survey.voids);
  writer.Put(survey.hole_samples);
  Put(writer, survey.rim_voids);
  Put(writer, survey.zeros);
  for (const auto& mean : survey.edge_row_means) {
    writer.Put<std::uint8_t>(mean ? 1 : 0);
    writer.Put(mean.value_or(0));
  }
  PutRanges(writer, survey.table.finest());
  for (const AveragingErrors::Level& level : survey.errors.levels()) PutFloats(writer, level.errors);
  writer.Put<std::uint8_t>(survey.coarse.grids.empty() ? 0 : 1);
  for (const CoarseAverages::Grid& grid : survey.coarse.grids) PutFloats(writer, grid.heights);
  return writer.Take();
}

std::optional<RasterSurvey> DecodeSurvey(std::string_view bytes, const RasterLayout& layout) {
  ByteReader reader(bytes);
  RasterSurvey survey;
  survey.lowest = reader.Get<float>();
  survey.highest = reader.Get<float>();
  survey.valid = reader.Get<std::uint64_t>();
  survey.voids = reader.Get<std::uint64_t>();
  survey.hole_samples = reader.Get<std::uint64_t>();
  auto rim_voids = GetRimVoids(reader, layout);
  if (!rim_voids) return std::nullopt;
  survey.rim_voids = *std::move(rim_voids);
  survey.zeros = GetZeros(reader);
  for (auto& mean : survey.edge_row_means) {
    const bool has = reader.Get<std::uint8_t>() != 0;
    const auto value = reader.Get<double>();
    if (has) mean = value;
  }
  survey.table = RangeTable(layout.width, layout.height);
  std::vector<BlockRange> ranges(survey.table.finest().size());
  GetRanges(reader, ranges);
  survey.table.AddBlocks(0, 0, (layout.width + RangeTable::kBlock - 1) / RangeTable::kBlock, ranges);
  survey.table.Finish();
  survey.errors = AveragingErrors(layout.width, layout.height);
  for (AveragingErrors::Level& level : survey.errors.levels()) GetFloats(reader, level.errors);
  if (reader.Get<std::uint8_t>() != 0) {
    survey.coarse = CoarseAverages::ShapedFor(layout);
    for (CoarseAverages::Grid& grid : survey.coarse.grids) GetFloats(reader, grid.heights);
  }
  if (!reader.ok() || reader.remaining() > 0) return std::nullopt;
  return survey;
}

std::string EncodeFindings(const VoidFindings& findings) {
  if (!findings.any()) return {};
  ByteWriter writer;
  writer.Put(static_cast<std::uint32_t>(findings.marks.size()));
  for (const double mark : findings.marks) writer.Put(mark);
  writer.Put(findings.lowest);
  writer.Put(findings.highest);
  writer.Put<std::int32_t>(findings.rim);
  writer.PutBytes(findings.text);
  return writer.Take();
}

std::optional<VoidFindings> DecodeFindings(std::string_view bytes) {
  VoidFindings findings;
  if (bytes.empty()) return findings;
  ByteReader reader(bytes);
  const auto marks = reader.Get<std::uint32_t>();
  if (marks > bytes.size() / sizeof(double)) return std::nullopt;
  for (std::uint32_t i = 0; i < marks; ++i) findings.marks.push_back(reader.Get<double>());
  findings.lowest = reader.Get<double>();
  findings.highest = reader.Get<double>();
  findings.rim = reader.Get<std::int32_t>();
  findings.text = reader.GetBytes(reader.remaining());
  if (!reader.ok() || !findings.any()) return std::nullopt;
  return findings;
}

}  // namespace terrace::dem
