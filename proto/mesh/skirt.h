// The depth of the skirts of a GLB tile, which hide gaps between tiles of different levels.
#pragma once

namespace terrace::proto {

// Metres along the ellipsoid's normal: the sum of the tile's error, its parent's error for the same request, and the
// sagitta of the edge's chords on the curved ground. It depends on level and error alone, so that both sides of an edge
// agree. A tileset's root region must reach this far below the lowest height.
//
// The parent's error is taken as twice the tile's. That is exact for requests by `fraction`. For requests by `error` it
// is an upper bound at every level, also where the ladder clamps (engine/geo/error_ladder.h). `error_m`: SkirtError of
// the request.
double SkirtDepth(int level, double error_m);

// The error that a tile's skirts are made for, in metres: the ladder error of its step. On the deepest level of the
// sources and below, it is at least the default error, because with `error=E&atleast=1` a tile of the sources' deepest
// level has the error E, while its parent has the default error.
double SkirtError(int level, int step, bool is_deepest, double error_fraction);

}  // namespace terrace::proto
