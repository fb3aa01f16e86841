// The geometry of an edit at nodes: distances, and heights of its target.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/edits/edit.h"

namespace terrace::dem {

// The nearest point of an edit's outline or line.
struct EditPlace {
  double distance_m = 0;   // 0 inside a polygon; beyond the row's reach any number above it
  bool is_inside = false;  // of a polygon
  double depth_m = 0;      // inside a polygon, a lower bound of the distance to its outline, at most the row's margin
  std::uint32_t ring = 0, edge = 0;
  double along = 0;  // 0 .. 1 on the edge
};

// The points of an edit's plane at one y. Edges beyond the reach of this row are excluded once.
class EditRow {
 public:
  // `margin_m`: is added to the reach, for distances of points that the edit does not reach, and for depths.
  EditRow(const Edit& edit, double y, double margin_m = 0);
  EditPlace At(double x) const;
  double y() const { return y_; }
  // The height that the edit aims at, at a point of the row and its At: as stated if the edit is stated in `datum`,
  // else above the ellipsoid. Precondition: flatten, slope, carve or raise.
  double TargetAt(double x, const EditPlace& place, HeightDatum datum = HeightDatum::kEllipsoid) const;
  // The x where the row enters and leaves polygons, alternately; ascending.
  const std::vector<double>& crossings() const { return crossings_; }

 private:
  struct Edge {
    PlanPoint a, b;
    double inverse_length2;
    std::uint32_t ring, edge;
  };
  const Edit& edit_;
  double y_, margin_m_, reach_m_;
  std::vector<double> crossings_;
  std::vector<Edge> edges_;               // within reach of the row
  std::vector<std::uint32_t> triangles_;  // of a slope, that the row meets
};

// EditRow::TargetAt of any point, above the ellipsoid.
double TargetAt(const Edit& edit, PlanPoint point, const EditPlace& place);

// Divides a simple polygon into triangles by cutting off ears. Empty if it is not simple.
std::vector<std::array<std::uint32_t, 3>> CutEars(const std::vector<PlanPoint>& ring);

}  // namespace terrace::dem
