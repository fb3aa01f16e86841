#include "engine/geo/mercator_grid.h"

#include <cmath>

#include "engine/geo/ellipsoid.h"

namespace terrace::geo {
namespace {

constexpr double kPi = 3.14159265358979323846;

// e^x for x in 0 .. pi: Taylor's series at x / 32, at most 0.1, squared five times.
double Exp(double x) {
  constexpr int kTerms = 14;  // 0.1^14 / 14! is much less than half a unit in the last place
  const double small = x / 32;
  double sum = 1;
  for (int k = kTerms; k > 0; --k) sum = 1 + sum * small / k;
  for (int i = 0; i < 5; ++i) sum *= sum;
  return sum;
}

// atan of 0 .. 1: half angles twice, then the series at no more than 0.2.
double Atan(double t) {
  const auto half = [](double tangent) { return tangent / (1 + std::sqrt(1 + tangent * tangent)); };
  const double small = half(half(t)), squared = small * small;
  double sum = 0;
  for (int k = 27; k > 0; k -= 2) sum = 1.0 / k - squared * sum;
  return 4 * small * sum;
}

}  // namespace

double MercatorLatitude(double y) {
  // The Gudermannian of x = pi (1 - 2 y): 2 atan(tanh(x / 2)).
  const double angle = kPi * std::abs(1 - 2 * y), power = Exp(angle);
  const double latitude = ToDegrees(2 * Atan((power - 1) / (power + 1)));
  return y > 0.5 ? -latitude : latitude;
}

double MercatorGrid::Longitude(std::int64_t column) const {
  return 360.0 * (static_cast<double>(column) + 0.5) / static_cast<double>(columns()) - 180.0;
}

double MercatorGrid::Latitude(std::int64_t row) const {
  return MercatorLatitude((static_cast<double>(row) + 0.5) / static_cast<double>(rows()));
}

}  // namespace terrace::geo
