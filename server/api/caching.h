// How long a reply may be cached: the value of its Cache-Control.
#pragma once

#include <string_view>

#include "server/tiles/catalog.h"

namespace terrace::server {

// For documents that contain the current version: clients must revalidate, and usually get 304.
inline constexpr std::string_view kRevalidate = "no-cache";

// For a reply whose bytes depend on the dataset's version and the URL. The value depends on the `v` parameter of
// the query. If it is the current version, the reply may be cached for a year, because the URL always means the same
// bytes. If it is another version, it may not be cached, because the reply is of the current version. The value
// is `unversioned` without `v`, and also with the current version if the bytes depend on something that no version
// covers (`is_covered` is false).
// Of several `v`, the first is used, because clients append their own after that of a template. The result may be a
// view of `unversioned`.
std::string_view CacheControlOf(std::string_view query, const DatasetView& dataset, std::string_view unversioned,
                                bool is_covered = true);

}  // namespace terrace::server
