#include "engine/geo/lattice.h"

#include <algorithm>

namespace terrace::geo {

double Lattice::StepDegrees() const { return 180.0 / static_cast<double>(rows()); }

double Lattice::Longitude(std::int64_t column) const {
  const std::int64_t wrapped = (column % columns() + columns()) % columns();
  // A single division of integers below 2^53 on every level: the result is the correctly rounded longitude.
  return 180.0 * static_cast<double>(wrapped) / static_cast<double>(rows()) - 180.0;
}

double Lattice::Latitude(std::int64_t row) const {
  const std::int64_t clamped = std::clamp<std::int64_t>(row, 0, rows());
  return 180.0 * static_cast<double>(clamped) / static_cast<double>(rows()) - 90.0;
}

}  // namespace terrace::geo
