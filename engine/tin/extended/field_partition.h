// One mesh of a large field from many small ones. The field is cut into blocks that share a row or column of samples.
// Each block is triangulated on its own, and the meshes are joined (block_joiner.h).
//
// A small block fits the processor's second-level cache, and blocks can be meshed on many threads. The edges of blocks
// match vertex by vertex, because the vertices on a border depend on the border's samples alone (greedy.h). The cut
// depends on the field and the error, never on threads, and so does the joined mesh. The mesh keeps the error bound and
// is Delaunay within every block. The cost is vertices along the borders that a run on the whole field would not need.
#pragma once

#include <cstddef>
#include <optional>
#include <stop_token>
#include <vector>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

// A rectangle of samples; its last column and row are the first of the next block.
struct FieldBlock {
  int x = 0, y = 0;           // its first sample in the field
  int width = 0, height = 0;  // samples, two at least

  friend bool operator==(const FieldBlock&, const FieldBlock&) = default;
};

// Where a field is cut. Immutable: safe to read from many threads at once.
class FieldPartition {
 public:
  // Cuts into blocks of about equal size. Their sides differ from block_cells by at most a quarter. A side of the field
  // that is shorter than 1.5 block_cells is not cut. Precondition: sides of 2 to HeightField::kMaxSide, block_cells >=
  // 1.
  FieldPartition(int width, int height, int block_cells);

  // Chooses the smallest blocks, of at least about 257 samples a side, whose shared borders have only a small part of
  // the estimated vertices of a mesh to max_error_m. The whole field is one block if no cut satisfies this, if the mesh
  // will be small, or if heights and mesh fit the processor's cache uncut. Reads only the samples along the cuts.
  static FieldPartition For(const HeightField& field, double max_error_m);

  // Blocks lie row by row, along x first.
  std::size_t size() const { return (columns_.size() - 1) * (rows_.size() - 1); }
  std::size_t blocks_along_x() const { return columns_.size() - 1; }
  FieldBlock block(std::size_t i) const;

  // The field's size in samples.
  int width() const { return columns_.back() + 1; }
  int height() const { return rows_.back() + 1; }

 private:
  std::vector<int> columns_, rows_;  // where blocks begin, and the last sample
};

// The mesh of one block to an error, in the block's own coordinates; nothing if stopped. Void corners have the height
// that HeightField::VertexHeight gives them in the whole field, so that neighbours agree on it. Copies the block's
// samples, unless the block is the field. Uses the criterion, `data_dependent`, and the borders on the sides of the
// field; borders inside the field have their own options. Preconditions: no curvature, seeds or limits. Safe to call
// from many threads at once.
std::optional<TinMesh> MeshBlock(const HeightField& field, const FieldBlock& block, double max_error_m,
                                 GreedyOptions options = {}, std::stop_token stop = {});

}  // namespace terrace::tin
