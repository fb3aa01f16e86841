// The parameters of a request for heights, and its points.
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "server/query/list_parameters.h"

namespace terrace::server {

// Appends the points of `locations` or the corners of `path` to `points`, which outlives the sink. `text_bytes`:
// approximate size of the input, to reserve memory for them.
ListParameters HeightsParameters(std::size_t max_locations, std::size_t text_bytes,
                                 std::vector<dem::GeoPosition>& points);

// Parses the whole text, apart from blanks, as a finite number.
std::optional<double> NumberOf(std::string_view text);

// kInvalidArgument: more points than one request may have.
tl::unexpected<Error> TooManyPoints(std::string_view parameter, std::size_t max_locations);

}  // namespace terrace::server
