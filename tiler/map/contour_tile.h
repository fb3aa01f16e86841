// Contour lines of a map tile, in the units of vector tiles.
#pragma once

#include <cstdint>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "proto/documents/vector_tile.h"
#include "tiler/map/map_heights.h"

namespace terrace::tiler {

// Centimetres: the default interval of a level's tiles, and the smallest that may be requested.
std::uint32_t DefaultIntervalCm(int level);
std::uint32_t MinIntervalCm(int level);
inline constexpr std::uint32_t kMaxIntervalCm = 1'000'000;

// Every fifth line is an index line.
inline constexpr int kIndexEvery = 5;

// Pixels around a tile: the margin of heights that ContoursOf needs, and how far its lines extend.
inline constexpr int kContourMargin = 3;
inline constexpr int kContourBuffer = 2;

// The lines of a tile of 256 pixels and of kContourBuffer pixels around it. Pieces between two neighbouring pixels are
// whole, never cut, and depend on these pixels alone: neighbouring tiles have the same pieces at their common edge.
// Away from edges, lines are simplified by up to an eighth of a pixel. The interval is multiplied by kIndexEvery until
// there are at most dem::kMaxContourCrossings points; the lines still match those of neighbouring tiles. kCancelled:
// stopped. Preconditions: a margin of kContourMargin, an interval above 0.
Result<std::vector<proto::ContourFeature>> ContoursOf(const MapHeights& heights, std::uint32_t interval_cm,
                                                      const std::stop_token& stop);

}  // namespace terrace::tiler
