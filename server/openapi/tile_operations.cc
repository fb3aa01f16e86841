#include "server/openapi/common_parameters.h"
#include "server/openapi/operations.h"

namespace terrace::server {
namespace {

constexpr ParameterNote kExtensionsNote{"extensions",
                                        "Names separated by `-`: `octvertexnormals`, `watermask`, `metadata`. Other "
                                        "names are ignored, and `.glb` tiles ignore all of them. May be repeated.",
                                        R"({"type":"string"})"};

const std::vector<std::string_view> kTileHeaders = {"ETag", "Cache-Control", "Vary", "Terrain-Max-Error",
                                                    "Terrain-Certified-Error"};

const std::vector<ParameterNote> kGlbParameters = {kErrorNote,       kFractionNote, kAtLeastNote,
                                                   kCompressionNote, kTextureNote,  kExtensionsNote};
const std::vector<MediaNote> kGlbReplies = {{"model/gltf-binary"}};

}  // namespace

const Operation kTerrainTileOperation{
    .id = "getTerrainTile",
    .tag = "tiles",
    .summary = "A tile as quantized-mesh 1.0",
    .description =
        "EPSG:4326 in the TMS scheme: two tiles at level 0, y from the south. The parameter `extensions` of a media "
        "type in `Accept` requests the same extensions as the query.",
    .parameters = {kErrorNote, kFractionNote, kAtLeastNote, kExtensionsNote},
    .replies = {{"application/vnd.quantized-mesh"}},
    .headers = kTileHeaders,
    .examples = {{"/jacksboro/9/272/359.terrain"},
                 {"/jacksboro/9/272/359.terrain?error=20&atleast=0"},
                 {"/jacksboro/9/272/359.terrain?fraction=0.1&extensions=octvertexnormals"}}};

const Operation kGlbTileOperation{
    .id = "getGlbTile",
    .tag = "tiles",
    .summary = "A tile as glTF 2.0 with skirts",
    .description = "The mesh of the `.terrain` tile of this number, for 3D Tiles clients.",
    .parameters = kGlbParameters,
    .replies = kGlbReplies,
    .headers = kTileHeaders,
    .examples = {{"/jacksboro/9/272/359.glb"},
                 {"/jacksboro/9/272/359.glb?error=20&atleast=1&compression=meshopt&texture=none"},
                 {"/jacksboro/9/272/359.glb?fraction=0.25&extensions=octvertexnormals"}}};

const Operation kHeightTileOperation{
    .id = "getHeightTile",
    .tag = "tiles",
    .summary = "Heights as colours of a PNG",
    .description = "EPSG:3857 in the XYZ scheme of web maps: one tile at level 0, y from the north.",
    .parameters = {kEncodingNote, kSizeNote},
    .replies = {{"image/png"}},
    .headers = {"ETag", "Cache-Control", "Terrain-Max-Error"},
    .examples = {{"/jacksboro/9/135/200.png"}, {"/jacksboro/9/135/200.png?encoding=terrarium&size=512"}}};

const Operation kImplicitTileOperation{
    .id = "getImplicitTile",
    .tag = "tiles",
    .summary = "A tile of an implicit tree as glTF 2.0",
    .description = "Level, x and y count from the root of the tree. `tileset.json` names the trees.",
    .parameters = kGlbParameters,
    .replies = kGlbReplies,
    .headers = kTileHeaders,
    .examples = {{"/jacksboro/3dtiles/9-272-359/1/0/1.glb"},
                 {"/jacksboro/3dtiles/9-272-359/1/0/1.glb?error=20&atleast=1&compression=none&texture=none"},
                 {"/jacksboro/3dtiles/9-272-359/1/0/1.glb?fraction=0.25&extensions=octvertexnormals"}}};

const Operation kSubtreeOperation{
    .id = "getSubtree",
    .tag = "tiles",
    .summary = "The tiles of an implicit tree that exist, and their ranges of heights",
    .description = "The binary form of 3D Tiles 1.1. `tileset.json` states the number of levels.",
    .parameters = kGlbParameters,
    .replies = {{"application/octet-stream"}},
    .headers = DocumentHeaders(),
    .examples = {{"/jacksboro/3dtiles/9-272-359/0/0/0.5.subtree"},
                 {"/jacksboro/3dtiles/9-272-359/0/0/0.5.subtree?error=20&atleast=1&compression=draco&texture=none"},
                 {"/jacksboro/3dtiles/9-272-359/0/0/0.5.subtree?fraction=0.25&extensions=octvertexnormals"}}};

}  // namespace terrace::server
