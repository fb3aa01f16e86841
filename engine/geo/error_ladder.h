// Which geometric errors are served at which level.
//
// Clients assume a level error of 77,067.34 m / 2^level for EPSG:4326 terrain (CesiumJS TerrainProvider,
// getEstimatedLevelZeroGeometricErrorForAHeightmap: radius * 2 pi * 0.25 / (65 * 2 roots)). The default error of a
// level is a fraction (0.5) of it. Around each default lies a ladder of 41 errors, a quarter of an octave apart, so
// that any number of requested errors makes at most 41 variants of a tile.
#pragma once

namespace terrace::geo {

inline constexpr int kCoarsestStep = -16;  // 16 times the default error
inline constexpr int kFinestStep = 24;     // a 64th of it
inline constexpr double kDefaultErrorFraction = 0.5;

// Metres: what clients take a tile of this level to be off by.
double LevelError(int level);

// Metres: the error that tiles of this level are built with when nobody asks for another.
double DefaultError(int level, double error_fraction = kDefaultErrorFraction);

// Metres: DefaultError * 2^(-step / 4). Precondition: kCoarsestStep <= step <= kFinestStep.
double LadderError(int level, int step, double error_fraction = kDefaultErrorFraction);

// The ladder step with the largest error that is at most `error_m`, clamped to the ladder's ends. Errors within one
// part in 10^9 of a step count as that step, so that a printed ladder value finds itself. Precondition: error_m > 0,
// finite.
int SnapToLadder(int level, double error_m, double error_fraction = kDefaultErrorFraction);

}  // namespace terrace::geo
