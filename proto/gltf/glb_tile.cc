#include "proto/gltf/glb_tile.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "engine/core/bytes.h"
#include "engine/core/check.h"
#include "proto/format_error_up.h"
#include "proto/gltf/draco_mesh.h"
#include "proto/gltf/gltf.h"
#include "proto/gltf/meshopt.h"

namespace terrace::proto {
namespace {

using Vec3d = std::array<double, 3>;
using Position = std::array<std::int32_t, 3>;

// Bare ground: not metallic, not glossy.
constexpr std::array<double, 4> kGroundColor{0.5, 0.5, 0.5, 1};

// Stored positions are ECEF: times `scale` they are metres from `origin`. Clients turn y-up content by
// (x, y, z) -> (x, -z, y), so the node undoes that first and then moves to the origin.
std::array<double, 16> MatrixAt(Vec3d origin, double scale) {
  return {scale, 0, 0, 0, 0, 0, -scale, 0, 0, scale, 0, 0, origin[0], origin[2], -origin[1], 1};
}

Vec3d OriginAt(const GridMesh& mesh, const Position& corner) {
  Vec3d origin{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    origin[axis] = static_cast<double>(mesh.origin[axis] + corner[axis]) * mesh.step_m;
  }
  return origin;
}

struct TileBox {
  Position min{}, max{};
};

TileBox BoxOf(const GridMesh& mesh) {
  TileBox box{mesh.positions.front(), mesh.positions.front()};
  for (const Position& p : mesh.positions) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      box.min[axis] = std::min(box.min[axis], p[axis]);
      box.max[axis] = std::max(box.max[axis], p[axis]);
    }
  }
  return box;
}

bool FitsShort(const TileBox& box) {
  constexpr std::int64_t kMaxShort = std::numeric_limits<std::uint16_t>::max();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (std::int64_t{box.max[axis]} - box.min[axis] > kMaxShort) return false;
  }
  return true;
}

// An array of vertices before compression, and how glTF describes it.
struct Array {
  std::string bytes;
  std::size_t stride = 0;
  GltfAccessor accessor;
};

// `put`: appends a record of `stride` bytes.
template <typename Values, typename Put>
Array MakeArray(const Values& values, std::size_t stride, GltfAccessor accessor, const Put& put) {
  ByteWriter out;
  out.Reserve(stride * values.size());
  for (const auto& value : values) put(out, value);
  accessor.count = values.size();
  return {out.Take(), stride, std::move(accessor)};
}

// Whole steps above the box's corner, in records of 8 bytes: vertex attributes are aligned to 4.
Array ShortPositions(const GridMesh& mesh, const TileBox& box) {
  GltfAccessor accessor{.component = GltfComponent::kUnsignedShort};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    accessor.min.push_back(0);
    accessor.max.push_back(box.max[axis] - box.min[axis]);
  }
  return MakeArray(mesh.positions, 8, std::move(accessor), [&](ByteWriter& out, const Position& p) {
    for (std::size_t axis = 0; axis < 3; ++axis) out.Put(static_cast<std::uint16_t>(p[axis] - box.min[axis]));
    out.Put(std::uint16_t{0});
  });
}

Array FloatPositions(const GridMesh& mesh, const TileBox& box) {
  GltfAccessor accessor;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    accessor.min.push_back(box.min[axis] * mesh.step_m);
    accessor.max.push_back(box.max[axis] * mesh.step_m);
  }
  return MakeArray(mesh.positions, 12, std::move(accessor), [&](ByteWriter& out, const Position& p) {
    for (const std::int32_t steps : p) out.Put(static_cast<float>(steps * mesh.step_m));
  });
}

// [-1, 1] to -127..127, as glTF's normalized bytes decode: c / 127.
std::int8_t NormalByte(double component) { return static_cast<std::int8_t>(std::floor(component * 127 + 0.5)); }

Array Normals(const GridMesh& mesh, bool quantized) {
  if (!quantized) {
    return MakeArray(mesh.normals, 12, {}, [](ByteWriter& out, const geo::Vec3& n) {
      for (const double component : {n.x, n.y, n.z}) out.Put(static_cast<float>(component));
    });
  }
  return MakeArray(mesh.normals, 4, {.component = GltfComponent::kByte, .normalized = true},
                   [](ByteWriter& out, const geo::Vec3& n) {
                     for (const double component : {n.x, n.y, n.z}) out.Put(NormalByte(component));
                     out.Put(std::int8_t{0});
                   });
}

