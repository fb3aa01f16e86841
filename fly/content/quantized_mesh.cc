#include "fly/content/quantized_mesh.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/bytes.h"

namespace terrace::fly {
namespace {

constexpr std::size_t kHeaderBytes = 88;
constexpr std::int32_t kMaxQuantized = 32767;
constexpr std::uint32_t kMaxIndexedBy16Bits = 65536;

tl::unexpected<Error> Damaged(std::string_view what) {
  return MakeError(ErrorCode::kInvalidArgument, "quantized-mesh: {}", what);
}

std::int32_t FromZigZag(std::uint16_t value) { return (value >> 1) ^ -(value & 1); }

// Reads u, v or height of all vertices. False if a value leaves 0 to 32767 or the bytes end.
bool ReadCoordinates(ByteReader& reader, std::uint32_t count, std::vector<std::int32_t>& values) {
  const std::string_view bytes = reader.GetBytes(std::size_t{count} * 2);
  if (!reader.ok()) return false;
  ByteReader deltas(bytes);
  values.reserve(count);
  std::int32_t value = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    value += FromZigZag(deltas.Get<std::uint16_t>());
    if (value < 0 || value > kMaxQuantized) return false;
    values.push_back(value);
  }
  return true;
}

class IndexReader {
 public:
  IndexReader(ByteReader& reader, std::uint32_t vertices) : reader_(reader), wide_(vertices > kMaxIndexedBy16Bits) {}
  std::uint32_t Get() { return wide_ ? reader_.Get<std::uint32_t>() : reader_.Get<std::uint16_t>(); }
  std::size_t bytes_each() const { return wide_ ? 4 : 2; }

 private:
  ByteReader& reader_;
  bool wide_;
};

struct Mesh {
  std::vector<std::int32_t> u, v, h;
  std::vector<std::uint32_t> triangles;
};

// High-water-mark coding: a code is subtracted from the next unused index; 0 uses that index.
bool ReadTriangles(ByteReader& reader, Mesh& mesh) {
  const auto vertices = static_cast<std::uint32_t>(mesh.u.size());
  IndexReader indices(reader, vertices);
  const auto count = reader.Get<std::uint32_t>();
  if (!reader.ok() || reader.remaining() / indices.bytes_each() / 3 < count) return false;
  mesh.triangles.reserve(std::size_t{count} * 3);
  std::uint32_t highest = 0;
  for (std::size_t i = 0; i < std::size_t{count} * 3; ++i) {
    const std::uint32_t code = indices.Get();
    if (code > highest || highest - code >= vertices) return false;
    mesh.triangles.push_back(highest - code);
    if (code == 0) ++highest;
  }
  return reader.ok();
}

bool ReadEdges(ByteReader& reader, const Mesh& mesh) {
  const std::array<const std::vector<std::int32_t>*, 4> across = {&mesh.u, &mesh.v, &mesh.u, &mesh.v};  // W S E N
  const std::array<std::int32_t, 4> expected = {0, 0, kMaxQuantized, kMaxQuantized};
  IndexReader indices(reader, static_cast<std::uint32_t>(mesh.u.size()));
  for (std::size_t edge = 0; edge < 4; ++edge) {
    const auto count = reader.Get<std::uint32_t>();
    if (!reader.ok() || reader.remaining() / indices.bytes_each() < count) return false;
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::uint32_t index = indices.Get();
      if (index >= mesh.u.size() || (*across[edge])[index] != expected[edge]) return false;
    }
  }
  return true;
}

bool SkipExtensions(ByteReader& reader, std::size_t vertices) {
  while (reader.ok() && reader.remaining() > 0) {
    const auto id = reader.Get<std::uint8_t>();
    const auto length = reader.Get<std::uint32_t>();
    reader.GetBytes(length);
    if (id == 1 && length != 2 * vertices) return false;  // oct-encoded normals
  }
  return reader.ok();
}

// Twice the area of all triangles in quantized units; exact.
std::int64_t DoubledArea(const Mesh& mesh) {
  std::int64_t sum = 0;
  for (std::size_t i = 0; i + 2 < mesh.triangles.size(); i += 3) {
    const std::uint32_t a = mesh.triangles[i], b = mesh.triangles[i + 1], c = mesh.triangles[i + 2];
    const std::int64_t abu = mesh.u[b] - mesh.u[a], abv = mesh.v[b] - mesh.v[a];
    const std::int64_t acu = mesh.u[c] - mesh.u[a], acv = mesh.v[c] - mesh.v[a];
    sum += std::abs(abu * acv - abv * acu);
  }
  return sum;
}

}  // namespace

Result<TileContent> DecodeQuantizedMesh(std::string_view bytes) {
  if (bytes.size() < kHeaderBytes + 4) return Damaged("shorter than its header");
  ByteReader reader(bytes);
  reader.GetBytes(24);  // centre
  const auto low = reader.Get<float>(), high = reader.Get<float>();
  reader.GetBytes(kHeaderBytes - 32);  // sphere, horizon occlusion point
  if (!std::isfinite(low) || !std::isfinite(high) || low > high) return Damaged("its heights are no range");
  const auto vertices = reader.Get<std::uint32_t>();
  if (reader.remaining() / 6 < vertices) return Damaged("cut off in its vertices");
  Mesh mesh;
  for (std::vector<std::int32_t>* values : {&mesh.u, &mesh.v, &mesh.h}) {
    if (!ReadCoordinates(reader, vertices, *values)) return Damaged("a vertex is outside of 0 to 32767");
  }
  const std::size_t alignment = vertices > kMaxIndexedBy16Bits ? 4 : 2;
  const std::size_t at = bytes.size() - reader.remaining();
  reader.GetBytes((alignment - at % alignment) % alignment);
  if (!ReadTriangles(reader, mesh)) return Damaged("cut off in its triangles, or an index names no vertex");
  if (!ReadEdges(reader, mesh)) return Damaged("cut off in its edges, or a vertex of an edge is not on it");
  if (!SkipExtensions(reader, vertices)) return Damaged("cut off in an extension, or one has the wrong length");

  TileContent content;
  content.vertices = vertices;
  content.triangles = static_cast<std::uint32_t>(mesh.triangles.size() / 3);
  content.bytes = std::uint64_t{vertices} * 24 + mesh.triangles.size() * sizeof(std::uint32_t);
  content.heights = HeightSpan{low, high};
  content.covered = static_cast<double>(DoubledArea(mesh)) / (2.0 * kMaxQuantized * kMaxQuantized);
  return content;
}

}  // namespace terrace::fly
