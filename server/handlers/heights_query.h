// What a request for heights asks for: points one by one, or along a path. Pure.
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/dem_source.h"
#include "server/http/query.h"

namespace terrace::server {

struct HeightsQuery {
  std::vector<dem::GeoPosition> points;
  std::vector<double> distances_m;  // of a path: one a point, from its beginning; else empty
  dem::HeightDatum datum = dem::HeightDatum::kEllipsoid;
  // The deepest level of the tiles whose certified errors are wanted as well; geo::kMaxLevel: as deep as there are.
  std::optional<int> certify_level;
};

// `locations=lat,lon|lat,lon`, or `path=lat,lon|lat,lon` with either `step=METRES` or `samples=N`; with
// either, `datum=ellipsoid` or `datum=orthometric`, and `certify=LEVEL` or `certify=deepest`; `v` may come any number
// of times. kInvalidArgument, with a message
// for the client that names the item: anything else, numbers that are not finite or no place on Earth, and more than
// `max_locations` points.
Result<HeightsQuery> ParseHeightsQuery(const QueryParameters& parameters, std::size_t max_locations);

// Whether a body of this Content-Type is read at all: JSON or a form.
bool IsHeightsBody(std::string_view content_type);

// The parameters in a request's body, by its Content-Type: a JSON object of texts and numbers, or a form. Each at most
// once. kInvalidArgument: malformed. Precondition: IsHeightsBody.
Result<QueryParameters> ParseHeightsBody(std::string_view content_type, std::string_view body);

}  // namespace terrace::server
