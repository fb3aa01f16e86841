#include "proto/gltf/mesh_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "engine/core/bytes.h"
#include "engine/core/check.h"
#include "proto/gltf/gltf.h"

namespace terrace::proto {
namespace {

using Triangle = std::array<std::uint32_t, 3>;

constexpr std::size_t kFlushBytes = 1 << 16;

// Collects small writes: a stream call per number would cost more than formatting it.
class BufferedText {
 public:
  explicit BufferedText(std::ostream& out) : out_(out) {}
  ~BufferedText() { Flush(); }

  template <typename... Args>
  void Append(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(buffer_), format, std::forward<Args>(args)...);
    if (buffer_.size() >= kFlushBytes) Flush();
  }

 private:
  void Flush() {
    out_.write(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
    buffer_.clear();
  }

  std::ostream& out_;
  fmt::memory_buffer buffer_;
};

// Checks the stop token after this many vertices or triangles: about a tenth of a millisecond.
class StopPoll {
 public:
  explicit StopPoll(const std::stop_token& stop) : stop_(stop) {}

  bool IsStopped() { return ++count_ % kPeriod == 0 && stop_.stop_requested(); }

 private:
  static constexpr std::size_t kPeriod = 1024;

  const std::stop_token& stop_;
  std::size_t count_ = 0;
};

void Write(std::ostream& out, const std::string& bytes) {
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

void WriteObj(std::ostream& out, const std::vector<MeshVertex>& vertices, const std::vector<Triangle>& triangles,
              const std::vector<Rgb>& colors, StopPoll poll) {
  BufferedText text(out);
  text.Append("# terrace: {} vertices, {} triangles\n", vertices.size(), triangles.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    if (poll.IsStopped()) return;
    const MeshVertex& v = vertices[i];
    text.Append("v {} {} {}", v.x, v.y, v.z);
    if (!colors.empty()) {
      for (const std::uint8_t level : colors[i]) text.Append(" {:.4g}", level / 255.0);
    }
    text.Append("\n");
  }
  for (const Triangle& t : triangles) {  // OBJ counts from 1
    if (poll.IsStopped()) return;
    text.Append("f {} {} {}\n", t[0] + std::uint64_t{1}, t[1] + std::uint64_t{1}, t[2] + std::uint64_t{1});
  }
}

void WritePly(std::ostream& out, const std::vector<MeshVertex>& vertices, const std::vector<Triangle>& triangles,
              const std::vector<Rgb>& colors, StopPoll poll) {
  const std::string_view color_properties =
      colors.empty() ? "" : "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  Write(out, fmt::format("ply\nformat binary_little_endian 1.0\ncomment terrace\nelement vertex {}\nproperty double x\n"
                         "property double y\nproperty double z\n{}element face {}\n"
                         "property list uchar int vertex_indices\nend_header\n",
                         vertices.size(), color_properties, triangles.size()));
  ByteWriter block;
  const auto flush = [&](bool always) {
    if (always || block.size() >= kFlushBytes) Write(out, block.Take());
  };
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    if (poll.IsStopped()) return;
    const MeshVertex& v = vertices[i];
    block.Put(v.x);
    block.Put(v.y);
    block.Put(v.z);
    if (!colors.empty()) {
      for (const std::uint8_t level : colors[i]) block.Put(level);
    }
    flush(false);
  }
  for (const Triangle& t : triangles) {
    if (poll.IsStopped()) return;
    block.Put(std::uint8_t{3});
    for (std::uint32_t index : t) block.Put(static_cast<std::int32_t>(index));
    flush(false);
  }
  flush(true);
}

using Vec3f = std::array<float, 3>;
using Vec3d = std::array<double, 3>;

Vec3d YUp(const MeshVertex& v) { return {v.x, v.z, 0 - v.y}; }

struct Box {
  Vec3d min, max;
};

Box BoundsOf(const std::vector<MeshVertex>& vertices) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Box box{{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};
  for (const MeshVertex& vertex : vertices) {
    const Vec3d p = YUp(vertex);
    for (std::size_t i = 0; i < 3; ++i) {
      box.min[i] = std::min(box.min[i], p[i]);
      box.max[i] = std::max(box.max[i], p[i]);
    }
  }
  return box;
}

using NodeMatrix = std::array<double, 16>;  // column by column

// The rows of a north-up raster run south: they are stored from the north-west corner on, so that the matrix does not
// mirror.
double RowSign(const GridPlacement& t) { return t[1] * t[5] - t[2] * t[4] < 0 ? -1 : 1; }

NodeMatrix MatrixOf(const GridPlacement& t) {
  const double sign = RowSign(t);
  return {t[1], 0, -t[4], 0, 0, 1, 0, 0, -sign * t[2], 0, sign * t[5], 0, t[0], 0, -t[3], 1};
}

