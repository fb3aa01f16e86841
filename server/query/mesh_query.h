// A parsed request for the mesh of an area. Pure.
#pragma once

#include <string_view>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "tiler/area/area_mesh.h"

namespace terrace::server {

// Reads `bbox=west,south,east,north` and `error=METRES`, both required; `format=glb|obj|ply`,
// `coordinates=enu|ecef|geographic`; `v` may be repeated. west > east: the box crosses the antimeridian.
// kInvalidArgument: the message is for the client.
Result<tiler::AreaRequest> ParseAreaRequest(std::string_view query);
// Reads `west,south,east,north`; west > east: the box crosses the antimeridian. Errors: as above.
Result<dem::GeoBounds> ParseBox(std::string_view text);

}  // namespace terrace::server
