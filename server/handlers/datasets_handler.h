// GET /datasets
#pragma once

#include <functional>
#include <span>
#include <stop_token>
#include <string>

#include "server/tiles/dataset_view.h"

namespace terrace::server {

// Whether the client may see a dataset. Empty: it may see all.
using IsSeen = std::function<bool(const DatasetView&)>;

// {"datasets":[{"name","version","attribution","bounds":[w,s,e,n],"finest_bounds":[w,s,e,n],"min_level","max_level",
//   "heights":{"min","max"},"urls":{"layer","tileset","tiles","tiles_json","heights","mesh"}}],"more_with_token":true}
// Degrees, west > east across the antimeridian; metres; URLs are absolute paths on this server. `more_with_token` is
// present for every client that may not see all datasets, whether or not there are more, so that it reveals nothing.
// Returns an empty string if a stop was requested; so does IndexHtml.
std::string DatasetsJson(std::span<const DatasetView> datasets, const IsSeen& is_seen = {},
                         const std::stop_token& stop = {});

// The page at `/` if no viewer is installed.
std::string IndexHtml(std::span<const DatasetView> datasets, const IsSeen& is_seen = {},
                      const std::stop_token& stop = {});

// Encodes a dataset's name as one path segment of a URL.
std::string PercentEncode(std::string_view name);

}  // namespace terrace::server
