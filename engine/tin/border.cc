#include "engine/tin/border.h"

#include <cmath>
#include <utility>

#include "engine/tin/chord_scan.h"

namespace terrace::tin {
namespace {

// A border edge, directed along increasing x or y, with its position on that axis.
struct BorderEdge {
  BorderEdge(const HeightField& height_field, Corner low, Corner high) : field(height_field) {
    if (high.x < low.x || high.y < low.y) std::swap(low, high);
    along_x = low.y == high.y;
    across = along_x ? low.y : low.x;
    a = along_x ? low.x : low.y;
    b = along_x ? high.x : high.y;
    h_a = low.z;
    h_b = high.z;
  }

  double HeightAt(int k) const { return static_cast<double>(along_x ? field.At(k, across) : field.At(across, k)); }
  double ChordAt(int k) const { return (h_a * (b - k) + h_b * (k - a)) / (b - a); }
  std::uint32_t SampleAt(int k) const { return along_x ? SampleNumber(k, across) : SampleNumber(across, k); }

  const HeightField& field;
  bool along_x = false;
  int across = 0, a = 0, b = 0;
  double h_a = 0, h_b = 0;
};

}  // namespace

Side SideOf(const HeightField& field, const Corner& a, const Corner& b) {
  if (a.y == b.y) return a.y == 0 ? Side::kSouth : Side::kNorth;
  return a.x == field.width() - 1 ? Side::kEast : Side::kWest;
}

Candidate WorstBorderSample(const HeightField& field, const Corner& a, const Corner& b, const BorderOptions& options) {
  const BorderEdge edge(field, a, b);
  const float* const heights = edge.along_x ? field.Row(edge.across) + edge.a : field.Row(edge.a) + edge.across;
  const int stride = edge.along_x ? 1 : field.stride();
  const ChordMisfit worst = WorstOfChord({edge.a, edge.b, edge.h_a, edge.h_b, heights, stride}, options);
  return worst.error > 0 ? Candidate{worst.error, edge.SampleAt(worst.at)} : Candidate();
}

double SquaredBorderDistances(const HeightField& field, const Corner& a, const Corner& b) {
  const BorderEdge edge(field, a, b);
  double sum = 0;
  for (int k = edge.a + 1; k < edge.b; ++k) {
    const double distance = edge.ChordAt(k) - edge.HeightAt(k);
    if (!std::isnan(distance)) sum += distance * distance;
  }
  return sum;
}

}  // namespace terrace::tin
