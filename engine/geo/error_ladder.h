// The geometric errors that tiles of each level are served at.
//
// Clients assume a level error of 77,067.34 m / 2^level for EPSG:4326 terrain (CesiumJS TerrainProvider,
// getEstimatedLevelZeroGeometricErrorForAHeightmap: radius * 2 pi * 0.25 / (65 * 2 roots)). The default error of a
// level is a fraction (0.5) of it. Around each default error lies a ladder of 41 errors, a quarter of an octave apart.
// Requested errors are rounded to it, so a tile has at most 41 variants.
#pragma once

namespace terrace::geo {

inline constexpr int kCoarsestStep = -16;  // 16 times the default error
inline constexpr int kFinestStep = 24;     // a 64th of the default error
inline constexpr double kDefaultErrorFraction = 0.5;

// Metres: the error that clients assume for a tile of this level.
double LevelError(int level);

// Metres: the error of tiles of this level if none is requested.
double DefaultError(int level, double error_fraction = kDefaultErrorFraction);

// Metres: DefaultError * 2^(-step / 4). Precondition: kCoarsestStep <= step <= kFinestStep.
double LadderError(int level, int step, double error_fraction = kDefaultErrorFraction);

// Returns the ladder step with the largest error that is at most `error_m`, clamped to the ladder's ends. Errors within
// one part in 10^9 of a step count as that step, so that a printed ladder error returns the same step. Precondition:
// error_m > 0, finite.
int SnapToLadder(int level, double error_m, double error_fraction = kDefaultErrorFraction);

}  // namespace terrace::geo
