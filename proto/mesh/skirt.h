// How deep the skirts of a GLB tile hang, so that no gap shows where tiles of different levels meet.
#pragma once

namespace terrace::proto {

// Metres along the ellipsoid's normal: the tile's error, that of its parent at the same request, and what the edge's
// chords cut off the curved ground. A function of level and error alone, so that both sides of an edge agree, and what
// a tileset's root region must reach below the lowest height.
//
// The parent's error is taken as twice the tile's: at one `fraction` it is that, and at one `error` it is at most that,
// whichever end of the ladder clamps (engine/geo/error_ladder.h). `error_m` is SkirtError of the request.
double SkirtDepth(int level, double error_m);

// Metres: the error that a tile's skirts are made for, the ladder error of its step. At a dataset's deepest level it is
// at least the default error: `error=E&atleast=1` gives E there and the parent its default.
double SkirtError(int level, int step, bool is_deepest, double error_fraction);

}  // namespace terrace::proto
