#include "archive/baked_tiles.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <utility>

#include "archive/documents.h"
#include "proto/compress.h"
#include "proto/mesh/quantized_mesh.h"
#include "proto/mesh/tile_metadata.h"
#include "tiler/tile/strong_etag.h"

namespace terrace::archive {
namespace {

using tiler::TileFormat;
using tiler::TileRequest;

// The extensions that the archive's tile has.
proto::TileExtensions ExtensionsIn(const Manifest& manifest, const geo::TileKey& key) {
  const BakedDataset& dataset = manifest.dataset;
  proto::TileExtensions extensions = manifest.kind.extensions;
  extensions.metadata = extensions.metadata && proto::CarriesMetadata(key, dataset.metadata_availability,
                                                                      dataset.max_source_level, manifest.available);
  return extensions;
}

// Whether the archive's tiles are what the request asks for, except for their coding and for extensions that can be
// removed.
bool IsOfKind(const Manifest& manifest, const TileRequest& request) {
  const TileRequest& kind = manifest.kind;
  const int level = request.key.level;
  if (request.format != kind.format) return false;
  if (request.format == TileFormat::kHeightPng) {
    return request.height_encoding == kind.height_encoding && request.side_px == kind.side_px;
  }
  if (request.error_step != manifest.StepAt(level)) return false;
  if (request.format == TileFormat::kGlb) {
    return request.compression == kind.compression && request.texture == kind.texture;
  }
  const proto::TileExtensions extensions = ExtensionsIn(manifest, request.key);
  return (extensions | request.extensions) == extensions;
}

// The bytes of the archive's tile in the coding that the request asks for, without extensions that it does not name.
// Nothing: the bytes are not what the manifest says.
std::optional<std::string> AsRequested(std::string bytes, const Manifest& manifest, const TileRequest& request) {
  constexpr std::size_t kMaxTileBytes = std::size_t{1} << 30;
  const bool is_smaller =
      request.format == TileFormat::kQuantizedMesh && request.extensions != ExtensionsIn(manifest, request.key);
  if (!is_smaller && request.coding == manifest.kind.coding) return bytes;
  if (manifest.kind.coding == tiler::Coding::kGzip) {
    std::optional<std::string> plain = proto::Gunzip(bytes, kMaxTileBytes);
    if (!plain) return std::nullopt;
    bytes = *std::move(plain);
  }
  if (is_smaller) {
    std::optional<std::string> kept = proto::KeepExtensions(bytes, request.extensions);
    if (!kept) return std::nullopt;
    bytes = *std::move(kept);
  }
  return tiler::Compress(std::move(bytes), request.coding);
}

class Baked final : public tiler::BakedTiles {
 public:
  explicit Baked(std::vector<std::shared_ptr<const Archive>> archives) : archives_(std::move(archives)) {
    for (const auto& archive : archives_) Describe(archive->manifest());
    // Documents need the roots, also if there are only height tiles.
    if (extent_.available.empty()) extent_.available = {{{0, 0, 1, 0}}};
  }

  tiler::Coding coding() const override { return archives_.front()->manifest().kind.coding; }
  const tiler::BakedExtent& extent() const override { return extent_; }

  Result<std::optional<tiler::EncodedTile>> Find(const TileRequest& request) const override {
    for (const auto& archive : archives_) {
      const Manifest& manifest = archive->manifest();
      if (!IsOfKind(manifest, request)) continue;
      Result<std::optional<ArchivedTile>> found = archive->Find(request.key);
      if (!found) return tl::unexpected(std::move(found.error()));
      if (!*found) continue;
      tiler::EncodedTile tile = std::move((*found)->tile);
      std::optional<std::string> bytes = AsRequested(std::move(tile.bytes), manifest, request);
      if (!bytes) {
        return MakeError(ErrorCode::kUnavailable, "{}: tile {} is not what the manifest says; bake it again",
                         archive->place(), geo::ToString(request.key));
      }
      tile.bytes = *std::move(bytes);
      tile.etag = tiler::StrongETag(tile.bytes);
      return tile;
    }
    return std::nullopt;
  }

  Result<dem::HeightRange> RangeBound(const geo::TileKey& key) const override {
    for (const auto& archive : archives_) {
      if (archive->manifest().kind.format == TileFormat::kHeightPng) continue;
      const Result<std::optional<dem::HeightRange>> range = archive->FindRange(key);
      if (!range) return tl::unexpected(range.error());
      if (*range) return **range;
    }
    return dem::HeightRange{std::min(extent_.heights.min, extent_.floor_m),
                            std::max(extent_.heights.max, extent_.floor_m)};
  }

  bool is_outdated() const override {
    return std::ranges::any_of(archives_, [](const auto& archive) { return archive->is_outdated(); });
  }

  bool HasKind(const TileRequest& request) const override {
    return std::ranges::any_of(archives_, [&](const auto& archive) { return IsOfKind(archive->manifest(), request); });
  }

  Error WhyAbsent(const TileRequest& request) const override {
    std::string formats;
    for (const TileFormat format : extent_.formats) formats += (formats.empty() ? "" : ", ") + FolderOf(format);
    return {ErrorCode::kNotFound,
            HasKind(request) ? std::string("the dataset comes from an archive, which does not have this tile")
                             : fmt::format("the dataset comes from an archive ({}) with one error and one compression, "
                                           "or one encoding and size of height images; leave these "
                                           "parameters out",
                                           formats)};
  }

 private:
  void Describe(const Manifest& manifest) {
    const BakedDataset& dataset = manifest.dataset;
    extent_.formats.push_back(manifest.kind.format);
    extent_.bounds = dataset.bounds;
    extent_.heights = dataset.heights;
    extent_.floor_m = dataset.floor_m;
    extent_.has_datum = dataset.has_datum;
    extent_.sources = static_cast<std::size_t>(dataset.sources);
    extent_.max_source_level = dataset.max_source_level;
    if (manifest.kind.format == TileFormat::kHeightPng) {
      const int deeper = manifest.kind.side_px == 512 ? 1 : 0;
      extent_.min_mercator_depth = manifest.min_level + deeper;
      extent_.max_mercator_depth = manifest.max_level + deeper;
      extent_.height_tile_bounds = HeightTileBounds(manifest);
      return;
    }
    // Archives of one bake have the same tiles.
    if (extent_.available.empty()) {
      extent_.available = manifest.available;
      extent_.error_steps = manifest.error_steps;
    }
    if (manifest.kind.format == TileFormat::kGlb) {
      if (manifest.kind.texture != proto::TextureFormat::kNone) extent_.texture = manifest.kind.texture;
      return;
    }
    extent_.normals = manifest.kind.extensions.normals;
    extent_.has_water = manifest.kind.extensions.water_mask;
    if (manifest.kind.extensions.metadata) extent_.metadata_availability = dataset.metadata_availability;
  }

  const std::vector<std::shared_ptr<const Archive>> archives_;
  tiler::BakedExtent extent_;
};

}  // namespace

std::shared_ptr<const tiler::BakedTiles> MakeBakedTiles(std::vector<std::shared_ptr<const Archive>> archives) {
  return std::make_shared<const Baked>(std::move(archives));
}

}  // namespace terrace::archive
