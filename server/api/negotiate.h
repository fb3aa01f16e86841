// From a route and a request's headers to a canonical TileRequest. Pure.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "proto/media_type.h"
#include "server/api/call.h"
#include "server/query/query.h"
#include "server/tiles/dataset_view.h"
#include "tiler/tile_request.h"

namespace terrace::server {

// kNotFound: no such dataset, or the tile lies outside what the dataset has. Errors of TileFormat::read.
// Precondition: the route has a format.
Result<tiler::TileRequest> Negotiate(const Call& call, std::span<const DatasetView> datasets);

// The dataset's index, or kNotFound.
Result<std::uint32_t> FindDataset(std::string_view name, std::span<const DatasetView> datasets);

// The coding in `offered` with the highest quality, if that is at least the quality of identity; among equals the
// first. Without Accept-Encoding: identity.
tiler::Coding NegotiateCoding(std::string_view accept_encoding,
                              std::span<const tiler::Coding> offered = tiler::kCodings);

// The extensions named by `extensions=a-b` parameters anywhere in Accept and by the query's values. Unknown names are
// ignored. 3DTilesRendererJS adds the parameter to application/octet-stream.
proto::TileExtensions WantedExtensions(std::string_view accept, const std::vector<std::string>& query_extensions);

// The step on the level's ladder for a requested error; 0 if none is requested. `is_deepest`: the level is the deepest
// of the dataset. No finer level follows it, so `atleast` does not limit its tiles to their default error.
int ErrorStep(const RequestedError& requested, int level, bool is_deepest, double error_fraction);

}  // namespace terrace::server
