// The recorded order of a greedy run: every coarser mesh of a field without its samples.
//
// Greedy insertion is progressive: the mesh to any error is what stood before the first insertion made at or below it.
// So the whole pyramid of meshes is one list of insertions. For each one it holds the sample, the error before it, the
// ring of vertices that it was joined to, and for each of the triangles made that way the insertion that removed it
// again. The mesh after n insertions is every triangle made by one of the first n and removed by none of them: a
// filter, no geometry.
//
// Immutable; safe to read from many threads at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "engine/core/result.h"
#include "engine/tin/mesh/insertion_record.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

class Refinement {
 public:
  using Record = std::variant<InsertionRecord<std::uint16_t>, InsertionRecord<std::uint32_t>>;

  // Whether the record has indices of 16 bits, half of the memory: it has them wherever they suffice.
  static bool IsNarrow(std::size_t vertices, std::size_t most_triangles_made);

  // `errors_before` and the record have one entry an insertion.
  Refinement(int width, int height, std::vector<SamplePosition> inserted, std::vector<float> errors_before,
             Record record);

  int width() const { return width_; }
  int height() const { return height_; }

  std::size_t vertex_count() const { return 4 + inserted_.size(); }

  // Vertices of the mesh that a run to this error makes. Precondition: the recorded run went at least as far.
  std::size_t PointsAt(double max_error) const;

  // The mesh of the first `points` vertices, 4 <= points <= vertex_count(). Triangles in the order they were made.
  TinMesh MeshOf(std::size_t points) const;
  TinMesh MeshAt(double max_error) const { return MeshOf(PointsAt(max_error)); }

  // Memory taken.
  std::size_t bytes() const;

  // Little-endian, with a version and a checksum.
  std::string Serialize() const;
  // kInvalidArgument for what was damaged or cannot be a record. Whatever is accepted has meshes of vertices it has;
  // that they are triangulations is up to whoever wrote it, so go on only with what Serialize has written.
  static Result<Refinement> Parse(std::string_view bytes);

  const std::vector<SamplePosition>& inserted() const { return inserted_; }
  const std::vector<float>& errors_before() const { return errors_before_; }
  // The record with the widest indices, to go on with.
  InsertionRecord<std::uint32_t> WideRecord() const;

  friend bool operator==(const Refinement&, const Refinement&) = default;

 private:
  Refinement() = default;
  bool IsSound() const;

  int width_ = 0, height_ = 0;
  std::vector<SamplePosition> inserted_;
  std::vector<float> errors_before_;
  Record record_;
};

}  // namespace terrace::tin
