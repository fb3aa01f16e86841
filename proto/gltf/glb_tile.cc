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

// 65535 as a 16-bit index means "restart" in glTF.
constexpr std::size_t kMaxNarrowVertices = 65535;

// Bare ground: not metallic, not glossy.
constexpr std::array<double, 4> kGroundColor{0.5, 0.5, 0.5, 1};

// Stored positions are ECEF: times `scale` they are metres from `origin`. Clients turn y-up content by
// (x, y, z) -> (x, -z, y), so the node undoes that first and then moves to the origin.
std::array<double, 16> MatrixAt(Vec3d origin, double scale) {
  return {scale, 0, 0, 0, 0, 0, -scale, 0, 0, scale, 0, 0, origin[0], origin[2], -origin[1], 1};
}

GltfComponent IndexComponent(std::size_t vertices) {
  return vertices > kMaxNarrowVertices ? GltfComponent::kUnsignedInt : GltfComponent::kUnsignedShort;
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

// The arrays of a tile before compression, and how glTF describes them.
struct Arrays {
  std::string positions, normals, uv;
  std::size_t position_stride = 0, normal_stride = 0, uv_stride = 0;
  GltfAccessor position, normal, texture;
  Vec3d origin{};
  double scale = 1;
};

// [-1, 1] to -127..127, as glTF's normalized bytes decode: c / 127.
std::int8_t NormalByte(double component) { return static_cast<std::int8_t>(std::floor(component * 127 + 0.5)); }

// Whole steps above the box's corner, in records of 8 bytes: vertex attributes are aligned to 4.
void PutShortPositions(const GridMesh& mesh, const TileBox& box, Arrays& arrays) {
  ByteWriter out;
  out.Reserve(8 * mesh.positions.size());
  for (const Position& p : mesh.positions) {
    for (std::size_t axis = 0; axis < 3; ++axis) out.Put(static_cast<std::uint16_t>(p[axis] - box.min[axis]));
    out.Put(std::uint16_t{0});
  }
  arrays.positions = out.Take();
  arrays.position_stride = 8;
  arrays.position.component = GltfComponent::kUnsignedShort;
  arrays.scale = mesh.step_m;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    arrays.origin[axis] = static_cast<double>(mesh.origin[axis] + box.min[axis]) * mesh.step_m;
    arrays.position.min.push_back(0);
    arrays.position.max.push_back(box.max[axis] - box.min[axis]);
  }
}

void PutFloatPositions(const GridMesh& mesh, const TileBox& box, Arrays& arrays) {
  ByteWriter out;
  out.Reserve(12 * mesh.positions.size());
  for (const Position& p : mesh.positions) {
    for (const std::int32_t steps : p) out.Put(static_cast<float>(steps * mesh.step_m));
  }
  arrays.positions = out.Take();
  arrays.position_stride = 12;
  arrays.position.component = GltfComponent::kFloat;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    arrays.origin[axis] = static_cast<double>(mesh.origin[axis]) * mesh.step_m;
    arrays.position.min.push_back(box.min[axis] * mesh.step_m);
    arrays.position.max.push_back(box.max[axis] * mesh.step_m);
  }
}

void PutByteNormals(const GridMesh& mesh, Arrays& arrays) {
  ByteWriter out;
  out.Reserve(4 * mesh.normals.size());
  for (const geo::Vec3& n : mesh.normals) {
    for (const double component : {n.x, n.y, n.z}) out.Put(NormalByte(component));
    out.Put(std::int8_t{0});
  }
  arrays.normals = out.Take();
  arrays.normal_stride = 4;
  arrays.normal.component = GltfComponent::kByte;
  arrays.normal.normalized = true;
}

void PutFloatNormals(const GridMesh& mesh, Arrays& arrays) {
  ByteWriter out;
  out.Reserve(12 * mesh.normals.size());
  for (const geo::Vec3& n : mesh.normals) {
    for (const double component : {n.x, n.y, n.z}) out.Put(static_cast<float>(component));
  }
  arrays.normals = out.Take();
  arrays.normal_stride = 12;
}

// Lattice columns and rows to 0 .. 65535: off by less than a 65,536th of the picture's edge.
void PutShortTextureCoordinates(const GridMesh& mesh, Arrays& arrays) {
  ByteWriter out;
  out.Reserve(4 * mesh.uv.size());
  for (const auto& uv : mesh.uv) {
    for (const int node : uv) out.Put(static_cast<std::uint16_t>((2 * 65535 * node + mesh.cells) / (2 * mesh.cells)));
  }
  arrays.uv = out.Take();
  arrays.uv_stride = 4;
  arrays.texture = {.component = GltfComponent::kUnsignedShort, .type = "VEC2", .normalized = true};
}

void PutFloatTextureCoordinates(const GridMesh& mesh, Arrays& arrays) {
  ByteWriter out;
  out.Reserve(8 * mesh.uv.size());
  for (const auto& uv : mesh.uv) {
    for (const int node : uv) out.Put(static_cast<float>(node) / static_cast<float>(mesh.cells));
  }
  arrays.uv = out.Take();
  arrays.uv_stride = 8;
  arrays.texture = {.type = "VEC2"};
}

Arrays MakeArrays(const GridMesh& mesh, bool quantized) {
  const TileBox box = BoxOf(mesh);
  Arrays arrays;
  if (quantized && FitsShort(box)) {
    PutShortPositions(mesh, box, arrays);
  } else {
    PutFloatPositions(mesh, box, arrays);
  }
  if (quantized) {
    PutByteNormals(mesh, arrays);
    PutShortTextureCoordinates(mesh, arrays);
  } else {
    PutFloatNormals(mesh, arrays);
    PutFloatTextureCoordinates(mesh, arrays);
  }
  arrays.position.count = arrays.normal.count = arrays.texture.count = mesh.positions.size();
  return arrays;
}

