// GET /datasets
#pragma once

#include <functional>
#include <span>
#include <stop_token>
#include <string>

#include "server/tiles/dataset_view.h"

namespace terrace::server {

// Whether a dataset is listed for who asks. Empty: all are.
using IsSeen = std::function<bool(const DatasetView&)>;

// {"datasets":[{"name","version","attribution","bounds":[w,s,e,n],"finest_bounds":[w,s,e,n],"min_level","max_level",
//   "heights":{"min","max"},"urls":{"layer","tileset","tiles","tiles_json","heights","mesh"}}],"more_with_token":true}
// Degrees, west > east across the antimeridian; metres; URLs are absolute paths on this server. `more_with_token` is
// there for whoever does not see everything, whether or not there is more: that is not for them to know.
// Empty, as is the next: a stop was requested.
std::string DatasetsJson(std::span<const DatasetView> datasets, const IsSeen& is_seen = {},
                         const std::stop_token& stop = {});

// What `/` shows where no viewer is installed.
std::string IndexHtml(std::span<const DatasetView> datasets, const IsSeen& is_seen = {},
                      const std::stop_token& stop = {});

// A dataset's name as one path segment of a URL.
std::string PercentEncode(std::string_view name);

}  // namespace terrace::server