// Quantized: lattice columns and rows to 0 .. 65535: off by less than a 65,536th of the picture's edge.
Array TextureCoordinates(const GridMesh& mesh, bool quantized) {
  const int cells = mesh.cells;
  if (!quantized) {
    return MakeArray(mesh.uv, 8, {.type = "VEC2"}, [cells](ByteWriter& out, const auto& uv) {
      for (const int node : uv) out.Put(static_cast<float>(node) / static_cast<float>(cells));
    });
  }
  return MakeArray(mesh.uv, 4, {.component = GltfComponent::kUnsignedShort, .type = "VEC2", .normalized = true},
                   [cells](ByteWriter& out, const auto& uv) {
                     for (const int node : uv) {
                       out.Put(static_cast<std::uint16_t>((2 * 65535 * node + cells) / (2 * cells)));
                     }
                   });
}

std::string IndexBytes(const std::vector<std::array<std::uint32_t, 3>>& triangles, GltfComponent component) {
  ByteWriter out;
  for (const auto& triangle : triangles) PutTriangle(out, triangle, component);
  return out.Take();
}

GltfMesh Describe(const GlbOptions& options) {
  GltfMesh gltf;
  gltf.generator = options.generator;
  gltf.material.emplace();
  if (!options.texture) gltf.material->color = kGroundColor;
  gltf.copyright = options.copyright;
  const auto add = [&gltf](std::string_view name, const std::optional<double>& error_m) {
    if (!error_m || !std::isfinite(*error_m)) return;
    const std::string text = FormatErrorUp(*error_m);
    double printed = 0;
    std::from_chars(text.data(), text.data() + text.size(), printed);  // strtod depends on the program's locale
    gltf.scene_extras.emplace_back(name, printed);
  };
  add("maxError", options.max_error_m);
  add("certifiedError", options.certified_error_m);
  return gltf;
}

// Appends a view of `bytes`, each at a multiple of 4.
std::size_t AddView(GltfMesh& gltf, ByteWriter& buffer, std::string_view bytes, std::size_t stride, GltfTarget target) {
  buffer.PadTo(4);
  gltf.views.push_back({buffer.size(), bytes.size(), stride, target});
  buffer.PutBytes(bytes);
  return gltf.views.size() - 1;
}

// The last view, so that a texture does not move others.
void AddTexture(const std::optional<GlbTexture>& texture, GltfMesh& gltf, ByteWriter& buffer) {
  if (!texture) return;
  gltf.texture = {AddView(gltf, buffer, texture->bytes, 0, GltfTarget::kNone), texture->media_type};
  if (texture->media_type == "image/webp") gltf.extensions.push_back("EXT_texture_webp");
}

// `vertices`: accessors of positions, normals and, if there are three, texture coordinates. That of the indices is the
// third, with texture coordinates or without.
void SetAccessors(std::vector<GltfAccessor> vertices, GltfAccessor indices, GltfMesh& gltf) {
  vertices.insert(vertices.begin() + 2, std::move(indices));
  gltf.accessors = std::move(vertices);
  gltf.indices = 2;
  gltf.attributes = {{"POSITION", 0}, {"NORMAL", 1}};
  if (gltf.accessors.size() > 3) gltf.attributes.emplace_back("TEXCOORD_0", 3);
}

Result<GlbTile> Assemble(GltfMesh gltf, ByteWriter buffer) {
  buffer.PadTo(4);
  gltf.buffer_bytes = buffer.size();
  GlbTile tile;
  tile.bytes = GlbHead(GltfJson(gltf), gltf.buffer_bytes);
  TERRACE_CHECK(!tile.bytes.empty());  // a tile has at most 2^18 triangles
  tile.bytes += buffer.Take();
  tile.vertices = static_cast<std::uint32_t>(gltf.accessors[0].count);
  tile.triangles = static_cast<std::uint32_t>(gltf.accessors[gltf.indices].count / 3);
  return tile;
}

