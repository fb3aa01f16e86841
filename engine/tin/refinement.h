// The recorded order of a greedy run. It yields every coarser mesh of the field without reading samples.
//
// Greedy insertion is progressive: the mesh for an error E is the state before the first insertion that was made when
// the largest error was at most E. All meshes of a field are therefore one list of insertions. An insertion is recorded
// with its sample, the error before it, the ring of vertices that the sample was joined to, and, for each triangle it
// made, the later insertion that removed this triangle. The mesh after n insertions consists of the triangles made by
// one of the first n insertions and removed by none of them. Finding them takes no geometry. Indices have 16 bits, so
// that a refinement stays small: a run that exceeds kMaxVertices or kMaxStar has none.
//
// Immutable; safe to read from many threads at once.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/tin/mesh/insertion_record.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

class Refinement {
 public:
  static constexpr std::size_t kMaxVertices = InsertionRecord::kNever - 1;
  static constexpr std::size_t kMaxStar = InsertionRecord::kOpen - 1;  // triangles that one insertion makes

  // `errors_before` and the record have one entry per insertion.
  Refinement(int width, int height, std::vector<SamplePosition> inserted, std::vector<float> errors_before,
             InsertionRecord record);

  int width() const { return width_; }
  int height() const { return height_; }

  std::size_t vertex_count() const { return 4 + inserted_.size(); }

  // The number of vertices of the mesh for this error. Precondition: the recorded run reached this error.
  std::size_t PointsAt(double max_error) const;

  // The mesh of the first `points` vertices, 4 <= points <= vertex_count(). Triangles in the order they were made.
  TinMesh MeshOf(std::size_t points) const;
  TinMesh MeshAt(double max_error) const { return MeshOf(PointsAt(max_error)); }

  // Memory in use.
  std::size_t bytes() const;

  // Little-endian, with a version and a checksum.
  std::string Serialize() const;
  // kInvalidArgument: the bytes are damaged or cannot be a record. An accepted record has valid indices in all of its
  // meshes. It is not checked that these are triangulations: continue a run only from bytes that Serialize has written.
  static Result<Refinement> Parse(std::string_view bytes);

  const std::vector<SamplePosition>& inserted() const { return inserted_; }
  const std::vector<float>& errors_before() const { return errors_before_; }
  const InsertionRecord& record() const { return record_; }

  friend bool operator==(const Refinement&, const Refinement&) = default;

 private:
  Refinement() = default;
  bool IsSound() const;

  int width_ = 0, height_ = 0;
  std::vector<SamplePosition> inserted_;
  std::vector<float> errors_before_;
  InsertionRecord record_;
};

}  // namespace terrace::tin
