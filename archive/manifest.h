// The manifest of an archive: what was baked from what, and which files hold it. docs/formats/archive.md describes the
// files. An archive without its manifest is an unfinished bake.
//
// An archive has tiles of one kind. A bake of several formats writes an archive for each, in the folders that
// FolderOf names.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/core/names.h"
#include "engine/core/result.h"
#include "engine/geo/tile_key.h"
#include "tiler/tile/tile_request.h"

namespace terrace::archive {

// The version of the files' layout. A reader refuses a higher one.
inline constexpr int kFormatVersion = 1;

// A file of the archive and what it holds.
struct UnitEntry {
  std::string name;         // UnitNameOf: "top", "7-12-34"
  std::uint64_t key = 0;    // hash of everything that the unit's bytes depend on; equal keys: equal files
  std::uint64_t tiles = 0;  // 0: the unit has no file
  std::uint64_t bytes = 0;  // of the file
  std::string xxh3;         // XXH3-128 of the file, 32 hexadecimal digits

  friend bool operator==(const UnitEntry&, const UnitEntry&) = default;
};

// The dataset as its documents describe it, so that an archive can be served without its sources.
struct BakedDataset {
  std::string name;
  std::string attribution;
  std::uint64_t generation = 0;
  double error_fraction = 0.5;
  proto::GlbCompression glb_compression = proto::GlbCompression::kDraco;  // for requests that name none
  dem::GeoBounds bounds;                                                  // of the data
  dem::HeightRange heights;                                               // of the data
  double floor_m = 0;
  bool has_datum = true;
  int metadata_availability = 0;
  int max_level = 0;         // of the dataset, also where the archive ends above it
  int max_source_level = 0;  // without edits (dem::ElevationModel::max_source_level)
  std::uint64_t sources = 1;
};

struct Manifest {
  std::string product;  // "terrace 1.0.0"
  std::string encoder;  // tiler::EncoderText()
  BakedDataset dataset;
  // The request of every tile: format, coding, extensions, compression, texture, encoding. Its dataset, key and
  // error_step are not used. Its extensions.metadata: whether the archive was baked with metadata;
  // proto::CarriesMetadata decides which tiles then have it.
  tiler::TileRequest kind;
  std::vector<int> error_steps;  // by level, 0 .. max_level; empty: 0 at each level
  int min_level = 0, max_level = 0;
  // The tiles in the archive by level, 0 .. max_level, as in proto::LayerDescription; of height tiles in the XYZ
  // scheme. Empty below min_level.
  std::vector<std::vector<geo::TileRange>> available;
  std::string identity;  // JSON object: what the baker was asked for; a later run at the same place compares it
  std::vector<UnitEntry> units;

  int StepAt(int level) const {
    const auto at = static_cast<std::size_t>(level);
    return at < error_steps.size() ? error_steps[at] : 0;
  }
};

// The formats in the order of their folders, and the folders' names.
inline constexpr Names<tiler::TileFormat, 3> kFormatNames = {{{"terrain", tiler::TileFormat::kQuantizedMesh},
                                                              {"glb", tiler::TileFormat::kGlb},
                                                              {"png", tiler::TileFormat::kHeightPng}}};

// The name of a format in kFormatNames.
inline std::string FolderOf(tiler::TileFormat format) { return std::string(NameIn(kFormatNames, format)); }

// Relative to the archive's place.
inline constexpr const char* kManifestFile = "manifest.json";

// A hash of what the archive's tiles are and which there are: of the dataset's generation, the kind, the errors and the
// available tiles. The version in documents of the archive is that of this hash. All forms of a bake have the same.
std::uint64_t TilesHash(const Manifest& manifest);

std::string ToJson(const Manifest& manifest);
// kInvalidArgument: not a manifest, or one of a newer format; the message names what is wrong.
Result<Manifest> ParseManifest(std::string_view json);

// Readers refuse JSON with more values. Ten times as many as the manifest of all land of the Earth at 30 m has.
inline constexpr std::size_t kMaxValues = 2'000'000;

// kInvalidArgument: readers would refuse the manifest of `place`, because it is too large when it has `more_units` more
// units.
Result<void> CheckManifest(const std::string& place, Manifest manifest, std::size_t more_units,
                           std::size_t max_values = kMaxValues);
// Writes manifest.json by rename, so that it is complete or absent. Does not touch a manifest with the same content, so
// that servers do not open the archive anew. Call it last. kUnavailable: the place cannot be written. kInvalidArgument:
// readers would refuse it.
Result<void> WriteManifest(const std::string& place, const Manifest& manifest);
// The manifest in the metadata of an archive in one file. Errors: those of ParseManifest; they name `path`.
Result<Manifest> ManifestOf(const std::string& path, const std::string& metadata);
// kNotFound: there is no manifest: the place holds an unfinished bake, or something else. kInvalidArgument: see
// ParseManifest. Also reads the manifest in an archive in one file (WriteSingle of export.h).
Result<Manifest> ReadManifest(const std::string& place);

}  // namespace terrace::archive
