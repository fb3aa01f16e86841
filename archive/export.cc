#include "archive/export.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <system_error>
#include <utility>

#include "archive/documents.h"
#include "archive/files/output_file.h"
#include "archive/files/zip_writer.h"
#include "archive/manifest_json.h"
#include "archive/pmtiles/pmtiles_writer.h"
#include "archive/pmtiles_mapping.h"
#include "archive/static_tileset.h"
#include "engine/core/errno_text.h"
#include "engine/geo/mercator_grid.h"

namespace terrace::archive {
namespace {

// Headers of PMTiles cannot state bounds across the antimeridian; their centre can be there.
void SetBounds(const Manifest& manifest, PmtilesOptions& options) {
  const bool is_mercator = tiler::IsMercator(manifest.kind.format);
  dem::GeoBounds bounds = is_mercator ? HeightTileBounds(manifest) : manifest.dataset.bounds;
  const double width = bounds.east - bounds.west + (bounds.west > bounds.east ? 360 : 0);
  options.center_longitude = std::remainder(bounds.west + width / 2, 360);
  if (bounds.west > bounds.east || bounds.east > 180 || bounds.west < -180) {
    bounds.west = -180;
    bounds.east = 180;
  }
  const double max_latitude = is_mercator ? geo::kMercatorLatitude : 90;
  bounds.south = std::clamp(bounds.south, -max_latitude, max_latitude);
  bounds.north = std::clamp(bounds.north, -max_latitude, max_latitude);
  options.bounds = bounds;
}

Result<void> WriteText(const std::string& path, std::string_view text) {
  Result<OutputFile> out = OutputFile::Create(path);
  if (!out) return tl::unexpected(std::move(out.error()));
  if (Result<void> written = out->Write(text); !written) return written;
  return out->Finish();
}

Result<void> CheckFree(const std::string& out) {
  std::error_code error;
  if (!std::filesystem::exists(out, error)) return {};
  if (std::filesystem::is_directory(out, error) && std::filesystem::is_empty(out, error) &&
      std::filesystem::remove(out, error)) {
    return {};
  }
  return MakeError(ErrorCode::kInvalidArgument, "{} exists already; remove it or choose another place", out);
}

// A folder that is removed unless it is renamed.
class PartialFolder {
 public:
  explicit PartialFolder(std::string path) : path_(std::move(path)), partial_(path_ + std::string(kPartial)) {
    std::filesystem::remove_all(partial_, ignored_);
  }
  ~PartialFolder() { std::filesystem::remove_all(partial_, ignored_); }
  PartialFolder(const PartialFolder&) = delete;
  PartialFolder& operator=(const PartialFolder&) = delete;

  const std::string& partial() const { return partial_; }
  // The files were written without fsync, because fsync of each file would take as long as the bake. Here the files
  // reach the disk before the folder gets its name. The name reaches the disk before the caller removes the files that
  // the folder was made from.
  Result<void> Finish() {
    const int descriptor = ::open(partial_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    const bool is_synced = descriptor >= 0 && ::syncfs(descriptor) == 0;
    const int reason = errno;
    if (descriptor >= 0) ::close(descriptor);
    if (is_synced) return Rename(partial_, path_);
    return MakeError(ErrorCode::kUnavailable, "{} cannot be written: {}", partial_, ErrorText(reason));
  }

 private:
  const std::string path_, partial_;
  std::error_code ignored_;
};

}  // namespace

Result<void> CheckSingle(const std::string& out, const Manifest& manifest, std::size_t max_values) {
  const Result<void> checked = CheckBounds(SingleMetadata(manifest), max_values);
  if (checked) return {};
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: its metadata would be too large: {}; bake chunks, fewer levels or a smaller area", out,
                   checked.error().message);
}

Result<void> WriteSingle(const Archive& archive, const std::string& out, const std::stop_token& stop) {
  const Manifest& manifest = archive.manifest();
  if (Result<void> checked = CheckSingle(out, manifest); !checked) return checked;
  Result<PmtilesOptions> file_options = PmtilesOptionsOf(manifest.kind, std::nullopt);
  if (!file_options) return tl::unexpected(std::move(file_options.error()));
  SetBounds(manifest, *file_options);
  Result<PmtilesWriter> writer = PmtilesWriter::Create(out, *file_options);
  if (!writer) return tl::unexpected(std::move(writer.error()));
  const bool is_mercator = tiler::IsMercator(manifest.kind.format);
  const Result<void> copied = archive.ForEach([&](const geo::TileKey& key, const ArchivedTile& tile) -> Result<void> {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "stopped");
    return writer->Add(TileIdOf(PmtilesKeyOf(key, is_mercator)), tile.tile, tile.range);
  });
  if (!copied) return copied;
  const Result<FileSummary> written = writer->Finish(SingleMetadata(manifest));
  if (!written) return tl::unexpected(written.error());
  return {};
}

Result<void> WriteFolder(const Archive& archive, const std::string& out, const std::stop_token& stop) {
  const Manifest& manifest = archive.manifest();
  if (Result<void> is_free = CheckFree(out); !is_free) return is_free;
  const bool is_mercator = tiler::IsMercator(manifest.kind.format);
  PartialFolder folder(out);
  if (manifest.kind.format == tiler::TileFormat::kGlb) {
    const auto take = [&](const std::string& path, std::string_view bytes, bool) {
      return WriteUnsynced(folder.partial() + "/" + path, bytes);
    };
    if (Result<void> copied = ForEachFileOfTileset(archive, /*has_versions=*/true, take, stop); !copied) return copied;
    return folder.Finish();
  }
  const Result<void> copied = archive.ForEach([&](const geo::TileKey& key, const ArchivedTile& tile) -> Result<void> {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "stopped");
    const std::string path =
        fmt::format("{}/{}.{}", folder.partial(), geo::ToString(key), is_mercator ? "png" : "terrain");
    return WriteUnsynced(path, tile.tile.bytes);
  });
  if (!copied) return copied;
  const Result<void> described = is_mercator ? WriteText(folder.partial() + "/tiles.json", TileJson(manifest))
                                             : WriteText(folder.partial() + "/layer.json", LayerJson(manifest));
  if (!described) return described;
  return folder.Finish();
}

Result<void> Write3tz(const Archive& archive, const std::string& out, const std::stop_token& stop) {
  if (archive.manifest().kind.format != tiler::TileFormat::kGlb) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: a 3TZ file holds 3D Tiles; bake it with --format glb", out);
  }
  Result<ZipWriter> zip = ZipWriter::Create(out);
  if (!zip) return tl::unexpected(std::move(zip.error()));
  const auto take = [&](const std::string& path, std::string_view bytes, bool is_gzip) {
    return is_gzip ? zip->AddGzip(path, bytes) : zip->Add(path, bytes);
  };
  if (Result<void> copied = ForEachFileOfTileset(archive, /*has_versions=*/false, take, stop); !copied) return copied;
  return zip->Finish();
}

}  // namespace terrace::archive