Result<GlbTile> EncodeWithDraco(const GridMesh& mesh, const GlbOptions& options) {
  DracoOptions draco_options = options.draco;
  draco_options.uv = options.texture.has_value();
  const Result<DracoMesh> draco = EncodeDraco(mesh, draco_options);
  if (!draco) return tl::unexpected(draco.error());
  GltfMesh gltf = Describe(options);
  gltf.extensions = {"KHR_draco_mesh_compression"};
  gltf.matrix = MatrixAt(OriginAt(mesh, {}), 1);
  ByteWriter buffer;
  const std::size_t view = AddView(gltf, buffer, draco->bytes, 0, GltfTarget::kNone);
  gltf.draco = GltfDraco{view, {{"POSITION", draco->position_id}, {"NORMAL", draco->normal_id}}};
  GltfAccessor position{.count = draco->points};
  position.min.assign(draco->min.begin(), draco->min.end());
  position.max.assign(draco->max.begin(), draco->max.end());
  std::vector<GltfAccessor> vertices = {std::move(position), {.count = draco->points}};
  if (options.texture) {
    gltf.draco->attributes.emplace_back("TEXCOORD_0", draco->uv_id);
    vertices.push_back({.type = "VEC2", .count = draco->points});
  }
  SetAccessors(std::move(vertices),
               {.component = IndexComponent(draco->points), .type = "SCALAR", .count = 3 * draco->triangles}, gltf);
  AddTexture(options.texture, gltf, buffer);
  return Assemble(std::move(gltf), std::move(buffer));
}

Result<GlbTile> EncodeArrays(const GridMesh& mesh, const GlbOptions& options) {
  const bool quantized = options.compression != GlbCompression::kNone;
  const bool meshopt = options.compression == GlbCompression::kMeshopt;
  const TileBox box = BoxOf(mesh);
  const bool has_short_positions = quantized && FitsShort(box);
  std::vector<Array> arrays;
  arrays.push_back(has_short_positions ? ShortPositions(mesh, box) : FloatPositions(mesh, box));
  arrays.push_back(Normals(mesh, quantized));
  if (options.texture) arrays.push_back(TextureCoordinates(mesh, quantized));
  GltfMesh gltf = Describe(options);
  if (quantized) gltf.extensions.push_back("KHR_mesh_quantization");
  if (meshopt) gltf.extensions.push_back("EXT_meshopt_compression");
  gltf.matrix = has_short_positions ? MatrixAt(OriginAt(mesh, box.min), mesh.step_m) : MatrixAt(OriginAt(mesh, {}), 1);
  ByteWriter buffer;
  const std::size_t count = mesh.positions.size(), corners = 3 * mesh.triangles.size();
  std::vector<GltfAccessor> vertices;
  for (Array& array : arrays) {
    const std::string bytes =
        meshopt ? EncodeMeshoptVertices(array.bytes, count, array.stride) : std::move(array.bytes);
    array.accessor.view = AddView(gltf, buffer, bytes, array.stride, GltfTarget::kVertices);
    if (meshopt) gltf.views.back().meshopt = {"ATTRIBUTES", count};
    vertices.push_back(std::move(array.accessor));
  }
  GltfAccessor indices{.component = IndexComponent(count), .type = "SCALAR", .count = corners};
  const std::size_t width = indices.component == GltfComponent::kUnsignedInt ? 4 : 2;
  const std::string bytes =
      meshopt ? EncodeMeshoptTriangles(mesh.triangles, count) : IndexBytes(mesh.triangles, indices.component);
  indices.view = AddView(gltf, buffer, bytes, meshopt ? width : 0, GltfTarget::kIndices);
  if (meshopt) gltf.views.back().meshopt = {"TRIANGLES", corners};
  SetAccessors(std::move(vertices), std::move(indices), gltf);
  AddTexture(options.texture, gltf, buffer);
  return Assemble(std::move(gltf), std::move(buffer));
}

GridMesh Reordered(const GridMesh& mesh) {
  VertexOrder order = OrderForMeshopt(mesh.triangles, mesh.positions.size());
  GridMesh reordered{mesh.step_m, mesh.origin, {}, {}, std::move(order.triangles), mesh.cells, {}};
  reordered.positions.reserve(order.old_index.size());
  reordered.normals.reserve(order.old_index.size());
  for (const std::uint32_t old : order.old_index) {
    reordered.positions.push_back(mesh.positions[old]);
    reordered.normals.push_back(mesh.normals[old]);
    if (!mesh.uv.empty()) reordered.uv.push_back(mesh.uv[old]);
  }
  return reordered;
}

}  // namespace

Result<GlbTile> EncodeGlb(const GridMesh& mesh, const GlbOptions& options) {
  TERRACE_CHECK(!mesh.triangles.empty());
  switch (options.compression) {
    case GlbCompression::kDraco:
      return EncodeWithDraco(mesh, options);
    case GlbCompression::kMeshopt:
      return EncodeArrays(Reordered(mesh), options);
    case GlbCompression::kNone:
    case GlbCompression::kQuantized:
      break;
  }
  return EncodeArrays(mesh, options);
}

}  // namespace terrace::proto
