#include "engine/geo/ellipsoid.h"

namespace terrace::geo {
namespace {

double PrimeVerticalRadiusFromSine(double sine) {
  return kSemiMajorAxis / std::sqrt(1 - kEccentricitySquared * sine * sine);
}

}  // namespace

Vec3 SurfaceNormal(double longitude_deg, double latitude_deg) {
  return SurfaceNormal(RoundedSinCos(longitude_deg), RoundedSinCos(latitude_deg));
}

Vec3 SurfaceNormal(SinCos lon, SinCos lat) { return {lat.cos * lon.cos, lat.cos * lon.sin, lat.sin}; }

Vec3 ToEcef(double longitude_deg, double latitude_deg, double height_m) {
  return ToEcef(RoundedSinCos(longitude_deg), RoundedSinCos(latitude_deg), height_m);
}

Vec3 ToEcef(SinCos lon, SinCos lat, double height_m) {
  return ToEcef(lon, lat, PrimeVerticalRadiusFromSine(lat.sin), height_m);
}

double PrimeVerticalRadius(SinCos latitude) { return PrimeVerticalRadiusFromSine(latitude.sin); }

double PrimeVerticalRadius(double latitude_deg) { return PrimeVerticalRadiusFromSine(RoundedSinCos(latitude_deg).sin); }

double MetresPerDegreeEast(double latitude_deg) { return MetresPerDegreeEast(RoundedSinCos(latitude_deg)); }

double MetresPerDegreeEast(SinCos latitude) {
  return ToRadians(1) * PrimeVerticalRadiusFromSine(latitude.sin) * latitude.cos;
}

double MetresPerDegreeNorth(double latitude_deg) { return MetresPerDegreeNorth(RoundedSinCos(latitude_deg)); }

double MetresPerDegreeNorth(SinCos latitude) {
  const double radius = PrimeVerticalRadiusFromSine(latitude.sin);
  // M = N^3 (1 - e^2) / a^2, the meridian's radius of curvature.
  return ToRadians(1) * radius * radius * radius * (1 - kEccentricitySquared) / (kSemiMajorAxis * kSemiMajorAxis);
}

}  // namespace terrace::geo