// glTF requires matrices that consist of a translation, a rotation and a scale.
bool IsNodeMatrix(const GridPlacement& t) {
  const double column = std::hypot(t[1], t[4]), row = std::hypot(t[2], t[5]);
  return column > 0 && row > 0 && std::isfinite(t[0] + t[3]) &&
         std::abs(t[1] * t[2] + t[4] * t[5]) <= 1e-12 * column * row;
}

void Place(const GridPlacement& t, std::vector<MeshVertex>& vertices) {
  for (MeshVertex& v : vertices) v = {t[0] + v.x * t[1] + v.y * t[2], t[3] + v.x * t[4] + v.y * t[5], v.z};
}

// Colours are aligned to 4 bytes, as glTF requires of vertex attributes.
constexpr std::size_t kGlbColorBytes = 4 * sizeof(std::uint16_t);

// Accessors over one buffer: positions, indices, and colours if there are any.
struct GlbLayout {
  std::size_t vertices, indices;
  bool has_colors;
  NodeMatrix matrix;
  Vec3d center;  // of what is stored
  Vec3f min, max;

  GltfComponent index() const { return IndexComponent(vertices); }
  std::size_t position_bytes() const { return vertices * sizeof(Vec3f); }
  std::size_t index_bytes() const { return indices * (index() == GltfComponent::kUnsignedInt ? 4 : 2); }
  std::size_t color_offset() const { return (position_bytes() + index_bytes() + 3) / 4 * 4; }
  std::size_t color_bytes() const { return has_colors ? vertices * kGlbColorBytes : 0; }
  std::size_t buffer_bytes() const { return color_offset() + color_bytes(); }
};

// `matrix`: of the grid that the vertices lie on; nothing: vertices are stored relative to their centre.
GlbLayout MakeGlbLayout(const std::vector<MeshVertex>& vertices, std::size_t indices, bool has_colors,
                        const std::optional<NodeMatrix>& matrix) {
  const Box box = BoundsOf(vertices);
  GlbLayout layout{vertices.size(), indices, has_colors, matrix.value_or(GltfMesh{}.matrix), {}, {}, {}};
  for (std::size_t i = 0; i < 3; ++i) {
    if (!matrix) layout.matrix[12 + i] = layout.center[i] = box.min[i] + (box.max[i] - box.min[i]) / 2;
    // Subtraction and rounding to float are monotonic, so the extremes of the doubles map to those of the floats.
    layout.min[i] = static_cast<float>(box.min[i] - layout.center[i]);
    layout.max[i] = static_cast<float>(box.max[i] - layout.center[i]);
  }
  return layout;
}

GltfMesh GltfOf(const GlbLayout& layout) {
  GltfMesh mesh;
  mesh.matrix = layout.matrix;
  mesh.views = {{0, layout.position_bytes(), 0, GltfTarget::kVertices},
                {layout.position_bytes(), layout.index_bytes(), 0, GltfTarget::kIndices}};
  GltfAccessor positions{.view = 0, .count = layout.vertices};
  positions.min.assign(layout.min.begin(), layout.min.end());
  positions.max.assign(layout.max.begin(), layout.max.end());
  mesh.accessors = {positions, {.view = 1, .component = layout.index(), .type = "SCALAR", .count = layout.indices}};
  mesh.attributes = {{"POSITION", 0}};
  mesh.indices = 1;
  mesh.material.emplace();
  if (layout.has_colors) {
    mesh.attributes.emplace_back("COLOR_0", mesh.accessors.size());
    mesh.accessors.push_back({.view = mesh.views.size(),
                              .component = GltfComponent::kUnsignedShort,
                              .count = layout.vertices,
                              .normalized = true});
    mesh.views.push_back({layout.color_offset(), layout.color_bytes(), kGlbColorBytes, GltfTarget::kVertices});
  }
  mesh.buffer_bytes = layout.buffer_bytes();
  return mesh;
}

// IEC 61966-2-1, to 16 bits. No entry is closer than 2^-10 to the middle between two integers, so the table does not
// depend on the last bit of pow.
std::array<std::uint16_t, 256> LinearLevels() {
  std::array<std::uint16_t, 256> levels{};
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const double share = static_cast<double>(i) / 255;
    const double linear = share <= 0.04045 ? share / 12.92 : std::pow((share + 0.055) / 1.055, 2.4);
    levels[i] = static_cast<std::uint16_t>(linear * 65535 + 0.5);
  }
  return levels;
}

