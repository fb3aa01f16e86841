// Joins the meshes of a field's blocks (field_partition.h) to one mesh.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/tin/extended/field_partition.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

// Takes the blocks' meshes in the order of the cut. A block's mesh may be freed once it was added. Vertices of the
// result: first the field's corners, as in every TinMesh, then for each block the vertices that no earlier block had,
// in the block's order. Triangles: block by block. Memory: the mesh, and one id per column and row of the field. Not
// thread-safe.
class BlockJoiner {
 public:
  // `cut` must outlive this object.
  explicit BlockJoiner(const FieldPartition& cut);

  // Precondition: `block_mesh` is MeshBlock's mesh of block number added(). All blocks are meshed to the same error.
  void Add(const TinMesh& block_mesh);

  std::size_t added() const { return added_; }

  // Precondition: all blocks were added.
  TinMesh Take() &&;

 private:
  std::uint32_t IdOf(SamplePosition vertex, const FieldBlock& block);

  const FieldPartition* cut_;
  std::size_t added_ = 0;
  TinMesh mesh_;

  // Ids of the vertices that later blocks share. By x: the last row of samples of the row of blocks before; the current
  // row of blocks replaces it from x = 0 on. By y: the last column of samples of the block before.
  std::vector<std::uint32_t> ids_by_x_, ids_by_y_;
  std::vector<std::uint32_t> ids_;  // of the current block
};

}  // namespace terrace::tin
