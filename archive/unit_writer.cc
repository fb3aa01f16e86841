#include "archive/unit_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "archive/files/input_file.h"
#include "archive/pmtiles/directory.h"
#include "archive/pmtiles/pmtiles_file.h"
#include "archive/pmtiles/pmtiles_writer.h"
#include "archive/pmtiles_mapping.h"
#include "archive/unit_name.h"
#include "engine/common/content_hash.h"
#include "tiler/tile/tile_bounds.h"

namespace terrace::archive {
namespace {

class PmtilesUnitWriter final : public UnitWriter {
 public:
  PmtilesUnitWriter(std::string name, const UnitOptions& options, PmtilesWriter writer)
      : name_(std::move(name)), options_(options), writer_(std::move(writer)) {}

  Result<void> Add(const geo::TileKey& key, const tiler::EncodedTile& tile, const dem::HeightRange& range) override {
    const bool is_mercator = tiler::IsMercator(options_.kind.format);
    if (!tiler::IsInScheme(key, is_mercator) || UnitNameOf(key) != name_) {
      return MakeError(ErrorCode::kInvalidArgument, "tile {} does not belong to unit {}", geo::ToString(key), name_);
    }
    return writer_.Add(TileIdOf(PmtilesKeyOf(key, is_mercator)), tile, range);
  }

  Result<FileSummary> Finish() override { return writer_.Finish(UnitMetadata(options_.kind, options_.key)); }

 private:
  const std::string name_;
  const UnitOptions options_;
  PmtilesWriter writer_;
};

// Whether the parts of a header that do not depend on the tiles are those of a file with these options. Bounds are
// written in steps of 1e-7 degrees.
bool IsHeaderOf(const PmtilesHeader& header, const PmtilesOptions& options) {
  const auto is_same = [](double a, double b) { return std::abs(a - b) < 2e-7; };
  const dem::GeoBounds &there = header.bounds, &wanted = options.bounds;
  return header.type == options.type && header.tile_compression == options.compression &&
         is_same(there.west, wanted.west) && is_same(there.south, wanted.south) && is_same(there.east, wanted.east) &&
         is_same(there.north, wanted.north);
}

Result<std::string> HashOfFile(const std::string& path) {
  constexpr std::uint64_t kPiece = std::uint64_t{1} << 20;
  const Result<std::unique_ptr<const InputFile>> file = InputFile::Open(path);
  if (!file) return tl::unexpected(file.error());
  dem::ContentHasher hasher;
  for (std::uint64_t at = 0; at < (*file)->size(); at += kPiece) {
    const Result<std::string> bytes = (*file)->Read(at, std::min(kPiece, (*file)->size() - at));
    if (!bytes) return tl::unexpected(bytes.error());
    hasher.AddBytes(bytes->data(), bytes->size());
  }
  const dem::ContentHash hash = hasher.Hash();
  return fmt::format("{:016x}{:016x}", hash.high, hash.low);
}

}  // namespace

Result<std::unique_ptr<UnitWriter>> CreateUnit(const std::string& place, const std::string& name,
                                               const UnitOptions& options) {
  const Result<std::optional<geo::TileKey>> root = UnitRoot(name);
  if (!root) return tl::unexpected(root.error());
  const Result<PmtilesOptions> file_options = PmtilesOptionsOf(options.kind, *root);
  if (!file_options) return tl::unexpected(file_options.error());
  Result<PmtilesWriter> writer = PmtilesWriter::Create(place + "/" + UnitPath(name), *file_options);
  if (!writer) return tl::unexpected(std::move(writer.error()));
  return std::make_unique<PmtilesUnitWriter>(name, options, *std::move(writer));
}

Result<FileSummary> VerifyUnit(const std::string& place, const std::string& name, const UnitOptions& options) {
  const std::string path = place + "/" + UnitPath(name);
  const auto as_damaged = [](Error error) {
    if (error.code == ErrorCode::kUnavailable) error.code = ErrorCode::kInvalidArgument;
    return tl::unexpected(std::move(error));
  };
  const Result<std::unique_ptr<const PmtilesFile>> file = PmtilesFile::Open(path);
  if (!file) return as_damaged(file.error());
  const Result<std::optional<geo::TileKey>> root = UnitRoot(name);
  if (!root) return tl::unexpected(root.error());
  const Result<PmtilesOptions> wanted = PmtilesOptionsOf(options.kind, *root);
  if (!wanted) return tl::unexpected(wanted.error());
  if ((*file)->metadata() != UnitMetadata(options.kind, options.key) || !IsHeaderOf((*file)->header(), *wanted)) {
    return MakeError(ErrorCode::kInvalidArgument, "{} was baked from other sources or with other options", path);
  }
  const bool is_mercator = tiler::IsMercator(options.kind.format);
  FileSummary summary;
  const Result<void> read = (*file)->ForEach([&](std::uint64_t tile_id, const ArchivedTile&) -> Result<void> {
    const std::optional<geo::TileKey> key = TileKeyOf(tile_id, is_mercator);
    if (!key || UnitNameOf(*key) != name) {
      return MakeError(ErrorCode::kInvalidArgument, "{} has a tile of another unit", path);
    }
    ++summary.tiles;
    return {};
  });
  if (!read) return as_damaged(read.error());
  summary.bytes = (*file)->bytes();
  const Result<std::string> hash = HashOfFile(path);
  if (!hash) return as_damaged(hash.error());
  summary.xxh3 = *hash;
  return summary;
}

}  // namespace terrace::archive
