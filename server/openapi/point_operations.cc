#include "server/openapi/common_parameters.h"
#include "server/openapi/operations.h"

namespace terrace::server {

const Operation kHeightsOperation{
    .id = "getHeights",
    .tag = "heights",
    .summary = "Heights at points or along a path",
    .description =
        "The format of Open Topo Data. A body of numbers has longitude and latitude of each point as little-endian "
        "64-bit floats; the reply then has a 32-bit float for each point, four with `normals=1`. One request may have "
        "`max_locations` points.",
    .parameters = {{"locations", "Points `latitude,longitude` in degrees, separated by `|`. Excludes `path`.",
                    R"({"type":"string"})"},
                   {"path",
                    "Corners `latitude,longitude` in degrees, separated by `|`: points along the shortest line on the "
                    "ellipsoid from each corner to the next. Needs `step` or `samples`.",
                    R"({"type":"string"})"},
                   {"step", "With `path`: points at this distance from each other in metres, and the last corner.",
                    kPositiveNumber},
                   {"samples", "With `path`: the number of points, at equal distances.",
                    R"({"type":"integer","minimum":2})"},
                   kDatumNote,
                   {"certify",
                    "A level or `deepest`. Adds to each elevation the tile of this level that contains the point, or "
                    "its deepest available ancestor, and the tile's certified error.",
                    R"({"type":"string","pattern":"^([0-9]+|deepest)$"})"},
                   {"normals", "`1`: adds the unit normal (east, north, up) and the slope in degrees.", kFlag},
                   kSurfaceNote,
                   kSurfaceLevelNote,
                   kErrorNote,
                   kFractionNote,
                   kAtLeastNote,
                   kSurfaceFormatNote,
                   kCompressionNote},
    .replies = {{"application/json", "Heights"}, {.type = "application/octet-stream", .is_of_post = true}},
    .headers = DocumentHeaders(),
    .examples = {{"/jacksboro/heights?locations=36.3,-84.2|0,0"},
                 {"/jacksboro/heights?locations=36.3,-84.2&datum=ellipsoid&normals=1"},
                 {"/jacksboro/heights?locations=36.3,-84.2&certify=deepest"},
                 {"/jacksboro/heights?path=36.3,-84.2|36.4,-84.1&samples=3"},
                 {"/jacksboro/heights?path=36.3,-84.2|36.4,-84.1&step=5000"},
                 {"/jacksboro/heights?locations=36.3,-84.2&surface=served"},
                 {"/jacksboro/heights?locations=36.3,-84.2&surface=served&level=9&error=20&atleast=1"},
                 {"/jacksboro/heights?locations=36.3,-84.2&surface=served&fraction=0.25&format=glb"},
                 {"/jacksboro/heights?locations=36.3,-84.2&surface=served&format=glb&compression=none"},
                 {"/jacksboro/heights", "application/json", R"({"locations":"36.3,-84.2|36.4,-84.1","normals":1})"},
                 {"/jacksboro/heights", "application/x-www-form-urlencoded", "locations=36.3,-84.2%7C36.4,-84.1"},
                 {"/jacksboro/heights", "application/octet-stream", "zczMzMwMVcBmZmZmZiZCQA=="}}};

const Operation kGridOperation{
    .id = "getGrid",
    .tag = "heights",
    .summary = "Heights at the nodes of a grid",
    .description =
        "The outermost nodes lie on the box. Rows run from the north, nodes in a row from the west. A grid may have "
        "`max_mesh_samples` nodes.",
    .parameters =
        {{"bbox",
          "`west,south,east,north` in units of `crs`; in degrees, west > east is a box across the antimeridian.",
          R"({"type":"string"})", true},
         {"width", "Number of nodes in a row. With `height`, or `spacing` instead of both.",
          R"({"type":"integer","minimum":2})"},
         {"height", "Number of rows.", R"({"type":"integer","minimum":2})"},
         {"spacing",
          "Distance of nodes in units of `crs`. The box shrinks at its eastern and southern side to whole steps.",
          kPositiveNumber},
         {"crs", "A projected or geographic reference system; EPSG:4326 is the default.",
          R"({"type":"string","pattern":"^EPSG:[0-9]+$"})"},
         {"format",
          "`f32`, the default: 32-bit floats. `r16`, `png16`: 16-bit integers. `geotiff`: 32-bit floats. `json`: the "
          "grid's description alone.",
          R"({"type":"string","enum":["f32","r16","png16","geotiff","json"]})"},
         kDatumNote,
         {"range", "`min,max`, with `r16`, `png16` and `json`: the heights of 0 and 65535 in metres.",
          R"({"type":"string"})"},
         kSurfaceNote,
         kSurfaceLevelNote,
         kErrorNote,
         kFractionNote,
         kAtLeastNote},
    .replies = {{"application/octet-stream"},
                {"application/json", "Grid"},
                {"image/png"},
                {"image/tiff; application=geotiff"}},
    .headers = {"ETag", "Cache-Control", "Vary", "Terrain-Grid"},
    .examples = {
        {"/jacksboro/grid?bbox=-84.3,36.2,-84.2,36.3&width=5&height=5&format=json"},
        {"/jacksboro/grid?bbox=-84.3,36.2,-84.2,36.3&width=5&height=5&format=r16&range=0,2000"},
        {"/jacksboro/grid?bbox=740000,4010000,750000,4020000&crs=EPSG:32616&spacing=2500&datum=ellipsoid"},
        {"/jacksboro/grid?bbox=-84.3,36.2,-84.2,36.3&width=5&height=5&surface=served"},
        {"/jacksboro/grid?bbox=-84.3,36.2,-84.2,36.3&width=5&height=5&surface=served&level=9&error=20&atleast=1"},
        {"/jacksboro/grid?bbox=-84.3,36.2,-84.2,36.3&width=5&height=5&surface=served&fraction=0.5"}}};

const Operation kSightOperation{
    .id = "getSight",
    .tag = "heights",
    .summary = "Whether straight lines between points are free of ground",
    .description =
        "A body of numbers has longitude, latitude and height of both ends of each ray as little-endian 64-bit floats; "
        "the reply then has two 32-bit floats for each ray: the clearance, NaN without a height below the ray, and the "
        "distance of the first place below the surface, NaN if none is.",
    .parameters = {{"from", "`latitude,longitude,height` of one end: degrees, and metres above the ellipsoid.",
                    R"({"type":"string"})"},
                   {"to", "`latitude,longitude,height` of the other end.", R"({"type":"string"})"},
                   {"rays",
                    "Instead of `from` and `to`: six numbers for each ray, `latitude,longitude,height` of both ends, "
                    "separated by `|`.",
                    R"({"type":"string"})"},
                   {"heights", "What the heights of the ends count from; `ellipsoid` is the default.",
                    R"({"type":"string","enum":["ellipsoid","ground"]})"},
                   {"refraction", "The share of the Earth's curvature that the air bends rays by; 0 is the default.",
                    R"({"type":"number","minimum":-1,"maximum":1})"},
                   kSurfaceNote,
                   kSurfaceLevelNote,
                   kErrorNote,
                   kFractionNote,
                   kAtLeastNote,
                   kSurfaceFormatNote,
                   kCompressionNote},
    .replies = {{"application/json", "Sight"}, {.type = "application/octet-stream", .is_of_post = true}},
    .headers = DocumentHeaders(),
    .examples = {
        {"/jacksboro/sight?from=36.3,-84.2,10&to=36.31,-84.21,10&heights=ground&refraction=0.13"},
        {"/jacksboro/sight?rays=36.3,-84.2,1500,36.31,-84.21,1500|36.3,-84.2,0,36.4,-84.1,0"},
        {"/jacksboro/sight?from=36.3,-84.2,900&to=36.31,-84.21,900&surface=served"},
        {"/jacksboro/sight?from=36.3,-84.2,900&to=36.31,-84.21,900&surface=served&level=9&error=20&atleast=1"},
        {"/jacksboro/sight?from=36.3,-84.2,900&to=36.31,-84.21,900&surface=served&fraction=0.25&format=glb"},
        {"/jacksboro/sight?from=36.3,-84.2,900&to=36.31,-84.21,900&surface=served&format=glb&compression=none"},
        {"/jacksboro/sight", "application/json", R"({"rays":"36.3,-84.2,1500,36.31,-84.21,1500"})"},
        {"/jacksboro/sight", "application/x-www-form-urlencoded", "rays=36.3,-84.2,1500,36.31,-84.21,1500"},
        {"/jacksboro/sight", "application/octet-stream",
         "zczMzMwMVcBmZmZmZiZCQAAAAAAAcJdAPQrXo3ANVcBI4XoUridCQAAAAAAAcJdA"}}};

const Operation kAreaOperation{
    .id = "getMesh",
    .tag = "heights",
    .summary = "One triangle mesh of an area",
    .description =
        "The area is read on the lattice of the first level whose default error is at most the requested error. It may "
        "have `max_mesh_samples` samples.",
    .parameters = {{"bbox", "`west,south,east,north` in degrees; west > east is a box across the antimeridian.",
                    R"({"type":"string"})", true},
                   {"error", "The bound on the vertical distance at every sample of the meshed lattice, in metres.",
                    kPositiveNumber, true},
                   {"format", "`glb` is the default.", R"({"type":"string","enum":["glb","obj","ply"]})"},
                   {"coordinates",
                    "`enu`, the default: metres east, north and up of the area's centre. `ecef`: EPSG:4978. "
                    "`geographic`: degrees and metres.",
                    R"({"type":"string","enum":["enu","ecef","geographic"]})"}},
    .replies = {{"model/gltf-binary"}, {"model/obj"}, {"application/octet-stream"}},
    .headers = {"ETag", "Cache-Control", "Vary", "Terrain-Max-Error", "Terrain-Origin"},
    .examples = {{"/jacksboro/mesh?bbox=-84.3,36.2,-84.2,36.3&error=20"},
                 {"/jacksboro/mesh?bbox=-84.3,36.2,-84.2,36.3&error=20&format=obj&coordinates=geographic"}}};

}  // namespace terrace::server
