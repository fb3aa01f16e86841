#include "engine/dem/sources/prepare.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>

#include "engine/core/bytes.h"
#include "engine/dem/common/source_log.h"

namespace terrace::dem {
namespace {

// Changes whenever blocks are read otherwise from the same overviews: a survey compares samples with them.
constexpr std::uint32_t kOverviewReading = 2;
// Changes whenever other voids are found in the same raster (void_marks.h).
constexpr std::uint32_t kVoidFinding = 2;

// Everything that decides what a survey says of a raster, and is known before.
std::uint64_t KeyOf(const RasterLayout& layout, bool find_voids, const std::string& path, const StampedFiles& files) {
  ByteWriter writer;
  writer.PutBytes(path);
  writer.Put(files.fingerprint());
  for (const int part : {layout.width, layout.height, layout.columns, layout.wraps ? 1 : 0}) writer.Put(part);
  const SampleRules& rules = layout.rules;
  writer.Put(rules.nodata.value_or(0));
  for (const bool rule :
       {rules.nodata.has_value(), rules.compare_as_float, rules.has_mask, rules.is_indicator, find_voids}) {
    writer.Put<std::uint8_t>(rule ? 1 : 0);
  }
  for (const double rule :
       {rules.scale, rules.offset, rules.metres_per_unit, rules.lowest, rules.highest, double(rules.rim)}) {
    writer.Put(rule);
  }
  writer.Put(static_cast<std::uint32_t>(rules.marks.size()));
  for (const double mark : rules.marks) writer.Put(mark);
  for (const int factor : layout.overview_factors) writer.Put(factor);
  if (!layout.overview_factors.empty()) writer.Put(kOverviewReading);
  if (find_voids) writer.Put(kVoidFinding);
  writer.Put(layout.coast_step_m);
  const std::string bytes = writer.Take();
  return XXH3_64bits(bytes.data(), bytes.size());
}

// One raster's way to its survey. Without a record everything is kept in memory alone.
class Preparer {
 public:
  Preparer(GDALDataset& dataset, const RasterLayout& layout, const std::string& path, const StampedFiles& files,
           const PrepareOptions& options)
      : dataset_(dataset),
        path_(path),
        files_(files),
        options_(options),
        shape_{layout, KeyOf(layout, options.find_voids, path, files), {}},
        chunks_(layout.width, layout.height) {
    if (!options.cache_dir.empty()) {
      record_ =
          RecordPath(options.cache_dir, path, layout.rules.marks, options.find_voids, !layout.overview_factors.empty());
    }
    prepared_.preparation.parts = chunks_.count();
  }

  Result<PreparedRaster> Run() {
    if (!record_.empty()) {
      if (Load()) return std::move(prepared_);
      if (auto opened = OpenWriter(); !opened) return tl::unexpected(opened.error());
      if (!writer_ && Load()) return std::move(prepared_);
    }
    auto survey = Survey();
    if (survey && options_.find_voids && !shape_.findings.any()) survey = WithoutFoundVoids(*std::move(survey));
    if (!survey) return Named(survey.error());
    prepared_.findings = shape_.findings;
    prepared_.survey = *std::move(survey);
    FinishRecord();
    return std::move(prepared_);
  }

 private:
  tl::unexpected<Error> Named(const Error& error) const {
    return MakeError(error.code, "{}: {}", path_, error.message);
  }

  bool Load() {
    auto known = LoadRecord(record_, shape_);
    if (!known) return false;
    prepared_.findings = std::move(known->findings);
    prepared_.survey = std::move(known->survey);
    prepared_.averages = std::move(known->averages);
    prepared_.record = record_;
    prepared_.shape = shape_;
    prepared_.preparation.from_record = true;
    return true;
  }

  void GiveUpRecord(const Error& error) {
    LogSource(SourceLog::Level::kWarn, path_, "what is learnt of it is not kept: {}", error.message);
    writer_.reset();
  }

  // kCancelled: stopped.
  Result<void> OpenWriter() {
    std::error_code failed;
    std::filesystem::create_directories(options_.cache_dir, failed);
    auto writer = RecordWriter::Open(record_, shape_, options_.stop);
    if (writer) {
      writer_ = *std::move(writer);
      if (writer_) shape_ = writer_->shape();
      return {};
    }
    if (writer.error().code == ErrorCode::kCancelled) return tl::unexpected(writer.error());
    GiveUpRecord(writer.error());
    return {};
  }

