// What a request for heights asks for: points one by one, or along a path. Pure.
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
  std::vector<double> distances_m;  // of a path: one a point, from its beginning; else empty
  dem::HeightDatum datum = dem::HeightDatum::kEllipsoid;
  // The deepest level of the tiles whose certified errors are wanted as well; geo::kMaxLevel: as deep as there are.
  std::optional<int> certify_level;
};

// Where the parameters of a request stand.
struct HeightsInput {
  std::string_view query;         // of the URL
  std::string_view content_type;  // of the body, IsHeightsBody; empty: there is no body
  std::string_view body;
};

// Whether a body of this Content-Type is read at all: a JSON object of texts and numbers, or a form.
bool IsHeightsBody(std::string_view content_type);

// `locations=lat,lon|lat,lon`, or `path=lat,lon|lat,lon` with either `step=METRES` or `samples=N`; with either,
// `datum=ellipsoid` or `datum=orthometric`, and `certify=LEVEL` or `certify=deepest`; `v` is ignored. Each at most once
// in query and body together. kInvalidArgument, with a message for the client that names the item, and the byte of the
// body where reading ended: anything else, numbers that are not finite or no place on Earth, and more than
// `max_locations` points. kCancelled: a stop was requested; it is looked for every kPartBytes of the text.
Result<HeightsQuery> ParseHeights(const HeightsInput& input, std::size_t max_locations,
                                  const std::stop_token& stop = {});

}  // namespace terrace::server
