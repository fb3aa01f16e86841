// A parsed request for heights, at points or along a path. Pure.
#pragma once

#include <cstddef>
#include <optional>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "server/query/points_input.h"
#include "tiler/surface/drawn_surface.h"

namespace terrace::server {

struct HeightsQuery {
  std::vector<dem::GeoPosition> points;
  std::vector<double> distances_m;  // along a path: one per point, from its beginning; else empty
  dem::HeightDatum datum = dem::HeightDatum::kEllipsoid;
  // If certified errors are requested: the deepest level of the tiles to use; geo::kMaxLevel: the deepest available.
  std::optional<int> certify_level;
  bool is_binary = false;  // the points were numbers of 64 bits, and the heights are to be numbers of 32 bits
  bool wants_normals = false;
  std::optional<tiler::DrawnSurface> drawn;  // nothing: heights of the sources
};

// `locations=lat,lon|lat,lon`, or `path=lat,lon|lat,lon` with either `step=METRES` or `samples=N`. Optional:
// `datum=ellipsoid|orthometric`, `certify=LEVEL|deepest`, `normals=1`, `surface=source|served`. With `surface=served`
// also `level`, `error`, `fraction`, `atleast`, `format` and `compression`, as for tiles. `v` is ignored. Each may
// occur once in query and body together. kInvalidArgument: anything else, numbers that are not finite or not a position
// on Earth, or more than `max_locations` points; the message is for the client, and names the item and the byte of the
// body where parsing ended. kCancelled: a stop was requested; it is checked every kPartBytes of the text.
Result<HeightsQuery> ParseHeights(const PointsInput& input, std::size_t max_locations,
                                  const std::stop_token& stop = {});

}  // namespace terrace::server
