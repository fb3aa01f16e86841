#include "bake/unit_key.h"

#include <algorithm>

#include "bake/bake_request.h"
#include "engine/common/content_hash.h"
#include "engine/dem/content_below.h"
#include "engine/dem/planned_tiles.h"
#include "engine/dem/tile_edits.h"
#include "engine/geo/mercator_grid.h"
#include "engine/geo/tile_cover.h"

namespace terrace::bake {
namespace {

// Raise it with every change of the layout of the units' files or of this key.
constexpr int kKeyVersion = 2;

void AddRanges(dem::ContentHasher& hasher, const std::vector<geo::TileRange>& ranges) {
  hasher.Add(std::uint64_t{ranges.size()});
  for (const geo::TileRange& range : ranges) {
    for (const std::int64_t edge : {range.start_x, range.start_y, range.end_x, range.end_y}) hasher.Add(edge);
  }
}

void AddKind(dem::ContentHasher& hasher, const tiler::TileRequest& kind) {
  for (const int value :
       {static_cast<int>(kind.format), static_cast<int>(kind.compression), static_cast<int>(kind.texture),
        static_cast<int>(kind.coding), static_cast<int>(kind.height_encoding), kind.side_px}) {
    hasher.Add(value);
  }
  const auto& [normals, water_mask, metadata] = kind.extensions;
  for (const bool value : {normals, water_mask, metadata}) hasher.Add(value);
}

// The options of the dataset that tiles of this kind depend on.
void AddOptions(dem::ContentHasher& hasher, const tiler::Dataset& dataset, const tiler::TileRequest& kind) {
  // All members are named, so that a new one fails to compile until it is considered here.
  const auto& [name, attribution, error_fraction, mesh_options, glb, model, baked, baked_files, water, imagery,
               metadata_availability, generation, unedited_generation] = dataset;
  hasher.Add(error_fraction);
  if (kind.format == tiler::TileFormat::kHeightPng) return;
  hasher.Add(static_cast<int>(mesh_options.criterion));
  hasher.Add(mesh_options.compact);
  if (kind.format == tiler::TileFormat::kGlb) {
    hasher.AddText(glb.generator);
    hasher.AddText(attribution);
    if (kind.compression == proto::GlbCompression::kDraco) {
      hasher.Add(glb.draco.speed);
      hasher.Add(glb.draco.normal_bits);
    }
    if (imagery.image) {
      hasher.Add(imagery.image->fingerprint());
      hasher.Add(imagery.side);
      hasher.Add(imagery.quality);
      hasher.AddText(imagery.attribution);
    }
    return;
  }
  if (kind.extensions.water_mask) {
    hasher.Add(water.mask ? water.mask->fingerprint() : 0);
    hasher.Add(water.sea_level_m.has_value());
    hasher.Add(water.sea_level_m.value_or(0));
  }
  if (kind.extensions.metadata) hasher.Add(metadata_availability);
}

// The sources of height tiles. A geodetic tile of the level above the unit's is as wide as the unit, and is read at
// least as coarsely.
void AddMercatorContent(dem::ContentHasher& hasher, const dem::ElevationModel& model, const geo::TileKey& root) {
  const double tiles = static_cast<double>(std::int64_t{1} << root.level);
  const auto share = [&](std::int64_t edge) { return static_cast<double>(edge) / tiles; };
  // Interpolation may need one more pixel on each side.
  const double slack = 360 / tiles / 256;
  const dem::GeoBounds box{share(root.x) * 360 - 180, std::max(-90.0, geo::MercatorLatitude(share(root.y + 1)) - slack),
                           share(root.x + 1) * 360 - 180, std::min(90.0, geo::MercatorLatitude(share(root.y)) + slack)};
  const int level = root.level - 1;
  for (const geo::TileRange& range : dem::TilesOverlapping(box, level)) {
    for (std::int64_t y = range.start_y; y <= range.end_y; ++y) {
      for (std::int64_t x = range.start_x - 1; x <= range.end_x + 1; ++x) {
        hasher.Add(ContentBelow(model, {level, dem::FloorMod(x, geo::TileColumns(level)), y}, level));
      }
    }
  }
}

}  // namespace

std::uint64_t UnitKey(const tiler::Dataset& dataset, const archive::Manifest& manifest, const Unit& unit) {
  const dem::ElevationModel& model = *dataset.model;
  dem::ContentHasher hasher;
  hasher.Add(kKeyVersion);
  hasher.Add(archive::kFormatVersion);
  hasher.AddText(manifest.product);
  hasher.AddText(manifest.encoder);
  AddKind(hasher, manifest.kind);
  AddOptions(hasher, dataset, manifest.kind);
  // Without the levels that edits added elsewhere.
  int last = static_cast<int>(unit.tiles.size()) - 1;
  while (last > model.max_source_level() && unit.tiles[static_cast<std::size_t>(last)].empty()) --last;
  for (int level = 0; level <= last; ++level) {
    const auto& ranges = unit.tiles[static_cast<std::size_t>(level)];
    AddRanges(hasher, ranges);
    if (!ranges.empty()) hasher.Add(RequestOf(manifest, {level, 0, 0}).error_step);
  }
  if (!unit.root) {
    hasher.Add(model.fingerprint());
  } else if (manifest.kind.format == tiler::TileFormat::kHeightPng) {
    AddMercatorContent(hasher, model, *unit.root);
  } else {
    hasher.Add(ContentBelow(model, *unit.root, last));
    if (manifest.kind.extensions.metadata) {
      // Metadata lists the dataset's tiles below a tile.
      const int deepest = static_cast<int>(dem::TileEdits(model).AvailabilityToDepthOf(*unit.root).size()) - 1;
      for (int level = unit.root->level; level <= deepest; ++level) {
        AddRanges(hasher, geo::RangesBelow(model.Available(level), *unit.root, level));
      }
    }
  }
  return hasher.Hash().low;
}

}  // namespace terrace::bake
