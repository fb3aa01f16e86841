#include "server/openapi/schemas.h"

namespace terrace::server {
namespace {

// Objects that the server defines have no other members than these; those of 3D Tiles, TileJSON and layer.json may.
constexpr NamedSchema kSchemas[] = {
    {"Problem", R"({"type":"object","description":"RFC 9457",
       "required":["type","title","status","detail","request_id"],"additionalProperties":false,
       "properties":{"type":{"const":"about:blank"},"title":{"type":"string"},"status":{"type":"integer"},
         "detail":{"type":"string"},"request_id":{"type":"string","description":"As in the server's log"}}})"},
    {"Bounds",
     R"({"type":"array","description":"West, south, east, north in degrees; west > east crosses the antimeridian",
       "minItems":4,"maxItems":4,"items":{"type":"number","minimum":-180,"maximum":180}})"},
    {"DatasetVersion", R"({"type":"string","pattern":"^[0-9a-f]{12}$"})"},
    {"Datasets", R"({"type":"object","required":["datasets"],"additionalProperties":false,"properties":{
       "more_with_token":{"const":true,"description":"A token may show others"},
       "preparing":{"type":"array","minItems":1,"description":"Datasets that are configured and not served yet",
         "items":{"type":"object","required":["name","percent"],"additionalProperties":false,"properties":{
           "name":{"type":"string"},
           "percent":{"type":"integer","minimum":0,"maximum":99,"description":"Share of the sources that is read"},
           "failed":{"const":true,"description":"The sources cannot be opened as they are now"}}}},
       "datasets":{"type":"array","items":{"type":"object",
         "required":["name","version","attribution","bounds","finest_bounds","sources","min_level","max_level","heights","urls"],
         "additionalProperties":false,
         "properties":{"name":{"type":"string"},"version":{"$ref":"#/components/schemas/DatasetVersion"},
           "attribution":{"type":"string"},"bounds":{"$ref":"#/components/schemas/Bounds"},
           "finest_bounds":{"$ref":"#/components/schemas/Bounds"},"sources":{"type":"integer","minimum":0},
           "min_level":{"const":0},"max_level":{"type":"integer","minimum":0},
           "heights":{"type":"object","required":["min","max"],"additionalProperties":false,
             "properties":{"min":{"type":"number"},"max":{"type":"number"}}},
           "imagery":{"type":"object","required":["attribution","bounds","max_level","geodetic_max_level"],
             "additionalProperties":false,"properties":{"attribution":{"type":"string"},
               "bounds":{"$ref":"#/components/schemas/Bounds"},"max_level":{"type":"integer","minimum":0},
               "geodetic_max_level":{"type":"integer","minimum":0}}},
           "urls":{"type":"object","description":"Those of what the dataset serves","minProperties":1,
             "properties":{"layer":{"type":"string"},"tileset":{"type":"string"},"tiles":{"type":"string"},
               "tiles_json":{"type":"string"},"heights":{"type":"string"},"mesh":{"type":"string"}},
             "additionalProperties":{"type":"string"}}}}}}})"},
    {"Layer", R"({"type":"object",
       "required":["tilejson","name","format","version","scheme","projection","tiles","minzoom","maxzoom","bounds","available"],
       "properties":{"tilejson":{"const":"2.1.0"},"name":{"type":"string"},"format":{"const":"quantized-mesh-1.0"},
         "version":{"$ref":"#/components/schemas/DatasetVersion"},"scheme":{"const":"tms"},"projection":{"const":"EPSG:4326"},
         "tiles":{"type":"array","minItems":1,"items":{"type":"string"}},"minzoom":{"const":0},
         "maxzoom":{"type":"integer","minimum":0},"bounds":{"$ref":"#/components/schemas/Bounds"},
         "attribution":{"type":"string"},"extensions":{"type":"array","items":{"type":"string"}},
         "available":{"type":"array","items":{"type":"array","items":{"type":"object",
           "required":["startX","startY","endX","endY"],"additionalProperties":false,
           "properties":{"startX":{"type":"integer"},"startY":{"type":"integer"},"endX":{"type":"integer"},
             "endY":{"type":"integer"}}}}}}})"},
    {"EditOutlines", R"({"type":"object","required":["type","features"],"additionalProperties":false,
       "properties":{"type":{"const":"FeatureCollection"},"features":{"type":"array","items":{"type":"object",
         "required":["type","properties","geometry"],"additionalProperties":false,"properties":{
           "type":{"const":"Feature"},"properties":{"type":"object","required":["op","file","feature","area"],
             "properties":{"op":{"type":"string"},"file":{"type":"string"},"feature":{"type":"integer","minimum":0},
               "area":{"type":"boolean"}}},
           "geometry":{"type":"object","required":["type","coordinates"],"properties":{
             "type":{"const":"MultiLineString"},"coordinates":{"type":"array","items":{"type":"array",
               "items":{"type":"array","minItems":2,"maxItems":2,"items":{"type":"number"}}}}}}}}}}})"},
    {"TilesetTile", R"({"type":"object","required":["boundingVolume","geometricError"],"properties":{
       "boundingVolume":{"type":"object","minProperties":1},"geometricError":{"type":"number","minimum":0},
       "refine":{"const":"REPLACE"},"content":{"type":"object","required":["uri"],"properties":{"uri":{"type":"string"}}},
       "implicitTiling":{"type":"object","required":["subdivisionScheme","availableLevels","subtreeLevels","subtrees"],
         "properties":{"subdivisionScheme":{"const":"QUADTREE"},"availableLevels":{"type":"integer","minimum":1},
           "subtreeLevels":{"type":"integer","minimum":1,"maximum":7},
           "subtrees":{"type":"object","required":["uri"],"properties":{"uri":{"type":"string"}}}}},
       "children":{"type":"array","items":{"$ref":"#/components/schemas/TilesetTile"}}}})"},
    {"Tileset", R"({"type":"object","required":["asset","geometricError","root"],"properties":{
       "asset":{"type":"object","required":["version","tilesetVersion"],"properties":{"version":{"const":"1.1"},
         "tilesetVersion":{"$ref":"#/components/schemas/DatasetVersion"}}},
       "geometricError":{"type":"number","minimum":0},"root":{"$ref":"#/components/schemas/TilesetTile"}}})"},
    {"TileJson", R"({"type":"object",
       "required":["tilejson","name","scheme","tiles","minzoom","maxzoom","bounds","type","format","encoding","tileSize"],
       "properties":{"tilejson":{"const":"3.0.0"},"name":{"type":"string"},"scheme":{"const":"xyz"},
         "tiles":{"type":"array","minItems":1,"items":{"type":"string"}},"minzoom":{"type":"integer","minimum":0},
         "maxzoom":{"type":"integer","minimum":0},"bounds":{"$ref":"#/components/schemas/Bounds"},
         "attribution":{"type":"string"},"type":{"const":"raster-dem"},"format":{"const":"png"},
         "encoding":{"enum":["mapbox","terrarium"]},"tileSize":{"enum":[256,512]}}})"},
    {"MapTileJson", R"({"type":"object",
       "required":["tilejson","name","scheme","tiles","minzoom","maxzoom","bounds","format"],
       "properties":{"tilejson":{"const":"3.0.0"},"name":{"type":"string"},"scheme":{"const":"xyz"},
         "tiles":{"type":"array","minItems":1,"items":{"type":"string"}},"minzoom":{"type":"integer","minimum":0},
         "maxzoom":{"type":"integer","minimum":0},"bounds":{"$ref":"#/components/schemas/Bounds"},
         "attribution":{"type":"string"},"format":{"enum":["png","webp","jpg","pbf"]}}})"},
    {"Heights", R"({"type":"object","required":["results","status"],"additionalProperties":false,"properties":{
       "status":{"const":"OK"},"datum":{"const":"orthometric"},
       "results":{"type":"array","items":{"type":"object","required":["elevation","location","dataset"],
         "additionalProperties":false,"properties":{
           "elevation":{"type":["number","null"],"description":"Metres; null: no height"},
           "location":{"type":"object","required":["lat","lng"],"additionalProperties":false,
             "properties":{"lat":{"type":"number"},"lng":{"type":"number"}}},
           "distance":{"type":"number","description":"Along the path, in metres"},
           "normal":{"type":"array","minItems":3,"maxItems":3,"items":{"type":"number"}},
           "slope":{"type":"number","minimum":0,"maximum":90},"filled":{"const":true},
           "certified_error":{"type":["number","null"]},"tile":{"type":"string","pattern":"^[0-9]+/[0-9]+/[0-9]+$"},
           "dataset":{"type":"string"}}}}}})"},
    {"Grid", R"({"type":"object",
       "required":["width","height","crs","bbox","spacing","offset","scale","voids","unreal"],"additionalProperties":false,
       "properties":{"width":{"type":"integer"},"height":{"type":"integer"},"crs":{"type":"string"},
         "bbox":{"type":"array","minItems":4,"maxItems":4,"items":{"type":"number"}},
         "spacing":{"type":"array","minItems":2,"maxItems":2,"items":{"type":"number"}},
         "offset":{"type":"number"},"scale":{"type":"number"},"voids":{"type":"integer","minimum":0},
         "unreal":{"type":"object","required":["scale_z","zero_m"],"additionalProperties":false,
           "properties":{"scale_z":{"type":"number"},"zero_m":{"type":"number"}}}}})"},
    {"SightPlace", R"({"type":"object","required":["lat","lng","height","distance"],"additionalProperties":false,
       "properties":{"lat":{"type":"number"},"lng":{"type":"number"},"height":{"type":"number"},
         "distance":{"type":"number","description":"From the beginning, in metres"}}})"},
    {"Sight", R"({"type":"object","required":["results","status"],"additionalProperties":false,"properties":{
       "status":{"const":"OK"},
       "results":{"type":"array","items":{"type":"object","required":["visible","length","clearance"],
         "additionalProperties":false,"properties":{"visible":{"type":"boolean"},"length":{"type":"number"},
           "clearance":{"type":["number","null"]},"lowest":{"$ref":"#/components/schemas/SightPlace"},
           "blocked":{"$ref":"#/components/schemas/SightPlace"},"gaps":{"const":true},"remark":{"type":"string"}}}}}})"},
    {"Version", R"({"type":"object","required":["product","version","build","encoder","libraries","datasets"],
       "additionalProperties":false,"properties":{"product":{"const":"terrace"},
         "version":{"type":"string","pattern":"^[0-9]+[.][0-9]+[.][0-9]+$"},"build":{"type":"string"},
         "encoder":{"type":"integer"},"libraries":{"type":"object","additionalProperties":{"type":"string"}},
         "datasets":{"type":"array","items":{"type":"object","required":["name","version"],"additionalProperties":false,
           "properties":{"name":{"type":"string"},"version":{"$ref":"#/components/schemas/DatasetVersion"}}}}}})"},
    {"OpenApi", R"({"type":"object","required":["openapi","info","paths"],"properties":{"openapi":{"const":"3.1.0"},
       "info":{"type":"object"},"paths":{"type":"object"}}})"},
};

