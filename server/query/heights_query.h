// A parsed request for heights, at points or along a path. Pure.
#pragma once

#include <cstddef>
#include <optional>
#include <stop_token>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/dem_source.h"

namespace terrace::server {

struct HeightsQuery {
  std::vector<dem::GeoPosition> points;
  std::vector<double> distances_m;  // along a path: one per point, from its beginning; else empty
  dem::HeightDatum datum = dem::HeightDatum::kEllipsoid;
  // If certified errors are requested: the deepest level of the tiles to use; geo::kMaxLevel: the deepest available.
  std::optional<int> certify_level;
};

// The parts of a request that contain parameters.
struct HeightsInput {
  std::string_view query;         // of the URL
  std::string_view content_type;  // of the body; IsHeightsBody is true for it; empty: no body
  std::string_view body;
};

// Whether bodies of this Content-Type are supported: a JSON object of texts and numbers, or a form.
bool IsHeightsBody(std::string_view content_type);

// `locations=lat,lon|lat,lon`, or `path=lat,lon|lat,lon` with either `step=METRES` or `samples=N`; with either,
// `datum=ellipsoid` or `datum=orthometric`, and `certify=LEVEL` or `certify=deepest`; `v` is ignored. Each may occur
// once in query and body together. kInvalidArgument: anything else, numbers that are not finite or not a position on
// Earth, or more than `max_locations` points; the message is for the client, and names the item and the byte of the
// body where parsing ended. kCancelled: a stop was requested; it is checked every kPartBytes of the text.
Result<HeightsQuery> ParseHeights(const HeightsInput& input, std::size_t max_locations,
                                  const std::stop_token& stop = {});

}  // namespace terrace::server
