#include "engine/dem/prepare.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <xxhash.h>

#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>

#include "engine/core/bytes.h"

namespace terrace::dem {
namespace {

// Everything that decides what a survey says of a raster.
std::uint64_t KeyOf(const RasterLayout& layout, const std::string& path, const StampedFiles& files) {
  ByteWriter writer;
  writer.PutBytes(path);
  writer.Put(files.fingerprint());
  for (const int part : {layout.width, layout.height, layout.columns, layout.wraps ? 1 : 0}) writer.Put(part);
  const SampleRules& rules = layout.rules;
  writer.Put(rules.nodata.value_or(0));
  for (const bool rule : {rules.nodata.has_value(), rules.compare_as_float, rules.has_mask, rules.is_indicator}) {
    writer.Put<std::uint8_t>(rule ? 1 : 0);
  }
  for (const double rule : {rules.scale, rules.offset, rules.metres_per_unit}) writer.Put(rule);
  for (const int factor : layout.overview_factors) writer.Put(factor);
  const std::string bytes = writer.Take();
  return XXH3_64bits(bytes.data(), bytes.size());
}

std::optional<RecordWriter> OpenWriter(const std::string& record, const RecordShape& shape,
                                       const std::function<void(const ChunkSurvey&)>& keep) {
  std::error_code failed;
  std::filesystem::create_directories(std::filesystem::path(record).parent_path(), failed);
  auto writer = RecordWriter::Open(record, shape, keep);
  if (writer) return *std::move(writer);
  spdlog::warn("{}; what is learnt of the source is not kept", writer.error().message);
  return std::nullopt;
}

}  // namespace

bool NeedsAverages(const RasterLayout& layout) {
  return layout.overview_factors.empty() && std::int64_t{layout.width} * layout.height > kMostSamplesWithoutAverages;
}

std::string RecordPath(const std::string& cache_dir, const std::string& path) {
  std::error_code unresolved;
  std::filesystem::path whole = std::filesystem::weakly_canonical(path, unresolved);
  if (unresolved) whole = path;
  const std::string text = whole.string();
  return (std::filesystem::path(cache_dir) /
          fmt::format("{}-{:016x}.survey", whole.filename().string(), XXH3_64bits(text.data(), text.size())))
      .string();
}

Result<PreparedRaster> PrepareRaster(GDALDataset& dataset, const RasterLayout& layout, const std::string& path,
                                     const StampedFiles& files, const std::string& cache_dir,
                                     const std::function<void(double)>& progress) {
  const ChunkGrid chunks(layout.width, layout.height);
  PreparedRaster prepared;
  prepared.preparation.parts = chunks.count();
  const RecordShape shape{layout, KeyOf(layout, path, files), NeedsAverages(layout)};
  const std::string record = cache_dir.empty() ? std::string() : RecordPath(cache_dir, path);
  std::optional<RecordWriter> writer;
  const auto load = [&] {
    auto known = LoadRecord(record, shape);
    if (!known) return false;
    prepared.survey = std::move(known->survey);
    prepared.averages = std::move(known->averages);
    prepared.preparation.from_record = true;
    return true;
  };
  SurveyAssembler assembler(layout);
  int done = 0;
  if (!record.empty()) {
    if (load()) return prepared;
    writer = OpenWriter(record, shape, [&](const ChunkSurvey& part) { assembler.Add(chunks.At(done++), part); });
    if (!writer && load()) return prepared;
    prepared.preparation.parts_kept = done;
    if (done > 0) spdlog::info("{}: {} of {} parts were prepared before", path, done, chunks.count());
  }
  for (; done < chunks.count(); ++done) {
    const auto part = SurveyChunk(dataset, layout, chunks.At(done), prepared.preparation.parts_read);
    if (!part) return MakeError(part.error().code, "{}: {}", path, part.error().message);
    assembler.Add(chunks.At(done), *part);
    if (writer) {
      if (auto added = writer->Add(*part); !added) {
        spdlog::warn("{}; what is learnt of the source is not kept", added.error().message);
        writer.reset();
      }
    }
    if (progress) progress((done + 1.0) / chunks.count());
  }
  auto survey = assembler.Finish(dataset);
  if (!survey) return MakeError(survey.error().code, "{}: {}", path, survey.error().message);
  prepared.survey = *std::move(survey);
  // A file that changed meanwhile is a mixture, which its caller will refuse.
  if (!writer || files.FirstChanged()) return prepared;
  if (auto finished = writer->Finish(prepared.survey); !finished) {
    spdlog::warn("{}; what is learnt of the source is not kept", finished.error().message);
    return prepared;
  }
  if (auto known = LoadRecord(record, shape)) prepared.averages = std::move(known->averages);
  return prepared;
}

}  // namespace terrace::dem
