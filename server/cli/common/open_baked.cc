#include "server/cli/common/open_baked.h"

#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>

#include "archive/archive.h"
#include "archive/baked_tiles.h"
#include "archive/manifest.h"
#include "config/options/options.h"
#include "engine/common/file_stamp.h"
#include "engine/gdal/source_policy.h"
#include "tiler/encoder_version.h"
#include "tiler/tile/tile_request.h"

namespace terrace::cli {
namespace {

using Archives = std::vector<std::shared_ptr<const archive::Archive>>;

bool IsFile(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored);
}

// The files that a place is opened from.
std::vector<std::string> FilesAt(const std::string& place) {
  std::vector<std::string> files = archive::Archive::FilesOf(place);
  std::erase_if(files, [](const std::string& file) { return !IsFile(file); });
  return files;
}

// Call it before OpenArchives: an archive that is replaced meanwhile, or appears, then differs from its stamp.
std::vector<tiler::WatchedFile> StampFiles(const std::string& place) {
  std::vector<tiler::WatchedFile> files;
  for (std::string& path : archive::Archive::FilesOf(place)) {
    std::optional<dem::FileStamp> stamp = dem::StampOf(path);
    files.push_back({std::move(path), stamp});
  }
  return files;
}

Result<Archives> OpenArchives(const std::string& place) {
  for (const std::string& file : FilesAt(place)) {
    if (Result<void> allowed = dem::CheckPlainFile(file); !allowed) return tl::unexpected(std::move(allowed.error()));
  }
  Result<Archives> archives = archive::Archive::OpenAll(place);
  if (!archives) return archives;
  for (const auto& opened : *archives) {
    if (opened->manifest().dataset.generation == archives->front()->manifest().dataset.generation) continue;
    return MakeError(ErrorCode::kInvalidArgument,
                     "{} and {} were baked from different versions of the dataset; bake the older one again",
                     archives->front()->place(), opened->place());
  }
  return archives;
}

// A dataset without sources has one error for each level and one set of tiles, whatever the format of its meshes.
Result<void> CheckSameTiles(const Archives& archives) {
  const archive::Manifest& first = archives.front()->manifest();
  for (const auto& opened : archives) {
    const archive::Manifest& other = opened->manifest();
    if (tiler::IsMercator(first.kind.format) || tiler::IsMercator(other.kind.format)) continue;
    const bool has_same_errors = first.error_steps == other.error_steps;
    if (has_same_errors && first.available == other.available) continue;
    return MakeError(
        ErrorCode::kInvalidArgument,
        "{} and {} have different {}; without sources all meshes need the same: bake one of them again with "
        "the options of the other, or serve one alone",
        archives.front()->place(), opened->place(), has_same_errors ? "tiles" : "errors");
  }
  return {};
}

// A manifest's generation is that of the sources and options. Bakes of one generation differ in formats, errors and
// levels, and without sources the replies are those of the archives.
std::uint64_t GenerationOf(const Archives& archives) {
  std::uint64_t generation = 0;
  for (const auto& opened : archives) generation ^= archive::TilesHash(opened->manifest());  // kinds differ
  return generation;
}

void WarnOfUnusedOptions(const config::DatasetConfig& wanted) {
  config::DatasetConfig used;
  used.name = wanted.name;
  used.baked = wanted.baked;
  used.is_public = wanted.is_public;
  const std::vector<std::string> unused = config::ChangedDatasetOptions(wanted, used);
  if (unused.empty()) return;
  spdlog::warn(
      "dataset {}: without \"sources\" its archive is served as it was baked, and {} {} no effect; remove "
      "{}, or add the sources",
      wanted.name, fmt::join(unused, ", "), unused.size() == 1 ? "has" : "have", unused.size() == 1 ? "it" : "them");
}

}  // namespace

bool IsArchive(const std::string& path) {
  if (IsFile(path)) return path.ends_with(".pmtiles");
  return !FilesAt(path).empty();
}

Result<std::string> NameOfBaked(const std::string& place) {
  for (const std::string& file : FilesAt(place)) {
    const std::string of = IsFile(place) ? place : std::filesystem::path(file).parent_path().string();
    Result<archive::Manifest> manifest = archive::ReadManifest(of);
    if (!manifest) return tl::unexpected(std::move(manifest.error()));
    return manifest->dataset.name;
  }
  return MakeError(ErrorCode::kNotFound, "{} is no archive; give the folder or file that 'terrace bake' wrote", place);
}

void AddBaked(const config::DatasetConfig& wanted, tiler::Dataset& dataset) {
  if (wanted.baked.empty()) return;
  dataset.baked_files = StampFiles(wanted.baked);
  Result<Archives> archives = OpenArchives(wanted.baked);
  if (!archives) {
    spdlog::warn("dataset {}: its archive is not used, and tiles are built: {}", wanted.name, archives.error().message);
    return;
  }
  const std::uint64_t generation = archives->front()->manifest().dataset.generation;
  if (generation != dataset.generation) {
    spdlog::warn(
        "dataset {}: its archive {} is not used, and tiles are built: it has version {}, and the sources with these "
        "options have version {}; bake it again with --update",
        wanted.name, wanted.baked, tiler::VersionText(generation), tiler::VersionText(dataset.generation));
    return;
  }
  dataset.baked = archive::MakeBakedTiles(*std::move(archives));
}

Result<tiler::Dataset> OpenBakedAlone(const config::DatasetConfig& wanted) {
  WarnOfUnusedOptions(wanted);
  tiler::Dataset dataset;
  dataset.baked_files = StampFiles(wanted.baked);
  Result<Archives> archives = OpenArchives(wanted.baked);
  if (!archives) return tl::unexpected(std::move(archives.error()));
  if (Result<void> same = CheckSameTiles(*archives); !same) return tl::unexpected(std::move(same.error()));
  const archive::BakedDataset& baked = archives->front()->manifest().dataset;
  dataset.name = wanted.name;
  dataset.attribution = baked.attribution;
  dataset.error_fraction = baked.error_fraction;
  dataset.glb.compression = baked.glb_compression;
  for (const auto& opened : *archives) {
    const tiler::TileRequest& kind = opened->manifest().kind;
    if (kind.format == tiler::TileFormat::kGlb) dataset.glb.compression = kind.compression;
  }
  dataset.metadata_availability = baked.metadata_availability;
  dataset.generation = GenerationOf(*archives);
  dataset.baked = archive::MakeBakedTiles(*std::move(archives));
  if (dataset.baked->is_outdated()) {
    spdlog::warn(
        "dataset {}: files of its archive {} are missing, and their tiles answer 503; 'terrace bake --finish' lists "
        "them",
        wanted.name, wanted.baked);
  }
  return dataset;
}

}  // namespace terrace::cli
