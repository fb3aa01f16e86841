#include "engine/tin/extended/block_joiner.h"

#include <algorithm>
#include <utility>

#include "engine/core/check.h"

namespace terrace::tin {

BlockJoiner::BlockJoiner(const FieldPartition& cut)
    : cut_(&cut), ids_by_x_(static_cast<std::size_t>(cut.width())), ids_by_y_(static_cast<std::size_t>(cut.height())) {
  const auto last_x = static_cast<std::uint16_t>(cut.width() - 1);
  const auto last_y = static_cast<std::uint16_t>(cut.height() - 1);
  mesh_.vertices = {{0, 0}, {last_x, 0}, {last_x, last_y}, {0, last_y}};
}

void BlockJoiner::Add(const TinMesh& block_mesh) {
  TERRACE_CHECK(added_ < cut_->size());
  const FieldBlock block = cut_->block(added_++);
  ids_.clear();
  for (const SamplePosition vertex : block_mesh.vertices) ids_.push_back(IdOf(vertex, block));
  for (const auto& [a, b, c] : block_mesh.triangles) mesh_.triangles.push_back({ids_[a], ids_[b], ids_[c]});

  // Written only when all ids of the block are known, because these entries held the ids of its near borders.
  for (std::size_t i = 0; i < ids_.size(); ++i) {
    const SamplePosition vertex = block_mesh.vertices[i];
    if (vertex.y == block.height - 1) ids_by_x_[static_cast<std::size_t>(block.x) + vertex.x] = ids_[i];
    if (vertex.x == block.width - 1) ids_by_y_[static_cast<std::size_t>(block.y) + vertex.y] = ids_[i];
  }
}

std::uint32_t BlockJoiner::IdOf(SamplePosition vertex, const FieldBlock& block) {
  const SamplePosition position{static_cast<std::uint16_t>(block.x + vertex.x),
                                static_cast<std::uint16_t>(block.y + vertex.y)};
  // The corner of four blocks is in both arrays; the entry by x has been replaced already.
  const bool is_shared_by_y = vertex.x == 0 && block.x > 0, is_shared_by_x = vertex.y == 0 && block.y > 0;
  if (is_shared_by_y || is_shared_by_x) {
    const std::uint32_t id = is_shared_by_y ? ids_by_y_[position.y] : ids_by_x_[position.x];
    TERRACE_CHECK(mesh_.vertices[id] == position);
    return id;
  }
  const auto corners_end = mesh_.vertices.begin() + 4;
  if (const auto corner = std::find(mesh_.vertices.begin(), corners_end, position); corner != corners_end) {
    return static_cast<std::uint32_t>(corner - mesh_.vertices.begin());
  }
  mesh_.vertices.push_back(position);
  return static_cast<std::uint32_t>(mesh_.vertices.size() - 1);
}

TinMesh BlockJoiner::Take() && {
  TERRACE_CHECK(added_ == cut_->size());
  return std::move(mesh_);
}

}  // namespace terrace::tin