  // One pass through the raster, behind what was done of it before.
  Result<RasterSurvey> Survey() {
    const RasterLayout layout = shape_.EffectiveLayout();
    SurveyAssembler assembler(layout);
    int done = 0;
    if (writer_) {
      auto resumed = writer_->Resume([&](const ChunkSurvey& part) { assembler.Add(chunks_.At(done++), part); });
      if (!resumed) GiveUpRecord(resumed.error());
      prepared_.preparation.parts_kept += done;
      if (done > 0)
        LogSource(SourceLog::Level::kInfo, path_, "{} of {} parts were prepared before", done, chunks_.count());
    }
    for (; done < chunks_.count(); ++done) {
      const auto part =
          SurveyChunk(dataset_, layout, chunks_.At(done), prepared_.preparation.parts_read, options_.stop);
      if (!part) return tl::unexpected(part.error());
      assembler.Add(chunks_.At(done), *part);
      if (writer_) {
        if (auto added = writer_->Add(*part); !added) GiveUpRecord(added.error());
      }
      if (options_.progress) options_.progress((done + 1.0) / chunks_.count());
    }
    return assembler.Finish(dataset_, options_.stop);
  }

  // The survey, or another one under the rules that it calls for.
  Result<RasterSurvey> WithoutFoundVoids(RasterSurvey survey) {
    const SampleRules& rules = shape_.layout.rules;
    const bool has_collar = survey.zeros.IsCollar(shape_.layout.width, shape_.layout.height);
    if (!MayHideVoids(rules, survey.lowest, survey.highest, survey.voids > 0, has_collar)) return survey;
    auto findings = FindVoids(*dataset_.GetRasterBand(1), rules, has_collar, shape_.layout.coast_step_m, options_.stop);
    if (!findings) return tl::unexpected(findings.error());
    if (!findings->any()) return survey;
    shape_.findings = *std::move(findings);
    if (writer_) {
      if (auto restarted = writer_->Restart(shape_.findings); !restarted) GiveUpRecord(restarted.error());
    }
    return Survey();
  }

  void FinishRecord() {
    // A file that changed meanwhile is a mixture, which its caller will refuse.
    if (!writer_ || files_.FirstChanged()) return;
    if (auto finished = writer_->Finish(prepared_.survey); !finished) return GiveUpRecord(finished.error());
    auto known = LoadRecord(record_, shape_);
    if (!known) return;
    prepared_.averages = std::move(known->averages);
    prepared_.record = record_;
    prepared_.shape = shape_;
  }

  GDALDataset& dataset_;
  const std::string& path_;
  const StampedFiles& files_;
  const PrepareOptions& options_;
  RecordShape shape_;
  const ChunkGrid chunks_;
  std::string record_;  // its path; empty: none
  std::optional<RecordWriter> writer_;
  PreparedRaster prepared_;
};

}  // namespace

std::string RecordPath(const std::string& cache_dir, const std::string& path, const std::vector<double>& marks,
                       bool find_voids, bool has_overviews) {
  std::error_code unresolved;
  std::filesystem::path whole = std::filesystem::weakly_canonical(path, unresolved);
  if (unresolved) whole = path;
  ByteWriter writer;
  writer.PutBytes(whole.string());
  for (const double mark : marks) writer.Put(mark);
  if (!find_voids) writer.Put<std::uint8_t>(0);
  if (has_overviews) writer.Put<std::uint8_t>(1);
  const std::string bytes = writer.Take();
  return (std::filesystem::path(cache_dir) /
          fmt::format("{}-{:016x}.survey", whole.filename().string(), XXH3_64bits(bytes.data(), bytes.size())))
      .string();
}

Result<PreparedRaster> PrepareRaster(GDALDataset& dataset, const RasterLayout& layout, const std::string& path,
                                     const StampedFiles& files, const PrepareOptions& options) {
  return Preparer(dataset, layout, path, files, options).Run();
}

}  // namespace terrace::dem
