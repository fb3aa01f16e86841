// Parameters and headers that several operations have.
#pragma once

#include <string_view>
#include <vector>

#include "server/openapi/operation.h"

namespace terrace::server {

inline constexpr std::string_view kPositiveNumber = R"({"type":"number","exclusiveMinimum":0})";
inline constexpr std::string_view kFlag = R"({"type":"string","enum":["0","1"]})";
inline constexpr std::string_view kCompressions = R"({"type":"string","enum":["draco","none","quantized","meshopt"]})";

inline constexpr ParameterNote kErrorNote{"error", "The requested geometric error in metres. Excludes `fraction`.",
                                          kPositiveNumber};
inline constexpr ParameterNote kFractionNote{
    "fraction", "The error as a fraction of the level error that clients assume, 77,067 m / 2^z. Excludes `error`.",
    kPositiveNumber};
inline constexpr ParameterNote kAtLeastNote{"atleast",
                                            "With `error`. `1`: the larger of `error` and the level's default; from "
                                            "the sources' deepest level on `error` itself.",
                                            kFlag};
inline constexpr ParameterNote kCompressionNote{
    "compression", "Form of the GLB; by default the dataset's `glb_compression`.", kCompressions};
inline constexpr ParameterNote kTextureNote{
    "texture", "How the imagery of a GLB is written; no effect where the dataset has none.",
    R"({"type":"string","enum":["jpeg","webp","none"]})"};
inline constexpr ParameterNote kEncodingNote{
    "encoding",
    "`mapbox`, the default: height = -10000 + (R * 65536 + G * 256 + B) * 0.1 metres. `terrarium`: R * 256 + G + "
    "B / 256 - 32768 metres.",
    R"({"type":"string","enum":["mapbox","terrarium"]})"};
inline constexpr ParameterNote kSizeNote{"size", "Pixels along an edge; 256 is the default.",
                                         R"({"type":"integer","enum":[256,512]})"};
inline constexpr ParameterNote kSurfaceNote{
    "surface",
    "`source`: the sources; the default, except of `/grid` and `/sight` of an archive alone. `served`: the mesh that "
    "clients decode.",
    R"({"type":"string","enum":["source","served"]})"};
inline constexpr ParameterNote kSurfaceLevelNote{
    "level",
    "With `surface=served`: the level of the tiles. Without it: the first level whose default error is at most "
    "`error`, or the deepest.",
    R"({"type":"integer","minimum":0})"};
inline constexpr ParameterNote kSurfaceFormatNote{"format",
                                                  "With `surface=served`: the format of the tile; `terrain` is the "
                                                  "default.",
                                                  R"({"type":"string","enum":["terrain","glb"]})"};
inline constexpr ParameterNote kDatumNote{
    "datum",
    "The vertical datum of the heights. `ellipsoid`, the default: the WGS 84 ellipsoid. `orthometric`: the source's "
    "geoid, or EGM96 if the source refers to the ellipsoid. 400 if the source's datum is unknown.",
    R"({"type":"string","enum":["ellipsoid","orthometric"]})"};

inline std::vector<std::string_view> DocumentHeaders() { return {"ETag", "Cache-Control", "Vary"}; }

}  // namespace terrace::server
