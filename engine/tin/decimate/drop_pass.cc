#include "engine/tin/decimate/drop_pass.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "engine/tin/decimate/vertex_rings.h"
#include "engine/tin/mesh/predicates.h"
#include "engine/tin/mesh/removal_polygon.h"
#include "engine/tin/sagitta.h"
#include "engine/tin/scan/triangle_spans.h"

namespace terrace::tin {
namespace {

// Visits between two checks of the stop token: about a quarter of a millisecond.
constexpr std::size_t kPassStopPeriod = 256;

// Samples along a side of a block. Blocks are finished one by one, so that visits stay in the cache. A field of 257 x
// 257 samples is one block, because its last row and column are border. Smaller blocks drop fewer vertices in fields of
// a few straight lines.
constexpr int kPassBlock = 256;

void CheckOptions(const HeightField& field, const DropOptions& options) {
  TERRACE_CHECK(options.max_error >= 0);
  const auto width = static_cast<std::size_t>(field.width()), height = static_cast<std::size_t>(field.height());
  TERRACE_CHECK(options.curvature.east_m2.empty() || options.curvature.east_m2.size() == height);
  if (options.quantized_columns.empty() && options.quantized_rows.empty()) return;
  TERRACE_CHECK(options.quantized_columns.size() == width && options.quantized_rows.size() == height);
}

// Stored together for the cache, because visits jump across the mesh.
struct Vertex {
  SamplePosition position;
  float height = 0;  // HeightField::VertexHeight
};

class DropPass {
 public:
  DropPass(const HeightField& field, const TinMesh& mesh, const DropOptions& options);

  bool Run(const std::stop_token& stop);
  TinMesh Mesh() const;

 private:
  bool IsOnBorder(SamplePosition p) const {
    return p.x == 0 || p.y == 0 || p.x == field_.width() - 1 || p.y == field_.height() - 1;
  }
  bool IsForced(SamplePosition p) const {
    if (options_.limits == nullptr || options_.limits->forced.empty()) return false;
    return options_.limits->forced[static_cast<std::size_t>(p.y) * static_cast<std::size_t>(field_.width()) + p.x] != 0;
  }
  std::vector<std::uint32_t> InOrderOfVisits(std::vector<std::uint32_t> sweep) const;
  bool Drop(std::uint32_t vertex);
  void LoadPolygon(std::uint32_t vertex);
  bool Fits(std::size_t apex) const;
  bool TurnsOnWire(SamplePosition a, SamplePosition b, SamplePosition c) const;

