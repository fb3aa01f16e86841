#include "proto/gltf/meshopt.h"

#include <meshoptimizer.h>

#include "engine/core/check.h"
#include "proto/mesh/vertex_order.h"

namespace terrace::proto {
namespace {

using Triangle = std::array<std::uint32_t, 3>;
static_assert(sizeof(Triangle) == 3 * sizeof(std::uint32_t));

const std::uint32_t* Indices(const std::vector<Triangle>& triangles) { return triangles.front().data(); }

std::string BytesUpTo(std::size_t bound) { return std::string(bound, '\0'); }

unsigned char* Bytes(std::string& text) { return reinterpret_cast<unsigned char*>(text.data()); }

// The extension requires version 0 of the codec of vertices and 1 of that of indices. They are globals of the library,
// set once before its use; the defaults differ between its releases.
void SetVersions() {
  static const bool are_set = (meshopt_encodeVertexVersion(0), meshopt_encodeIndexVersion(1), true);
  static_cast<void>(are_set);
}

}  // namespace

VertexOrder OrderForMeshopt(const std::vector<Triangle>& triangles, std::size_t vertex_count) {
  TERRACE_CHECK(!triangles.empty());
  std::vector<Triangle> cached(triangles.size());
  meshopt_optimizeVertexCacheStrip(cached.front().data(), Indices(triangles), 3 * triangles.size(), vertex_count);
  VertexOrder order = OrderByFirstUse(cached, vertex_count);
  TERRACE_CHECK(order.old_index.size() == vertex_count);
  return order;
}

std::string EncodeMeshoptVertices(std::string_view records, std::size_t count, std::size_t stride) {
  TERRACE_CHECK(records.size() == count * stride && stride % 4 == 0 && stride > 0 && stride <= 256);
  SetVersions();
  std::string bytes = BytesUpTo(meshopt_encodeVertexBufferBound(count, stride));
  bytes.resize(meshopt_encodeVertexBuffer(Bytes(bytes), bytes.size(), records.data(), count, stride));
  TERRACE_CHECK(!bytes.empty());
  return bytes;
}

std::string EncodeMeshoptTriangles(const std::vector<Triangle>& triangles, std::size_t vertex_count) {
  TERRACE_CHECK(!triangles.empty());
  SetVersions();
  const std::size_t count = 3 * triangles.size();
  std::string bytes = BytesUpTo(meshopt_encodeIndexBufferBound(count, vertex_count));
  bytes.resize(meshopt_encodeIndexBuffer(Bytes(bytes), bytes.size(), Indices(triangles), count));
  TERRACE_CHECK(!bytes.empty());
  return bytes;
}

}  // namespace terrace::proto
