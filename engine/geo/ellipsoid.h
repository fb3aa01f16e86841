// The WGS 84 ellipsoid and Earth-centred, Earth-fixed (ECEF, EPSG:4978) coordinates in metres.
#pragma once

#include <cmath>

#include "engine/geo/sine.h"

namespace terrace::geo {

inline constexpr double kSemiMajorAxis = 6378137.0;
inline constexpr double kFlattening = 1.0 / 298.257223563;
inline constexpr double kSemiMinorAxis = 6356752.3142451793;
inline constexpr double kEccentricitySquared = kFlattening * (2 - kFlattening);
// Radii of curvature: the smallest is that of a meridian at the equator, the largest is that at the poles.
inline constexpr double kSmallestRadius = kSemiMinorAxis * kSemiMinorAxis / kSemiMajorAxis;
inline constexpr double kLargestRadius = kSemiMajorAxis * kSemiMajorAxis / kSemiMinorAxis;

constexpr double ToRadians(double degrees) { return degrees * 0.017453292519943295; }
constexpr double ToDegrees(double radians) { return radians * 57.295779513082323; }

struct Vec3 {
  double x = 0, y = 0, z = 0;

  friend Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vec3 operator*(Vec3 a, double s) { return {a.x * s, a.y * s, a.z * s}; }
  friend bool operator==(const Vec3&, const Vec3&) = default;
};

inline double Dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 Cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline double Length(Vec3 a) { return std::sqrt(Dot(a, a)); }
inline Vec3 Normalized(Vec3 a) {  // the zero vector stays zero
  const double length = Length(a);
  return length > 0 ? a * (1 / length) : a;
}

// Unit normal of the ellipsoid ("up") at a geodetic position, degrees. At the poles exactly (0, 0, +-1).
Vec3 SurfaceNormal(SinCos longitude, SinCos latitude);
Vec3 SurfaceNormal(double longitude_deg, double latitude_deg);

// ECEF metres of a geodetic position, degrees and metres above the ellipsoid.
Vec3 ToEcef(SinCos longitude, SinCos latitude, double height_m);
Vec3 ToEcef(double longitude_deg, double latitude_deg, double height_m);
// The same with the parallel's PrimeVerticalRadius, for many positions on it.
inline Vec3 ToEcef(SinCos longitude, SinCos latitude, double prime_vertical_m, double height_m) {
  const double from_axis = (prime_vertical_m + height_m) * latitude.cos;
  return {from_axis * longitude.cos, from_axis * longitude.sin,
          (prime_vertical_m * (1 - kEccentricitySquared) + height_m) * latitude.sin};
}

// Radius of curvature in the prime vertical, metres: the normal's length from the surface to the polar axis.
double PrimeVerticalRadius(SinCos latitude);
double PrimeVerticalRadius(double latitude_deg);

// Metres per degree along the parallel and along the meridian at a latitude.
double MetresPerDegreeEast(SinCos latitude);
double MetresPerDegreeNorth(SinCos latitude);
double MetresPerDegreeEast(double latitude_deg);
double MetresPerDegreeNorth(double latitude_deg);

}  // namespace terrace::geo
