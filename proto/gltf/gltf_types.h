// Enumerations that describe GLB tiles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <string_view>

namespace terrace::proto {

// How the mesh of a GLB tile is stored. Every form decodes to the positions of the GridMesh, bit for bit.
enum class GlbCompression : std::uint8_t {
  kDraco,      // KHR_draco_mesh_compression
  kNone,       // 32-bit floats
  kQuantized,  // KHR_mesh_quantization: 16-bit positions and 8-bit normals; floats where a tile spans 2^16 steps or
               // more
  kMeshopt,    // EXT_meshopt_compression of what kQuantized holds
};

// The form with this name in URLs: draco, none, quantized or meshopt.
inline std::optional<GlbCompression> GlbCompressionNamed(std::string_view name) {
  constexpr std::string_view kNames[] = {"draco", "none", "quantized", "meshopt"};  // by value
  for (std::size_t i = 0; i < std::size(kNames); ++i) {
    if (name == kNames[i]) return static_cast<GlbCompression>(i);
  }
  return std::nullopt;
}

// How the texture of a GLB tile is stored.
enum class TextureFormat : std::uint8_t {
  kNone,  // no texture
  kJpeg,  // baseline, which every glTF client reads
  kWebp,  // lossy; smaller at the same quality number, for readers of EXT_texture_webp
};

}  // namespace terrace::proto
