#include "engine/geo/sine.h"

#include <array>
#include <cmath>

#include "engine/geo/double_double.h"

namespace terrace::geo {
namespace {

constexpr double kGrid = 17592186044416.0;                                     // 2^44
constexpr DoubleDouble kRadian{0.017453292519943295, 2.9486522708701687e-19};  // pi / 180

// 1 / n!, for the terms of both series.
template <int kTerms>
constexpr std::array<DoubleDouble, kTerms> InverseFactorials() {
  std::array<DoubleDouble, kTerms> inverses;
  inverses[0] = 1;
  for (int n = 1; n < kTerms; ++n) {
    // Long division: the remainder of the quotient of doubles gives the next 53 bits.
    const DoubleDouble before = inverses[static_cast<unsigned>(n - 1)];
    const double quotient = before.high / n;
    const DoubleDouble rest = before + -DoubleDouble::ProductOf(quotient, n);
    inverses[static_cast<unsigned>(n)] = DoubleDouble::OfOrdered(quotient, rest.high / n);
  }
  return inverses;
}

// Up to pi / 4 the first omitted term is below 2^-92.
constexpr int kTerms = 26;
constexpr auto kInverse = InverseFactorials<kTerms>();

// The terms first, first + 2 .. of the series of e^t, with alternating signs, divided by t^first.
template <typename Number>
Number Series(Number square, int first, int terms) {
  const auto coefficient = [](int n) {
    if constexpr (requires { Number(0.0).low; }) {
      return kInverse[static_cast<unsigned>(n)];
    } else {
      return kInverse[static_cast<unsigned>(n)].high;
    }
  };
  int n = first + 2 * ((terms - 1 - first) / 2);
  Number sum = coefficient(n);
  for (n -= 2; n >= first; n -= 2) sum = coefficient(n) + -(square * sum);
  return sum;
}

// Double precision decides, unless the value is nearly halfway between two multiples of the grid.
template <int kFirst>
double Rounded(double degrees) {
  // Terms beyond t^17 are less than 2^-58. All rounding errors together stay below 2^-52, a 256th of the grid.
  constexpr int kShortTerms = 18;
  constexpr double kDoubt = 1.0 / 128;
  const double radians = degrees * kRadian.high;
  const double about = Series(radians * radians, kFirst, kShortTerms) * (kFirst == 1 ? radians : 1) * kGrid;
  const double nearest = std::nearbyint(about);
  if (std::abs(about - nearest) < 0.5 - kDoubt) return nearest / kGrid;
  const DoubleDouble t = kRadian * degrees;
  DoubleDouble exact = Series(t * t, kFirst, kTerms);
  if constexpr (kFirst == 1) exact = exact * t;
  const double whole = std::nearbyint(exact.high * kGrid);
  const double rest = (exact.high * kGrid - whole) + exact.low * kGrid;
  return (whole + (rest > 0.5 ? 1 : rest < -0.5 ? -1 : 0)) / kGrid;
}

}  // namespace

SinCos RoundedSinCos(double degrees) {
  // Exact: a multiple of the last place of `degrees`, and at most slightly above 45.
  const double quarter = std::nearbyint(degrees / 90), angle = degrees - 90 * quarter;
  const double sine = Rounded<1>(angle), cosine = Rounded<0>(angle);
  // Subtracted from 0 to avoid -0.
  switch (static_cast<long>(quarter) & 3) {
    case 0:
      return {0 + sine, cosine};
    case 1:
      return {cosine, 0 - sine};
    case 2:
      return {0 - sine, -cosine};
    default:
      return {-cosine, 0 + sine};
  }
}

}  // namespace terrace::geo
