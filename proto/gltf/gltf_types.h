// Enumerations that describe GLB tiles and mesh files.
#pragma once

#include <cstdint>

namespace terrace::proto {

// How the mesh of a GLB tile is stored. Positions are rounded to a grid. kDraco and kNone have one grid, and decode to
// the same positions, bit for bit. So do kQuantized and kMeshopt, whose grid may be coarser. The step of a grid depends
// on level, error, lattice and edits; it is doubled in tiles with extreme cliffs.
enum class GlbCompression : std::uint8_t {
  kDraco,      // KHR_draco_mesh_compression
  kNone,       // 32-bit floats
  kQuantized,  // KHR_mesh_quantization: 16-bit positions and 8-bit normals; float positions where a tile spans 2^16
               // steps of its grid or more
  kMeshopt,    // EXT_meshopt_compression of what kQuantized holds
};

// How the texture of a GLB tile is stored.
enum class TextureFormat : std::uint8_t {
  kNone,  // no texture
  kJpeg,  // baseline, which every glTF client reads
  kWebp,  // lossy; smaller at the same quality number, for readers of EXT_texture_webp
};

// Wavefront OBJ, PLY and binary glTF (mesh_file.h).
enum class MeshFileFormat : std::uint8_t { kObj, kPly, kGlb };

}  // namespace terrace::proto