// Returns an empty text if a stop was requested.
std::string GlbBuffer(const GlbLayout& layout, const std::vector<MeshVertex>& vertices,
                      const std::vector<Triangle>& triangles, const std::vector<Rgb>& colors, StopPoll poll) {
  ByteWriter buffer;
  buffer.Reserve(layout.buffer_bytes());
  for (const MeshVertex& vertex : vertices) {
    if (poll.IsStopped()) return {};
    const Vec3d p = YUp(vertex);
    for (std::size_t i = 0; i < 3; ++i) buffer.Put(static_cast<float>(p[i] - layout.center[i]));
  }
  for (const Triangle& triangle : triangles) {
    if (poll.IsStopped()) return {};
    PutTriangle(buffer, triangle, layout.index());
  }
  buffer.PadTo(4);
  const std::array<std::uint16_t, 256> linear = LinearLevels();
  for (const Rgb& color : colors) {
    for (const std::uint8_t level : color) buffer.Put(linear[level]);
    buffer.Put(std::uint16_t{0});
  }
  return buffer.Take();
}

Result<void> WriteGlb(std::ostream& out, const std::vector<MeshVertex>& vertices,
                      const std::vector<Triangle>& triangles, const std::vector<Rgb>& colors,
                      const std::optional<NodeMatrix>& matrix, StopPoll poll) {
  const GlbLayout layout = MakeGlbLayout(vertices, 3 * triangles.size(), !colors.empty(), matrix);
  const std::string head = GlbHead(GltfJson(GltfOf(layout)), layout.buffer_bytes());
  if (head.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "a .glb file holds 4 GiB and this mesh needs more than {} bytes; write .ply",
                     layout.buffer_bytes());
  }
  const std::string buffer = GlbBuffer(layout, vertices, triangles, colors, poll);
  if (buffer.empty()) return {};
  Write(out, head);
  Write(out, buffer);
  return {};
}

Result<void> CheckMesh(const std::vector<MeshVertex>& vertices, const std::vector<Triangle>& triangles) {
  if (triangles.empty()) return MakeError(ErrorCode::kInvalidArgument, "the mesh has no triangles; nothing to write");
  if (vertices.size() > std::numeric_limits<std::int32_t>::max()) {
    return MakeError(ErrorCode::kInvalidArgument, "{} vertices are more than mesh files can number; raise the error",
                     vertices.size());
  }
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const MeshVertex& v = vertices[i];
    if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z)) {
      return MakeError(ErrorCode::kInvalidArgument, "vertex {} is ({}, {}, {}); mesh files hold finite numbers only", i,
                       v.x, v.y, v.z);
    }
  }
  for (const Triangle& triangle : triangles) {
    for (std::uint32_t index : triangle) TERRACE_CHECK(index < vertices.size());
  }
  return {};
}

}  // namespace

Result<MeshFileFormat> MeshFileFormatOf(std::string_view file_name) {
  constexpr std::array<std::pair<std::string_view, MeshFileFormat>, 3> kFormats = {
      {{".obj", MeshFileFormat::kObj}, {".ply", MeshFileFormat::kPly}, {".glb", MeshFileFormat::kGlb}}};
  std::string lower(file_name);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  for (const auto& [extension, format] : kFormats) {
    if (lower.ends_with(extension)) return format;
  }
  return MakeError(ErrorCode::kInvalidArgument, "{}: no mesh format has this extension; use .obj, .ply or .glb",
                   file_name);
}

Result<void> WriteMesh(std::ostream& out, MeshFileFormat format, std::vector<MeshVertex> vertices,
                       const std::vector<std::array<std::uint32_t, 3>>& triangles, const std::vector<Rgb>& colors,
                       const std::optional<GridPlacement>& placement, const std::stop_token& stop) {
  TERRACE_CHECK(colors.empty() || colors.size() == vertices.size());
  std::optional<NodeMatrix> matrix;
  if (placement && format == MeshFileFormat::kGlb && IsNodeMatrix(*placement)) {
    matrix = MatrixOf(*placement);
    for (MeshVertex& v : vertices) v.y *= RowSign(*placement);
  } else if (placement) {
    Place(*placement, vertices);
  }
  if (Result<void> checked = CheckMesh(vertices, triangles); !checked) return checked;
  Result<void> written;
  switch (format) {
    case MeshFileFormat::kObj:
      WriteObj(out, vertices, triangles, colors, StopPoll(stop));
      break;
    case MeshFileFormat::kPly:
      WritePly(out, vertices, triangles, colors, StopPoll(stop));
      break;
    case MeshFileFormat::kGlb:
      written = WriteGlb(out, vertices, triangles, colors, matrix, StopPoll(stop));
      break;
  }
  out.flush();
  if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the mesh any more");
  if (written && !out) return MakeError(ErrorCode::kUnavailable, "writing the mesh failed; is the disk full?");
  return written;
}

}  // namespace terrace::proto
