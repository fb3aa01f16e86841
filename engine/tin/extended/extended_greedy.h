// Greedy insertion over an extended height field: triangles that follow heights and colours at once.
//
// Garland and Heckbert (1997), section 3.5, with algorithm III of section 3.3: a triangle has four planes, of z, r, g
// and b, and its candidate is the sample with the largest combined error (extended_field.h). The triangulation is
// Delaunay. All valid samples have this one error, those on the border included: two fields that share a border need
// not choose the same vertices on it. The result depends on the field alone; samples with equal errors are ordered row
// by row.
//
// Not thread-safe; different objects are independent.
#pragma once

#include <cstddef>
#include <limits>
#include <stop_token>
#include <vector>

#include "engine/tin/extended/extended_field.h"
#include "engine/tin/mesh/candidate_queue.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "engine/tin/mesh/triangulation.h"

namespace terrace::tin {

// A run stops as soon as one of these holds.
struct ExtendedGoal {
  double max_error = 0;                                              // combined, metres
  std::size_t max_points = std::numeric_limits<std::size_t>::max();  // vertices, the four corners included
};

struct ColoredMesh {
  TinMesh tin;
  // By vertex: the colour of its sample. If that is not known: the colour of the mesh at this position when the vertex
  // was inserted, rounded to 8 bits; at a corner of the field, the nearest known colour.
  std::vector<Rgb> colors;
};

class ExtendedGreedy {
 public:
  // Starts with the two triangles of the field's corners. `field` must outlive this object.
  explicit ExtendedGreedy(const ExtendedField& field);

  // Inserts samples, worst first, until a goal is met. A later call with a tighter goal continues from there; the mesh
  // is the one that a single call with that goal would have made. Returns false if stopped; the mesh is then valid but
  // unfinished.
  bool Run(const ExtendedGoal& goal, std::stop_token stop = {});

  // The largest combined error of all samples, rounded up to a float.
  double CurrentError();
  std::size_t vertex_count() const { return triangulation_.vertex_count(); }

  // Vertices in order of insertion, with the field's VertexHeight; triangles in the order of their slots.
  ColoredMesh Mesh() const { return {triangulation_.Mesh(), colors_}; }

 private:
  void Insert(TriangleId triangle);
  void Scan(TriangleId triangle);
  Rgb ColorOfVertex(SamplePosition sample, TriangleId triangle) const;

  const ExtendedField* field_;
  Triangulation triangulation_;
  std::vector<Rgb> colors_;    // by vertex
  CandidateQueue candidates_;  // by triangle
};

}  // namespace terrace::tin
