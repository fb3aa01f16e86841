// Numbers of about 106 bits: unevaluated sums of two doubles (T. J. Dekker, "A floating-point technique for extending
// the available precision", 1971). Uses only additions and multiplications of doubles, which IEEE 754 rounds equally on
// every processor; -ffp-contract=off keeps compilers from fusing them.
#pragma once

namespace terrace::geo {

struct DoubleDouble {
  double high = 0, low = 0;  // |low| is at most half a unit in the last place of `high`

  constexpr DoubleDouble() = default;
  constexpr DoubleDouble(double value) : high(value) {}  // NOLINT(google-explicit-constructor): exact
  constexpr DoubleDouble(double a, double b) : high(a), low(b) {}

  // Precondition: |a| >= |b|, or a is 0.
  static constexpr DoubleDouble OfOrdered(double a, double b) {
    const double sum = a + b;
    return {sum, b - (sum - a)};
  }
  static constexpr DoubleDouble SumOf(double a, double b) {
    const double sum = a + b, part = sum - a;
    return {sum, (a - (sum - part)) + (b - part)};
  }
  // Precondition: the product and its parts neither overflow nor underflow.
  static constexpr DoubleDouble ProductOf(double a, double b) {
    constexpr double kSplit = 134217729;  // 2^27 + 1
    const double wide_a = kSplit * a, wide_b = kSplit * b;
    const double a1 = wide_a - (wide_a - a), a2 = a - a1, b1 = wide_b - (wide_b - b), b2 = b - b1;
    const double product = a * b;
    return {product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2};
  }

  friend constexpr DoubleDouble operator-(DoubleDouble a) { return {-a.high, -a.low}; }
  friend constexpr DoubleDouble operator+(DoubleDouble a, DoubleDouble b) {
    const DoubleDouble high = SumOf(a.high, b.high), low = SumOf(a.low, b.low);
    const DoubleDouble sum = OfOrdered(high.high, high.low + low.high);
    return OfOrdered(sum.high, sum.low + low.low);
  }
  friend constexpr DoubleDouble operator*(DoubleDouble a, DoubleDouble b) {
    const DoubleDouble product = ProductOf(a.high, b.high);
    return OfOrdered(product.high, product.low + (a.high * b.low + a.low * b.high));
  }
};

}  // namespace terrace::geo
