#include "tests/engine/tin/scan_reference.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/tin/mesh/predicates.h"
#include "tests/engine/tin/instruction_sets.h"

namespace terrace::tin {
namespace {

bool IsOnBorder(const HeightField& field, SamplePosition a, SamplePosition b) {
  return (a.x == b.x && (a.x == 0 || a.x + 1 == field.width())) ||
         (a.y == b.y && (a.y == 0 || a.y + 1 == field.height()));
}

}  // namespace

TestStar::TestStar(const HeightField& field, SamplePosition centre, const std::vector<SamplePosition>& ring) {
  star_.x = centre.x;
  star_.y = centre.y;
  star_.height = field.VertexHeight(centre.x, centre.y);
  star_.count = ring.size() - 1;
  star_.ring.Grow(ring.size());
  for (std::size_t i = 0; i < ring.size(); ++i) {
    star_.ring.Put(i, {static_cast<VertexId>(i), ring[i].x - centre.x, ring[i].y - centre.y,
                       field.VertexHeight(ring[i].x, ring[i].y)});
  }
  for (std::size_t i = 0; i < star_.count; ++i) {
    star_.has_border |= IsOnBorder(field, ring[i], ring[i + 1]) || IsOnBorder(field, ring[i], centre) ||
                        IsOnBorder(field, ring[i + 1], centre);
  }
}

PlaneMisfit Reference(const HeightField& field, const Star& star, std::size_t i) {
  const double ux = star.ring.dx[i], uy = star.ring.dy[i], vx = star.ring.dx[i + 1], vy = star.ring.dy[i + 1];
  const double pz = static_cast<double>(star.height);
  const double uz = static_cast<double>(star.ring.heights[i]) - pz;
  const double vz = static_cast<double>(star.ring.heights[i + 1]) - pz;
  const double d = ux * vy - uy * vx, a = vy * uz - uy * vz, b = ux * vz - vx * uz;
  PlaneMisfit worst;
  double most = -1;
  for (int row = 1; row < field.height() - 1; ++row) {
    for (int column = 1; column < field.width() - 1; ++column) {
      const double x = column - star.x, y = row - star.y;
      const double of_u = vy * x - vx * y, of_v = ux * y - uy * x;
      if (of_u < 0 || of_v < 0 || d - of_u - of_v < 0) continue;
      if ((x == 0 && y == 0) || (x == ux && y == uy) || (x == vx && y == vy)) continue;
      const double numerator = std::abs(d * (static_cast<double>(field.At(column, row)) - pz) - (a * x + b * y));
      if (!(numerator > most)) continue;
      most = numerator;
      worst = {numerator / d, SampleNumber(column, row)};
    }
  }
  return worst;
}

SamplePosition RandomSample(Random& random, const HeightField& field) {
  return {static_cast<std::uint16_t>(random.Below(field.width())),
          static_cast<std::uint16_t>(random.Below(field.height()))};
}

void ExpectReference(const HeightField& field, const Star& star) {
  std::vector<PlaneMisfit> expected;
  for (std::size_t i = 0; i < star.count; ++i) expected.push_back(Reference(field, star, i));
  ForEachInstructionSet([&] {
    std::vector<PlaneMisfit> misfits(star.count);
    BestStarScan()(field, star, misfits.data());
    for (std::size_t i = 0; i < star.count; ++i) {
      ASSERT_EQ(misfits[i].distance, expected[i].distance);
      ASSERT_EQ(misfits[i].sample, expected[i].sample);
    }
  });
}

void ExpectReferenceAtRandom(Random& random, const HeightField& field) {
  const SamplePosition p = RandomSample(random, field), u = RandomSample(random, field),
                       v = RandomSample(random, field);
  if (Orientation(p, u, v) <= 0) return;
  ExpectReference(field, *TestStar(field, p, {u, v}));
}

}  // namespace terrace::tin
