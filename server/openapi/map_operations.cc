#include "server/openapi/common_parameters.h"
#include "server/openapi/operations.h"

namespace terrace::server {
namespace {

constexpr ParameterNote kAzimuthNote{"azimuth", "Direction of the light: degrees from north, clockwise.",
                                     R"({"type":"integer","minimum":0,"maximum":360})"};
constexpr ParameterNote kAltitudeNote{"altitude", "Height of the light above the horizon in degrees.",
                                      R"({"type":"integer","minimum":0,"maximum":90})"};
constexpr ParameterNote kZFactorNote{"zfactor", "Factor of the heights.",
                                     R"({"type":"number","minimum":0.01,"maximum":100})"};
constexpr ParameterNote kStyleNote{"style", "`colors`, the default, or `degrees` as grey values.",
                                   R"({"type":"string","enum":["colors","degrees"]})"};
constexpr ParameterNote kIntervalNote{"interval", "Metres from line to line; by default that of the level.",
                                      R"({"type":"number","minimum":0.1,"maximum":10000})"};
constexpr ParameterNote kPictureNote{"format", "Form of the pictures that the template names.",
                                     R"({"type":"string","pattern":"^(png|webp|jpg)$"})"};

constexpr std::string_view kMapHeaders[] = {"ETag", "Cache-Control"};
constexpr MediaNote kMapTileJsonReplies[] = {{"application/json", "MapTileJson"}};
constexpr ParameterNote kHillshadeParameters[] = {kSizeNote, kAzimuthNote, kAltitudeNote, kZFactorNote};
constexpr ParameterNote kHillshadeJsonParameters[] = {kSizeNote, kAzimuthNote, kAltitudeNote, kZFactorNote,
                                                      kPictureNote};
constexpr ParameterNote kSlopeParameters[] = {kSizeNote, kStyleNote};
constexpr ParameterNote kSlopeJsonParameters[] = {kSizeNote, kStyleNote, kPictureNote};
constexpr ParameterNote kContoursParameters[] = {kIntervalNote};
constexpr ParameterNote kImageryParameters[] = {kSizeNote};
constexpr ParameterNote kImageryJsonParameters[] = {kSizeNote, kPictureNote};
constexpr MediaNote kPngReplies[] = {{"image/png"}};
constexpr MediaNote kWebpReplies[] = {{"image/webp"}};
constexpr MediaNote kJpegReplies[] = {{"image/jpeg"}};
constexpr MediaNote kMvtReplies[] = {{"application/vnd.mapbox-vector-tile"}};

constexpr ExampleRequest kHillshadePngExamples[] = {
    {"/jacksboro/hillshade/9/135/200.png"},
    {"/jacksboro/hillshade/9/135/200.png?azimuth=300&altitude=30&zfactor=2&size=512"}};
constexpr ExampleRequest kHillshadeWebpExamples[] = {
    {"/jacksboro/hillshade/9/135/200.webp"},
    {"/jacksboro/hillshade/9/135/200.webp?azimuth=300&altitude=30&zfactor=2&size=512"}};
constexpr ExampleRequest kHillshadeJsonExamples[] = {
    {"/jacksboro/hillshade/tiles.json"},
    {"/jacksboro/hillshade/tiles.json?azimuth=300&altitude=30&zfactor=2&size=512&format=webp"}};
constexpr ExampleRequest kSlopePngExamples[] = {{"/jacksboro/slope/9/135/200.png"},
                                                {"/jacksboro/slope/9/135/200.png?style=degrees&size=512"}};
constexpr ExampleRequest kSlopeWebpExamples[] = {{"/jacksboro/slope/9/135/200.webp"},
                                                 {"/jacksboro/slope/9/135/200.webp?style=degrees&size=512"}};
constexpr ExampleRequest kSlopeJsonExamples[] = {{"/jacksboro/slope/tiles.json"},
                                                 {"/jacksboro/slope/tiles.json?style=degrees&size=512&format=webp"}};
constexpr ExampleRequest kContoursExamples[] = {{"/jacksboro/contours/9/135/200.mvt"},
                                                {"/jacksboro/contours/9/135/200.mvt?interval=50"}};
constexpr ExampleRequest kContoursJsonExamples[] = {{"/jacksboro/contours/tiles.json"},
                                                    {"/jacksboro/contours/tiles.json?interval=50"}};
constexpr ExampleRequest kImageryWebpExamples[] = {{"/jacksboro/imagery/9/135/200.webp"},
                                                   {"/jacksboro/imagery/9/135/200.webp?size=512"}};
constexpr ExampleRequest kImageryJpegExamples[] = {{"/jacksboro/imagery/9/135/200.jpg"},
                                                   {"/jacksboro/imagery/9/135/200.jpg?size=512"}};
constexpr ExampleRequest kImageryJsonExamples[] = {{"/jacksboro/imagery/tiles.json"},
                                                   {"/jacksboro/imagery/tiles.json?size=512&format=jpg"}};
constexpr ExampleRequest kGeodeticImageryWebpExamples[] = {{"/jacksboro/imagery/geodetic/9/272/359.webp"},
                                                           {"/jacksboro/imagery/geodetic/9/272/359.webp?size=512"}};
constexpr ExampleRequest kGeodeticImageryJpegExamples[] = {{"/jacksboro/imagery/geodetic/9/272/359.jpg"},
                                                           {"/jacksboro/imagery/geodetic/9/272/359.jpg?size=512"}};

}  // namespace

const Operation kHillshadePngOperation{.id = "getHillshadePng",
                                       .tag = "maps",
                                       .summary = "Shades of the relief as PNG",
                                       .description = "EPSG:3857 in the XYZ scheme of web maps, y from the north.",
                                       .parameters = kHillshadeParameters,
                                       .replies = kPngReplies,
                                       .headers = kMapHeaders,
                                       .examples = kHillshadePngExamples};

const Operation kHillshadeWebpOperation{.id = "getHillshadeWebp",
                                        .tag = "maps",
                                        .summary = "Shades of the relief as WebP",
                                        .description = "EPSG:3857 in the XYZ scheme of web maps, y from the north.",
                                        .parameters = kHillshadeParameters,
                                        .replies = kWebpReplies,
                                        .headers = kMapHeaders,
                                        .examples = kHillshadeWebpExamples};

const Operation kHillshadeTileJsonOperation{.id = "getHillshadeTileJson",
                                            .tag = "maps",
                                            .summary = "TileJSON 3.0 of the layer hillshade",
                                            .description = "Its URLs are absolute, made from the request's `Host`.",
                                            .parameters = kHillshadeJsonParameters,
                                            .replies = kMapTileJsonReplies,
                                            .headers = kDocumentHeaders,
                                            .examples = kHillshadeJsonExamples};

const Operation kSlopePngOperation{.id = "getSlopePng",
                                   .tag = "maps",
                                   .summary = "Slopes as PNG",
                                   .description = "EPSG:3857 in the XYZ scheme of web maps, y from the north.",
                                   .parameters = kSlopeParameters,
                                   .replies = kPngReplies,
                                   .headers = kMapHeaders,
                                   .examples = kSlopePngExamples};

const Operation kSlopeWebpOperation{.id = "getSlopeWebp",
                                    .tag = "maps",
                                    .summary = "Slopes as WebP",
                                    .description = "EPSG:3857 in the XYZ scheme of web maps, y from the north.",
                                    .parameters = kSlopeParameters,
                                    .replies = kWebpReplies,
                                    .headers = kMapHeaders,
                                    .examples = kSlopeWebpExamples};

const Operation kSlopeTileJsonOperation{.id = "getSlopeTileJson",
                                        .tag = "maps",
                                        .summary = "TileJSON 3.0 of the layer slope",
                                        .description = "Its URLs are absolute, made from the request's `Host`.",
                                        .parameters = kSlopeJsonParameters,
                                        .replies = kMapTileJsonReplies,
                                        .headers = kDocumentHeaders,
                                        .examples = kSlopeJsonExamples};

const Operation kContoursOperation{.id = "getContours",
                                   .tag = "maps",
                                   .summary = "Contour lines as a Mapbox Vector Tile",
                                   .description = "EPSG:3857 in the XYZ scheme of web maps, y from the north.",
                                   .parameters = kContoursParameters,
                                   .replies = kMvtReplies,
                                   .headers = kMapHeaders,
                                   .examples = kContoursExamples};

const Operation kContoursTileJsonOperation{.id = "getContoursTileJson",
                                           .tag = "maps",
                                           .summary = "TileJSON 3.0 of the layer contours",
                                           .description = "Its URLs are absolute, made from the request's `Host`.",
                                           .parameters = kContoursParameters,
                                           .replies = kMapTileJsonReplies,
                                           .headers = kDocumentHeaders,
                                           .examples = kContoursJsonExamples};

const Operation kImageryWebpOperation{
    .id = "getImageryWebp",
    .tag = "maps",
    .summary = "The imagery in Web Mercator as WebP",
    .description = "EPSG:3857 in the XYZ scheme of web maps, y from the north. 404 where the dataset has no imagery.",
    .parameters = kImageryParameters,
    .replies = kWebpReplies,
    .headers = kMapHeaders,
    .examples = kImageryWebpExamples};

const Operation kImageryJpegOperation{
    .id = "getImageryJpeg",
    .tag = "maps",
    .summary = "The imagery in Web Mercator as JPEG",
    .description = "EPSG:3857 in the XYZ scheme of web maps, y from the north. 404 where the dataset has no imagery.",
    .parameters = kImageryParameters,
    .replies = kJpegReplies,
    .headers = kMapHeaders,
    .examples = kImageryJpegExamples};

const Operation kImageryTileJsonOperation{
    .id = "getImageryTileJson",
    .tag = "maps",
    .summary = "TileJSON 3.0 of the layer imagery",
    .description = "Its URLs are absolute, made from the request's `Host`. 404 where the dataset has no imagery.",
    .parameters = kImageryJsonParameters,
    .replies = kMapTileJsonReplies,
    .headers = kDocumentHeaders,
    .examples = kImageryJsonExamples};

const Operation kGeodeticImageryWebpOperation{
    .id = "getGeodeticImageryWebp",
    .tag = "maps",
    .summary = "The imagery of a terrain tile as WebP",
    .description =
        "The terrain tile of this number: EPSG:4326, y from the south. 404 where the dataset has no imagery.",
    .parameters = kImageryParameters,
    .replies = kWebpReplies,
    .headers = kMapHeaders,
    .examples = kGeodeticImageryWebpExamples};

const Operation kGeodeticImageryJpegOperation{
    .id = "getGeodeticImageryJpeg",
    .tag = "maps",
    .summary = "The imagery of a terrain tile as JPEG",
    .description =
        "The terrain tile of this number: EPSG:4326, y from the south. 404 where the dataset has no imagery.",
    .parameters = kImageryParameters,
    .replies = kJpegReplies,
    .headers = kMapHeaders,
    .examples = kGeodeticImageryJpegExamples};

}  // namespace terrace::server