std::string IndexBytes(const std::vector<std::array<std::uint32_t, 3>>& triangles, std::size_t vertices) {
  ByteWriter out;
  for (const auto& triangle : triangles) {
    for (const std::uint32_t index : triangle) {
      if (vertices > kMaxNarrowVertices) {
        out.Put(index);
      } else {
        out.Put(static_cast<std::uint16_t>(index));
      }
    }
  }
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

std::size_t AddMeshoptView(GltfMesh& gltf, ByteWriter& buffer, std::string_view bytes, std::size_t count,
                           std::size_t stride, GltfTarget target) {
  const std::size_t view = AddView(gltf, buffer, bytes, stride, target);
  gltf.views[view].meshopt = GltfMeshopt{target == GltfTarget::kIndices ? "TRIANGLES" : "ATTRIBUTES", "NONE", count};
  return view;
}

// The last view, so that a texture does not move others.
void AddTexture(const std::optional<GlbTexture>& texture, GltfMesh& gltf, ByteWriter& buffer) {
  if (!texture) return;
  gltf.texture = {AddView(gltf, buffer, texture->bytes, 0, GltfTarget::kNone), texture->media_type};
  if (texture->media_type == "image/webp") gltf.extensions.push_back("EXT_texture_webp");
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
  Vec3d origin{};
  for (std::size_t axis = 0; axis < 3; ++axis) origin[axis] = static_cast<double>(mesh.origin[axis]) * mesh.step_m;
  gltf.matrix = MatrixAt(origin, 1);
  ByteWriter buffer;
  const std::size_t view = AddView(gltf, buffer, draco->bytes, 0, GltfTarget::kNone);
  gltf.draco = GltfDraco{view, {{"POSITION", draco->position_id}, {"NORMAL", draco->normal_id}}};
  GltfAccessor position{.count = draco->points};
  position.min.assign(draco->min.begin(), draco->min.end());
  position.max.assign(draco->max.begin(), draco->max.end());
  gltf.accessors = {position,
                    {.count = draco->points},
                    {.component = IndexComponent(draco->points), .type = "SCALAR", .count = 3 * draco->triangles}};
  gltf.attributes = {{"POSITION", 0}, {"NORMAL", 1}};
  gltf.indices = 2;
  if (options.texture) {
    gltf.draco->attributes.emplace_back("TEXCOORD_0", draco->uv_id);
    gltf.accessors.push_back({.type = "VEC2", .count = draco->points});
    gltf.attributes.emplace_back("TEXCOORD_0", 3);
  }
  AddTexture(options.texture, gltf, buffer);
  return Assemble(std::move(gltf), std::move(buffer));
}

Result<GlbTile> EncodeArrays(const GridMesh& mesh, const GlbOptions& options) {
  const bool quantized = options.compression != GlbCompression::kNone;
  const bool meshopt = options.compression == GlbCompression::kMeshopt;
  Arrays arrays = MakeArrays(mesh, quantized);
  const std::size_t count = mesh.positions.size(), corners = 3 * mesh.triangles.size();
  GltfMesh gltf = Describe(options);
  if (quantized) gltf.extensions.push_back("KHR_mesh_quantization");
  if (meshopt) gltf.extensions.push_back("EXT_meshopt_compression");
  gltf.matrix = MatrixAt(arrays.origin, arrays.scale);
  GltfAccessor index{.component = IndexComponent(count), .type = "SCALAR", .count = corners};
  ByteWriter buffer;
  if (meshopt) {
    arrays.position.view =
        AddMeshoptView(gltf, buffer, EncodeMeshoptVertices(arrays.positions, count, arrays.position_stride), count,
                       arrays.position_stride, GltfTarget::kVertices);
    arrays.normal.view =
        AddMeshoptView(gltf, buffer, EncodeMeshoptVertices(arrays.normals, count, arrays.normal_stride), count,
                       arrays.normal_stride, GltfTarget::kVertices);
    if (options.texture) {
      arrays.texture.view = AddMeshoptView(gltf, buffer, EncodeMeshoptVertices(arrays.uv, count, arrays.uv_stride),
                                           count, arrays.uv_stride, GltfTarget::kVertices);
    }
    const std::size_t width = index.component == GltfComponent::kUnsignedInt ? 4 : 2;
    index.view = AddMeshoptView(gltf, buffer, EncodeMeshoptTriangles(mesh.triangles, count), corners, width,
                                GltfTarget::kIndices);
  } else {
    arrays.position.view = AddView(gltf, buffer, arrays.positions, arrays.position_stride, GltfTarget::kVertices);
    arrays.normal.view = AddView(gltf, buffer, arrays.normals, arrays.normal_stride, GltfTarget::kVertices);
    if (options.texture) {
      arrays.texture.view = AddView(gltf, buffer, arrays.uv, arrays.uv_stride, GltfTarget::kVertices);
    }
    index.view = AddView(gltf, buffer, IndexBytes(mesh.triangles, count), 0, GltfTarget::kIndices);
  }
  gltf.accessors = {std::move(arrays.position), std::move(arrays.normal), std::move(index)};
  gltf.attributes = {{"POSITION", 0}, {"NORMAL", 1}};
  gltf.indices = 2;
  if (options.texture) {
    gltf.accessors.push_back(std::move(arrays.texture));
    gltf.attributes.emplace_back("TEXCOORD_0", 3);
  }
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
