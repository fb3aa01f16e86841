// How long a reply may be kept: the value of its Cache-Control.
#pragma once

#include <string_view>

#include "server/tiles/dataset_view.h"

namespace terrace::server {

// Of documents that name the current version: clients ask again each time, and usually hear 304.
inline constexpr std::string_view kRevalidate = "no-cache";

// Of a reply whose bytes the dataset's version and the URL decide, by the `v` parameter of its query: for a year where
// that is the current version, since the URL never means anything else; not at all where it is another one, since the
// reply is of the current version nevertheless; `unversioned` where there is none. Of several the first counts: clients
// append their own behind that of a template. The result may be a view of `unversioned`.
std::string_view CacheControlOf(std::string_view query, const DatasetView& dataset, std::string_view unversioned);

}  // namespace terrace::server
