#include "server/openapi/common_parameters.h"
#include "server/openapi/operations.h"

namespace terrace::server {
namespace {

constexpr ParameterNote kIgnoredExtensionsNote{"extensions",
                                               "Accepted and ignored: clients append it. May be repeated. Other words "
                                               "than the known extensions make the reply private.",
                                               R"({"type":"string"})"};

}  // namespace

const Operation kDatasetsOperation{.id = "getDatasets",
                                   .tag = "documents",
                                   .summary = "All datasets that the client may see",
                                   .description =
                                       "Name, version, bounds, levels and URLs of each dataset. While the server "
                                       "prepares others, `preparing` says how far; their URLs answer 503.",
                                   .replies = {{"application/json", "Datasets"}},
                                   .headers = DocumentHeaders(),
                                   .examples = {{"/datasets"}}};

const Operation kLayerOperation{.id = "getLayer",
                                .tag = "documents",
                                .summary = "What CesiumJS and other quantized-mesh clients start from",
                                .description = "The tile template contains the requested error and the version.",
                                .parameters = {kErrorNote, kFractionNote, kIgnoredExtensionsNote},
                                .replies = {{"application/json", "Layer"}},
                                .headers = DocumentHeaders(),
                                .examples = {{"/jacksboro/layer.json"},
                                             {"/jacksboro/layer.json?error=5"},
                                             {"/jacksboro/layer.json?fraction=0.25&extensions=octvertexnormals"}}};

const Operation kTilesetOperation{
    .id = "getTileset",
    .tag = "documents",
    .summary = "The terrain as 3D Tiles 1.1",
    .description =
        "The URLs of tiles and subtrees contain the requested error, the form and the version. The parameters may be "
        "repeated with the same value.",
    .parameters = {kErrorNote, kFractionNote, kCompressionNote, kTextureNote, kIgnoredExtensionsNote},
    .replies = {{"application/json", "Tileset"}},
    .headers = DocumentHeaders(),
    .examples = {{"/jacksboro/tileset.json"},
                 {"/jacksboro/tileset.json?error=50&compression=meshopt&texture=none"},
                 {"/jacksboro/tileset.json?fraction=0.25&extensions=octvertexnormals"},
                 {"/earth/tileset.json"}}};

const Operation kTileJsonOperation{
    .id = "getTileJson",
    .tag = "documents",
    .summary = "TileJSON 3.0 of the height tiles",
    .description =
        "What the `url` of a `raster-dem` source names. Its URLs are absolute, made from the request's `Host`. Of a "
        "dataset without sources, it has the levels and bounds of the archive.",
    .parameters = {kEncodingNote, kSizeNote},
    .replies = {{"application/json", "TileJson"}},
    .headers = DocumentHeaders(),
    .examples = {{"/jacksboro/tiles.json"}, {"/jacksboro/tiles.json?encoding=terrarium&size=512"}}};

const Operation kEditsOperation{.id = "getEdits",
                                .tag = "documents",
                                .summary = "Outlines of the dataset's edits",
                                .description = "GeoJSON in the order of the edits. 404 where the dataset has none.",
                                .replies = {{"application/geo+json", "EditOutlines"}},
                                .headers = DocumentHeaders(),
                                .examples = {{"/jacksboro/edits.geojson"}}};

const Operation kOpenApiOperation{.id = "getOpenApi",
                                  .tag = "documents",
                                  .summary = "This document",
                                  .description = "OpenAPI 3.1, generated from the server's table of URLs.",
                                  .replies = {{"application/json", "OpenApi"}},
                                  .headers = DocumentHeaders(),
                                  .examples = {{"/openapi.json"}}};

const Operation kViewerOperation{.id = "getViewer",
                                 .tag = "viewer",
                                 .summary = "The viewer; if none is installed, a list of datasets",
                                 .description = "Any query is accepted: it is the state of the page.",
                                 .replies = {{"text/html; charset=utf-8"}},
                                 .headers = DocumentHeaders(),
                                 .examples = {{"/"}}};

const Operation kViewerFileOperation{.id = "getViewerFile",
                                     .tag = "viewer",
                                     .summary = "A file of the viewer",
                                     .description = "The path may have several segments. Any query is accepted.",
                                     .replies = {{"*/*"}},  // by the suffix of the file
                                     .headers = DocumentHeaders(),
                                     .examples = {{"/viewer/style.css"}, {"/viewer/main.js"}}};

}  // namespace terrace::server
