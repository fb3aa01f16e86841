// An encoded tile, or the file of an area mesh.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

namespace terrace::tiler {

// Durations of the stages of a build. Zero for a stage that did not run.
struct StageTimes {
  std::chrono::microseconds queue{0};  // until a worker started
  std::chrono::microseconds read{0}, refine{0}, encode{0}, compress{0};
};

// How a build used the cache of refinements.
enum class RefinementUse : std::uint8_t {
  kMade,       // there was none: samples were inserted from the beginning
  kContinued,  // there was one for a larger error: its run was continued
  kReplayed,   // there was one for this error or a smaller one: its mesh was taken from the record of insertions
  kNone,       // not used: formats without a mesh, meshes of areas, tiles that were not built
};

// Header lines of a response that depend only on the tile and its TileRequest. Each ends with CR LF.
struct HeaderLines {
  std::string text;
  // How many bytes at the beginning of `text` describe the body; responses without a body omit them.
  std::size_t bytes_about_body = 0;
};

struct EncodedTile {
  std::string bytes;  // the body in its content coding
  std::string etag;   // strong, with the quotes
  // Metres, the Terrain-Max-Error header: the largest vertical distance between the tile's samples and the mesh that
  // clients decode. Of height PNGs: between the samples and the heights that the colours decode to. Of area meshes: as
  // BuildAreaMesh says. Of other formats: 0.
  double max_error_m = 0;
  // Metres, the Terrain-Certified-Error header: an upper bound of the vertical distance between this mesh and every
  // visible sample of the sources (TileHeights::source_error_m), with the edits that apply to that sample. Only
  // quantized-mesh and GLB tiles have it. Infinite: no bound is known.
  std::optional<double> certified_error_m = {};
  // Of the encoded mesh; in GLB tiles with the skirts. Formats without a mesh: 0.
  std::uint32_t vertices = 0;
  std::uint32_t triangles = 0;
  StageTimes times;  // of the build
  RefinementUse refinement_use = RefinementUse::kNone;
  // The store that it came from when TileTiers put it into memory (StoreBase::name); null: it was built.
  const char* found_in = nullptr;
  HeaderLines header_lines;  // written by the HeaderWriter of TileTiers; empty without one
};

inline std::size_t BytesOf(const EncodedTile& tile) { return tile.bytes.size() + tile.header_lines.text.size(); }

using TilePtr = std::shared_ptr<const EncodedTile>;

}  // namespace terrace::tiler
