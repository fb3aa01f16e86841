#include "engine/tin/decimate/vertex_rings.h"

#include <algorithm>
#include <utility>

#include "engine/core/check.h"

namespace terrace::tin {
namespace {

constexpr std::size_t kMaxPool = 0xFFFFFFFF;  // limit of Ring::begin

// The side of a triangle across from the vertex whose ring is being made.
struct Link {
  std::uint32_t from, to;
};

// The start of the chain of links: the end of an open chain, the smallest vertex of a closed one.
std::size_t Head(std::span<const Link> links, bool closed) {
  std::size_t head = 0;
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (closed && links[i].from < links[head].from) head = i;
    if (closed || std::any_of(links.begin(), links.end(), [&](const Link& link) { return link.to == links[i].from; }))
      continue;
    return i;
  }
  return head;
}

// Orders the links of one vertex head to tail and returns whether they close.
bool Chain(std::span<Link> links) {
  // Every vertex of a closed chain occurs once as `from` and once as `to`; an open chain has two exceptions.
  std::uint32_t unpaired = 0;
  for (const Link& link : links) unpaired ^= link.from ^ link.to;
  const bool closed = unpaired == 0;
  std::swap(links[0], links[Head(links, closed)]);
  for (std::size_t i = 1; i < links.size(); ++i) {
    const auto next = std::find_if(links.begin() + static_cast<std::ptrdiff_t>(i), links.end(),
                                   [&](const Link& link) { return link.from == links[i - 1].to; });
    TERRACE_CHECK(next != links.end());
    std::swap(links[i], *next);
  }
  return closed;
}

}  // namespace

VertexRings::VertexRings(const TinMesh& mesh) : rings_(mesh.vertices.size()) {
  TERRACE_CHECK(mesh.triangles.size() < kMaxPool / 4);  // three entries each, and one per border vertex
  std::vector<std::uint32_t> ends(mesh.vertices.size() + 1, 0);
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) ++ends[vertex];
  }
  std::uint32_t total = 0;
  for (std::uint32_t& end : ends) end = std::exchange(total, total + end);
  std::vector<Link> links(total);
  for (const auto& [a, b, c] : mesh.triangles) {
    links[ends[a]++] = {b, c};
    links[ends[b]++] = {c, a};
    links[ends[c]++] = {a, b};
  }
  pool_.reserve(total + total / 4);
  std::uint32_t begin = 0;
  for (std::size_t v = 0; v < rings_.size(); ++v) {
    const std::span<Link> own(links.data() + begin, ends[v] - begin);
    begin = ends[v];
    Ring& ring = rings_[v];
    ring.begin = static_cast<std::uint32_t>(pool_.size());
    if (own.empty()) continue;
    ring.closed = Chain(own);
    for (const Link& link : own) pool_.push_back(link.from);
    if (!ring.closed) pool_.push_back(own.back().to);
    ring.size = static_cast<std::uint32_t>(pool_.size()) - ring.begin;
    ring.capacity = ring.size;
  }
}

//          r3                     r3
//        /    \                 /| \ .
//      r4 - v - r2    ->      r4 |  r2     ring[apex] = r0: r1 and r5 lose v, the vertices between them see r0 in its
//      |  /   \  |            | \|/ |      place, and r0 sees those.
//      r5 - r0 - r1           r5-r0-r1
void VertexRings::Remove(std::uint32_t vertex, std::size_t apex) {
  const std::span<const std::uint32_t> ring = Of(vertex);
  TERRACE_CHECK(rings_[vertex].closed);
  const std::uint32_t hub = ring[apex];
  spokes_.assign(ring.begin() + static_cast<std::ptrdiff_t>(apex) + 1, ring.end());
  spokes_.insert(spokes_.end(), ring.begin(), ring.begin() + static_cast<std::ptrdiff_t>(apex));
  rings_[vertex].size = 0;

  const std::span<const std::uint32_t> between = std::span(spokes_).subspan(1, spokes_.size() - 2);
  Replace(spokes_.front(), vertex, {});
  Replace(spokes_.back(), vertex, {});
  for (const std::uint32_t spoke : between) Replace(spoke, vertex, {&hub, 1});
  Replace(hub, vertex, between);
}

void VertexRings::Replace(std::uint32_t vertex, std::uint32_t old, std::span<const std::uint32_t> replacement) {
  Ring& ring = rings_[vertex];
  const auto new_size = static_cast<std::uint32_t>(ring.size - 1 + replacement.size());
  if (new_size > ring.capacity) {
    TERRACE_CHECK(pool_.size() + 2 * std::size_t{new_size} < kMaxPool);
    const auto moved = static_cast<std::uint32_t>(pool_.size());
    pool_.resize(pool_.size() + 2 * std::size_t{new_size});
    std::copy_n(pool_.begin() + ring.begin, ring.size, pool_.begin() + moved);
    ring.begin = moved;
    ring.capacity = 2 * new_size;
  }
  std::uint32_t* const begin = pool_.data() + ring.begin;
  std::uint32_t* const end = begin + ring.size;
  std::uint32_t* const place = std::find(begin, end, old);
  TERRACE_CHECK(place != end);
  if (replacement.size() > 1) {
    std::move_backward(place + 1, end, begin + new_size);
  } else if (replacement.empty()) {
    std::move(place + 1, end, place);
  }
  std::copy(replacement.begin(), replacement.end(), place);
  ring.size = new_size;
}

std::vector<std::array<std::uint32_t, 3>> VertexRings::Triangles() const {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (std::uint32_t v = 0; v < rings_.size(); ++v) {
    const std::span<const std::uint32_t> ring = Of(v);
    const std::size_t sides = rings_[v].closed ? ring.size() : ring.size() - (ring.empty() ? 0 : 1);
    for (std::size_t i = 0; i < sides; ++i) {
      const std::uint32_t b = ring[i], c = ring[i + 1 == ring.size() ? 0 : i + 1];
      if (v < b && v < c) triangles.push_back({v, b, c});
    }
  }
  return triangles;
}

}  // namespace terrace::tin
