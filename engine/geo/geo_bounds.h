// A box of longitudes and latitudes.
#pragma once

namespace terrace::geo {

// Degrees. west > east: the box crosses the antimeridian.
struct GeoBounds {
  double west = -180, south = -90, east = 180, north = 90;
};

}  // namespace terrace::geo