  const HeightField& field_;
  const DropOptions& options_;
  Sagitta sagitta_;
  std::vector<Vertex> vertices_;
  VertexRings rings_;
  RemovalPolygon polygon_;            // of the current vertex
  std::vector<std::uint32_t> next_;   // vertices whose stars changed: the next sweep
  std::vector<std::uint8_t> awaits_;  // by vertex: in this sweep and not yet visited, or in next_
};

DropPass::DropPass(const HeightField& field, const TinMesh& mesh, const DropOptions& options)
    : field_(field),
      options_(options),
      sagitta_(options.curvature, field.height()),
      rings_(mesh),
      awaits_(mesh.vertices.size(), 0) {
  vertices_.reserve(mesh.vertices.size());
  for (const SamplePosition p : mesh.vertices) vertices_.push_back({p, field.VertexHeight(p.x, p.y)});
}

bool DropPass::Run(const std::stop_token& stop) {
  for (std::uint32_t v = 0; v < vertices_.size(); ++v) {
    if (!IsOnBorder(vertices_[v].position)) next_.push_back(v);
  }
  for (const std::uint32_t v : next_) awaits_[v] = 1;
  for (std::size_t visits = 0; !next_.empty();) {
    for (const std::uint32_t v : InOrderOfVisits(std::exchange(next_, {}))) {
      if (visits++ % kPassStopPeriod == 0 && stop.stop_requested()) return false;
      awaits_[v] = 0;
      Drop(v);
    }
  }
  return true;
}

// A counting sort by block that keeps the order within blocks.
std::vector<std::uint32_t> DropPass::InOrderOfVisits(std::vector<std::uint32_t> sweep) const {
  std::sort(sweep.begin(), sweep.end(), std::greater<>());
  const auto block = [&](std::uint32_t v) {
    const SamplePosition p = vertices_[v].position;
    return static_cast<std::size_t>(p.y / kPassBlock) * static_cast<std::size_t>(field_.width() / kPassBlock + 1) +
           static_cast<std::size_t>(p.x / kPassBlock);
  };
  std::vector<std::size_t> places(static_cast<std::size_t>(field_.width() / kPassBlock + 1) *
                                  static_cast<std::size_t>(field_.height() / kPassBlock + 1));
  for (const std::uint32_t v : sweep) ++places[block(v)];
  std::exclusive_scan(places.begin(), places.end(), places.begin(), std::size_t{0});
  std::vector<std::uint32_t> ordered(sweep.size());
  for (const std::uint32_t v : sweep) ordered[places[block(v)]++] = v;
  return ordered;
}

bool DropPass::Drop(std::uint32_t vertex) {
  const std::span<const std::uint32_t> ring = rings_.Of(vertex);
  if (ring.size() > RemovalPolygon::kMaxSides || IsForced(vertices_[vertex].position)) return false;
  LoadPolygon(vertex);
  for (const std::size_t apex : polygon_.Fans(options_.max_error)) {
    if (!Fits(apex)) continue;
    for (const std::uint32_t neighbour : ring) {
      if (awaits_[neighbour] || IsOnBorder(vertices_[neighbour].position)) continue;
      awaits_[neighbour] = 1;
      next_.push_back(neighbour);
    }
    rings_.Remove(vertex, apex);
    return true;
  }
  return false;
}

void DropPass::LoadPolygon(std::uint32_t vertex) {
  const auto [p, height] = vertices_[vertex];
  const bool is_void = field_.has_voids() && std::isnan(field_.At(p.x, p.y));
  polygon_.Begin(p, is_void ? std::numeric_limits<double>::quiet_NaN() : static_cast<double>(height));
  for (const std::uint32_t corner : rings_.Of(vertex)) {
    polygon_.AddCorner(vertices_[corner].position, static_cast<double>(vertices_[corner].height));
  }
}

bool DropPass::Fits(std::size_t apex) const {
  for (std::size_t i = 0; i < polygon_.triangle_count(); ++i) {
    const auto [a, b, c] = polygon_.Triangle(apex, i);
    if (!TurnsOnWire(polygon_.position(a), polygon_.position(b), polygon_.position(c))) return false;
    const std::array<Corner, 3> corners = {polygon_.corner(a), polygon_.corner(b), polygon_.corner(c)};
    const double sagitta = sagitta_.Bound(polygon_.position(a), polygon_.position(b), polygon_.position(c));
    const bool fits = options_.limits != nullptr
                          ? SamplesAreAllowed(field_, corners, sagitta, *options_.limits, options_.max_error)
                          : SamplesAreWithin(field_, corners, options_.max_error - sagitta);
    if (!fits) return false;
  }
  return true;
}

bool DropPass::TurnsOnWire(SamplePosition a, SamplePosition b, SamplePosition c) const {
  if (options_.quantized_columns.empty()) return true;
  const auto quantized = [&](SamplePosition p) {
    return SamplePosition{options_.quantized_columns[p.x], options_.quantized_rows[p.y]};
  };
  return Orientation(quantized(a), quantized(b), quantized(c)) > 0;
}

TinMesh DropPass::Mesh() const {
  TinMesh mesh;
  std::vector<std::uint32_t> renamed(vertices_.size());
  for (std::uint32_t v = 0; v < vertices_.size(); ++v) {
    if (rings_.Of(v).empty()) continue;
    renamed[v] = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.push_back(vertices_[v].position);
  }
  mesh.triangles = rings_.Triangles();
  for (auto& triangle : mesh.triangles) {
    for (std::uint32_t& corner : triangle) corner = renamed[corner];
  }
  return mesh;
}

}  // namespace

std::optional<TinMesh> DropVertices(const HeightField& field, const TinMesh& mesh, const DropOptions& options,
                                    const std::stop_token& stop) {
  CheckOptions(field, options);
  DropPass pass(field, mesh, options);
  if (!pass.Run(stop)) return std::nullopt;
  return pass.Mesh();
}

}  // namespace terrace::tin
