// GET /datasets
#pragma once

#include <functional>
#include <span>
#include <string>

#include "server/tiles/dataset_view.h"

namespace terrace::server {

// Whether a dataset is to be listed.
using IsSeen = std::function<bool(const DatasetView&)>;
inline bool SeeAll(const DatasetView&) { return true; }

// {"datasets":[{"name","attribution","bounds":[w,s,e,n],"min_level","max_level","heights":{"min","max"},
//   "urls":{"layer","tileset","tiles","tiles_json","heights","mesh"}}]}
// Degrees, west > east across the antimeridian; metres; URLs are absolute paths on this server.
std::string DatasetsJson(std::span<const DatasetView> datasets, const IsSeen& is_seen = SeeAll);

// What `/` shows where no viewer is installed.
std::string IndexHtml(std::span<const DatasetView> datasets, const IsSeen& is_seen = SeeAll);

// A dataset's name as one path segment of a URL.
std::string PercentEncode(std::string_view name);

}  // namespace terrace::server
