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

constexpr std::string_view kMercatorTile = "EPSG:3857 in the XYZ scheme of web maps, y from the north.";
constexpr std::string_view kMercatorImage =
    "EPSG:3857 in the XYZ scheme of web maps, y from the north. 404 where the dataset has no imagery.";
constexpr std::string_view kGeodeticImage =
    "The terrain tile of this number: EPSG:4326, y from the south. 404 where the dataset has no imagery.";
constexpr std::string_view kTileJson = "Its URLs are absolute, made from the request's `Host`.";
constexpr std::string_view kImageTileJson =
    "Its URLs are absolute, made from the request's `Host`. 404 where the dataset has no imagery.";

constexpr Operation MapTile(std::string_view id, std::string_view summary, std::string_view description,
                            std::span<const ParameterNote> parameters, std::span<const MediaNote> replies,
                            std::span<const ExampleRequest> examples) {
  return {.id = id,
          .tag = "maps",
          .summary = summary,
          .description = description,
          .parameters = parameters,
          .replies = replies,
          .headers = kMapHeaders,
          .examples = examples};
}

constexpr Operation MapTileJson(std::string_view id, std::string_view summary, std::string_view description,
                                std::span<const ParameterNote> parameters, std::span<const ExampleRequest> examples) {
  Operation operation = MapTile(id, summary, description, parameters, kMapTileJsonReplies, examples);
  operation.headers = kDocumentHeaders;
  return operation;
}

}  // namespace

const Operation kHillshadePngOperation = MapTile("getHillshadePng", "Shades of the relief as PNG", kMercatorTile,
                                                 kHillshadeParameters, kPngReplies, kHillshadePngExamples);
const Operation kHillshadeWebpOperation = MapTile("getHillshadeWebp", "Shades of the relief as WebP", kMercatorTile,
                                                  kHillshadeParameters, kWebpReplies, kHillshadeWebpExamples);
const Operation kHillshadeTileJsonOperation = MapTileJson("getHillshadeTileJson", "TileJSON 3.0 of the layer hillshade",
                                                          kTileJson, kHillshadeJsonParameters, kHillshadeJsonExamples);

const Operation kSlopePngOperation =
    MapTile("getSlopePng", "Slopes as PNG", kMercatorTile, kSlopeParameters, kPngReplies, kSlopePngExamples);
const Operation kSlopeWebpOperation =
    MapTile("getSlopeWebp", "Slopes as WebP", kMercatorTile, kSlopeParameters, kWebpReplies, kSlopeWebpExamples);
const Operation kSlopeTileJsonOperation = MapTileJson("getSlopeTileJson", "TileJSON 3.0 of the layer slope", kTileJson,
                                                      kSlopeJsonParameters, kSlopeJsonExamples);

const Operation kContoursOperation = MapTile("getContours", "Contour lines as a Mapbox Vector Tile", kMercatorTile,
                                             kContoursParameters, kMvtReplies, kContoursExamples);
const Operation kContoursTileJsonOperation = MapTileJson("getContoursTileJson", "TileJSON 3.0 of the layer contours",
                                                         kTileJson, kContoursParameters, kContoursJsonExamples);

const Operation kImageryWebpOperation = MapTile("getImageryWebp", "The imagery in Web Mercator as WebP", kMercatorImage,
                                                kImageryParameters, kWebpReplies, kImageryWebpExamples);
const Operation kImageryJpegOperation = MapTile("getImageryJpeg", "The imagery in Web Mercator as JPEG", kMercatorImage,
                                                kImageryParameters, kJpegReplies, kImageryJpegExamples);
const Operation kImageryTileJsonOperation = MapTileJson("getImageryTileJson", "TileJSON 3.0 of the layer imagery",
                                                        kImageTileJson, kImageryJsonParameters, kImageryJsonExamples);
const Operation kGeodeticImageryWebpOperation =
    MapTile("getGeodeticImageryWebp", "The imagery of a terrain tile as WebP", kGeodeticImage, kImageryParameters,
            kWebpReplies, kGeodeticImageryWebpExamples);
const Operation kGeodeticImageryJpegOperation =
    MapTile("getGeodeticImageryJpeg", "The imagery of a terrain tile as JPEG", kGeodeticImage, kImageryParameters,
            kJpegReplies, kGeodeticImageryJpegExamples);

}  // namespace terrace::server
