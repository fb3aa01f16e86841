// Polynomials of the second degree, for values along a part of a ray.
#pragma once

namespace terrace::dem {

// A polynomial of the second degree through its values at 0, 0.5 and 1.
class Quadratic {
 public:
  Quadratic() = default;
  Quadratic(double first, double middle, double last)
      : a_(2 * (first + last) - 4 * middle), b_(last - first - a_), c_(first) {}

  double At(double s) const { return (a_ * s + b_) * s + c_; }
  double Slope(double s) const { return 2 * a_ * s + b_; }
  double square_factor() const { return a_; }  // of s^2: half the second derivative

  struct Range {
    double min, max;
  };
  Range Over(double first, double last) const;
  // The same polynomial from `first` to `last`, which become 0 and 1.
  Quadratic Part(double first, double last) const { return {At(first), At((first + last) / 2), At(last)}; }
  // The place between `first` and `last` with this value, clamped: two steps of Newton, for nearly linear ranges.
  double Solve(double value, double first, double last) const;

 private:
  double a_ = 0, b_ = 0, c_ = 0;
};

}  // namespace terrace::dem
