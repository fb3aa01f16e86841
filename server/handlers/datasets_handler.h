// GET /datasets
#pragma once

#include <functional>
#include <span>
#include <stop_token>
#include <string>

#include "server/tiles/dataset_view.h"

namespace terrace::server {

// Whether a dataset is to be listed.
using IsSeen = std::function<bool(const DatasetView&)>;
inline bool SeeAll(const DatasetView&) { return true; }

// {"datasets":[{"name","attribution","bounds":[w,s,e,n],"min_level","max_level","heights":{"min","max"},
//   "urls":{"layer","tileset","tiles","tiles_json","heights","mesh"}}]}
// Degrees, west > east across the antimeridian; metres; URLs are absolute paths on this server.
// Empty, as is the next: a stop was requested.
std::string DatasetsJson(std::span<const DatasetView> datasets, const IsSeen& is_seen = SeeAll,
                         const std::stop_token& stop = {});

// What `/` shows where no viewer is installed.
std::string IndexHtml(std::span<const DatasetView> datasets, const IsSeen& is_seen = SeeAll,
                      const std::stop_token& stop = {});

// A dataset's name as one path segment of a URL.
std::string PercentEncode(std::string_view name);

}  // namespace terrace::server