constexpr PathNote kPathNotes[] = {
    {"dataset", "Name of the dataset, as in `/datasets`", R"({"type":"string"})"},
    {"z", "Level", R"({"type":"integer","minimum":0})"},
    {"x", "Column, from the west", R"({"type":"integer","minimum":0})"},
    {"y", "Row, from the side that the scheme says", R"({"type":"integer","minimum":0})"},
    {"root", "`z-x-y` of the TMS tile at the root of the tree",
     R"({"type":"string","pattern":"^[0-9]+-[0-9]+-[0-9]+$"})"},
    {"level", "Level below the root", R"({"type":"integer","minimum":0})"},
    {"levels", "Levels of the subtree", R"({"type":"integer","minimum":1,"maximum":7})"},
    {"file", "Path of the file", R"({"type":"string"})"},
};

constexpr HeaderNote kHeaderNotes[] = {
    {"ETag",
     "Strong; of the coding that was sent. Orthometric heights, grids in a crs other than EPSG:4326, and certified "
     "errors have none",
     R"({"type":"string","pattern":"^\"[0-9a-f]+\"$"})"},
    {"Cache-Control", "How long the reply may be cached", R"({"type":"string"})"},
    {"Vary", "The request's headers that the reply depends on", R"({"type":"string"})"},
    {"Terrain-Max-Error", "The tile's or mesh's error in metres, measured and rounded up",
     R"({"type":"number","minimum":0})"},
    {"Terrain-Certified-Error",
     "Bound on the distance of every visible sample of the sources from the surface, in metres",
     R"({"type":"number","minimum":0})"},
    {"Terrain-Origin", "With `coordinates=enu`: latitude, longitude and height of the origin", R"({"type":"string"})"},
    {"Terrain-Grid", "Size, box, offset, scale and number of voids of the grid", R"({"type":"string"})"},
    {"Retry-After", "Seconds", R"({"type":"integer","minimum":1})"},
    {"WWW-Authenticate", "`Bearer`", R"({"type":"string"})"},
};

// In the order of the alphabet, as linters demand.
constexpr TagNote kTagNotes[] = {
    {"documents", "Descriptions that clients start from"},
    {"heights", "Heights, grids, lines of sight and meshes"},
    {"maps", "Layers for 2D maps"},
    {"monitoring", "Probes, metrics and versions"},
    {"tiles", "Tiles in all formats"},
    {"viewer", "The page and its files"},
};

}  // namespace

std::span<const NamedSchema> Schemas() { return kSchemas; }
std::span<const PathNote> PathNotes() { return kPathNotes; }
std::span<const HeaderNote> HeaderNotes() { return kHeaderNotes; }
std::span<const TagNote> TagNotes() { return kTagNotes; }

}  // namespace terrace::server
