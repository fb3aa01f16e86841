// glTF 2.0 for a single mesh: the JSON that describes its arrays, and the GLB container.
//
// One buffer, one primitive of triangles, one node that carries the mesh's place in double precision as a matrix. That
// node is scene.nodes[0] and has a `matrix`, not a translation: loaders.gl keeps double precision for no other form.
// Pure functions; thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/bytes.h"

namespace terrace::proto {

// glTF's own numbers.
enum class GltfComponent { kByte = 5120, kUnsignedShort = 5123, kUnsignedInt = 5125, kFloat = 5126 };
enum class GltfTarget { kNone = 0, kVertices = 34962, kIndices = 34963 };

// Indices have 16 bits if there are few enough vertices. 65535 as a 16-bit index means "restart" in glTF.
constexpr GltfComponent IndexComponent(std::size_t vertices) {
  return vertices > 65535 ? GltfComponent::kUnsignedInt : GltfComponent::kUnsignedShort;
}
inline void PutTriangle(ByteWriter& out, const std::array<std::uint32_t, 3>& triangle, GltfComponent component) {
  for (const std::uint32_t index : triangle) {
    if (component == GltfComponent::kUnsignedInt) {
      out.Put(index);
    } else {
      out.Put(static_cast<std::uint16_t>(index));
    }
  }
}

struct GltfMeshopt {
  std::string_view mode;  // "ATTRIBUTES", "TRIANGLES"; without a filter
  std::size_t count = 0;
};

// A part of the buffer. With `meshopt` the bytes in the buffer are compressed (EXT_meshopt_compression), and stride and
// count describe the decoded data.
struct GltfView {
  std::size_t offset = 0, length = 0;
  std::size_t stride = 0;  // 0: not stated, tightly packed
  GltfTarget target = GltfTarget::kNone;
  std::optional<GltfMeshopt> meshopt = {};
};

struct GltfAccessor {
  std::optional<std::size_t> view = {};  // none: the data come from Draco
  GltfComponent component = GltfComponent::kFloat;
  std::string_view type = "VEC3";
  std::size_t count = 0;
  bool normalized = false;
  std::vector<double> min = {}, max = {};  // empty: not stated
};

// KHR_draco_mesh_compression: the view of the Draco bytes, and Draco's unique id of each attribute.
struct GltfDraco {
  std::size_t view = 0;
  std::vector<std::pair<std::string_view, unsigned>> attributes;
};

struct GltfMaterial {
  std::array<double, 4> color{1, 1, 1, 1};  // linear
};

// A picture, clamped at its edges. The material's colour is multiplied by it.
struct GltfTexture {
  std::size_t view = 0;  // of the image file
  std::string_view media_type;
};

struct GltfMesh {
  std::array<double, 16> matrix{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};  // of the node, column by column
  std::string_view generator = "terrace";
  std::vector<std::string_view> extensions;  // used and required
  std::vector<GltfView> views;
  std::vector<GltfAccessor> accessors;
  std::vector<std::pair<std::string_view, std::size_t>> attributes;  // "POSITION" -> accessor
  std::size_t indices = 0;                                           // accessor
  std::optional<GltfDraco> draco;
  std::optional<GltfMaterial> material;  // without one, glTF's default applies, which is a metal
  std::optional<GltfTexture> texture;
  std::string_view copyright;  // empty: none
  std::vector<std::pair<std::string_view, double>> scene_extras;
  std::size_t buffer_bytes = 0;
};

// UTF-8 JSON, not padded.
std::string GltfJson(const GltfMesh& mesh);

// Returns the part of a .glb file before its buffer: header, JSON chunk, header of the binary chunk. Exactly
// `buffer_bytes` bytes must follow. Empty if the file would exceed the format's limit of 4 GiB. Precondition:
// buffer_bytes is a multiple of 4.
std::string GlbHead(std::string json, std::size_t buffer_bytes);

}  // namespace terrace::proto
