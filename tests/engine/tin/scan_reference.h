// The reference for scans of triangles: the formula of triangle_scan.h, sample by sample.
#pragma once

#include <cstddef>
#include <vector>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/star.h"
#include "engine/tin/scan/triangle_scan.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {

// Stars of one or more triangles, which must be counter-clockwise around their centre.
class TestStar {
 public:
  TestStar(const HeightField& field, SamplePosition centre, const std::vector<SamplePosition>& ring);
  const Star& operator*() const { return star_; }

 private:
  Star star_;
};

// The header's formula, for one triangle of the star.
PlaneMisfit Reference(const HeightField& field, const Star& star, std::size_t i);

SamplePosition RandomSample(Random& random, const HeightField& field);

// Fails if a scan with any instruction set differs in a bit.
void ExpectReference(const HeightField& field, const Star& star);

// One triangle with random corners, skipped if they are not counter-clockwise.
void ExpectReferenceAtRandom(Random& random, const HeightField& field);

}  // namespace terrace::tin
