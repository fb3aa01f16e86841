#include <utility>

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

const std::vector<ParameterNote> kHillshadeParameters = {kSizeNote, kAzimuthNote, kAltitudeNote, kZFactorNote};
const std::vector<ParameterNote> kSlopeParameters = {kSizeNote, kStyleNote};
const std::vector<ParameterNote> kContoursParameters = {kIntervalNote};
const std::vector<ParameterNote> kImageryParameters = {kSizeNote};
const std::vector<MediaNote> kPngReplies = {{"image/png"}};
const std::vector<MediaNote> kWebpReplies = {{"image/webp"}};
const std::vector<MediaNote> kJpegReplies = {{"image/jpeg"}};

constexpr std::string_view kMercatorTile = "EPSG:3857 in the XYZ scheme of web maps, y from the north.";
constexpr std::string_view kMercatorImage =
    "EPSG:3857 in the XYZ scheme of web maps, y from the north. 404 where the dataset has no imagery.";
constexpr std::string_view kGeodeticImage =
    "The terrain tile of this number: EPSG:4326, y from the south. 404 where the dataset has no imagery.";
constexpr std::string_view kTileJson = "Its URLs are absolute, made from the request's `Host`.";
constexpr std::string_view kImageTileJson =
    "Its URLs are absolute, made from the request's `Host`. 404 where the dataset has no imagery.";

Operation MapTile(std::string_view id, std::string_view summary, std::string_view description,
                  std::vector<ParameterNote> parameters, std::vector<MediaNote> replies,
                  std::vector<ExampleRequest> examples,
                  std::vector<std::string_view> headers = {"ETag", "Cache-Control"}) {
  return {.id = id,
          .tag = "maps",
          .summary = summary,
          .description = description,
          .parameters = std::move(parameters),
          .replies = std::move(replies),
          .headers = std::move(headers),
          .examples = std::move(examples)};
}

Operation MapTileJson(std::string_view id, std::string_view summary, std::string_view description,
                      std::vector<ParameterNote> parameters, std::vector<ExampleRequest> examples) {
  return MapTile(id, summary, description, std::move(parameters), {{"application/json", "MapTileJson"}},
                 std::move(examples), DocumentHeaders());
}

}  // namespace

const Operation kHillshadePngOperation =
    MapTile("getHillshadePng", "Shades of the relief as PNG", kMercatorTile, kHillshadeParameters, kPngReplies,
            {{"/jacksboro/hillshade/9/135/200.png"},
             {"/jacksboro/hillshade/9/135/200.png?azimuth=300&altitude=30&zfactor=2&size=512"}});
const Operation kHillshadeWebpOperation =
    MapTile("getHillshadeWebp", "Shades of the relief as WebP", kMercatorTile, kHillshadeParameters, kWebpReplies,
            {{"/jacksboro/hillshade/9/135/200.webp"},
             {"/jacksboro/hillshade/9/135/200.webp?azimuth=300&altitude=30&zfactor=2&size=512"}});
const Operation kHillshadeTileJsonOperation =
    MapTileJson("getHillshadeTileJson", "TileJSON 3.0 of the layer hillshade", kTileJson,
                {kSizeNote, kAzimuthNote, kAltitudeNote, kZFactorNote, kPictureNote},
                {{"/jacksboro/hillshade/tiles.json"},
                 {"/jacksboro/hillshade/tiles.json?azimuth=300&altitude=30&zfactor=2&size=512&format=webp"}});

const Operation kSlopePngOperation =
    MapTile("getSlopePng", "Slopes as PNG", kMercatorTile, kSlopeParameters, kPngReplies,
            {{"/jacksboro/slope/9/135/200.png"}, {"/jacksboro/slope/9/135/200.png?style=degrees&size=512"}});
const Operation kSlopeWebpOperation =
    MapTile("getSlopeWebp", "Slopes as WebP", kMercatorTile, kSlopeParameters, kWebpReplies,
            {{"/jacksboro/slope/9/135/200.webp"}, {"/jacksboro/slope/9/135/200.webp?style=degrees&size=512"}});
const Operation kSlopeTileJsonOperation =
    MapTileJson("getSlopeTileJson", "TileJSON 3.0 of the layer slope", kTileJson, {kSizeNote, kStyleNote, kPictureNote},
                {{"/jacksboro/slope/tiles.json"}, {"/jacksboro/slope/tiles.json?style=degrees&size=512&format=webp"}});

const Operation kContoursOperation = MapTile(
    "getContours", "Contour lines as a Mapbox Vector Tile", kMercatorTile, kContoursParameters,
    {{"application/vnd.mapbox-vector-tile"}},
    {{"/jacksboro/contours/9/135/200.mvt"}, {"/jacksboro/contours/9/135/200.mvt?interval=50"}}, DocumentHeaders());
const Operation kContoursTileJsonOperation =
    MapTileJson("getContoursTileJson", "TileJSON 3.0 of the layer contours", kTileJson, kContoursParameters,
                {{"/jacksboro/contours/tiles.json"}, {"/jacksboro/contours/tiles.json?interval=50"}});

const Operation kImageryWebpOperation =
    MapTile("getImageryWebp", "The imagery in Web Mercator as WebP", kMercatorImage, kImageryParameters, kWebpReplies,
            {{"/jacksboro/imagery/9/135/200.webp"}, {"/jacksboro/imagery/9/135/200.webp?size=512"}});
const Operation kImageryJpegOperation =
    MapTile("getImageryJpeg", "The imagery in Web Mercator as JPEG", kMercatorImage, kImageryParameters, kJpegReplies,
            {{"/jacksboro/imagery/9/135/200.jpg"}, {"/jacksboro/imagery/9/135/200.jpg?size=512"}});
const Operation kImageryTileJsonOperation =
    MapTileJson("getImageryTileJson", "TileJSON 3.0 of the layer imagery", kImageTileJson, {kSizeNote, kPictureNote},
                {{"/jacksboro/imagery/tiles.json"}, {"/jacksboro/imagery/tiles.json?size=512&format=jpg"}});
const Operation kGeodeticImageryWebpOperation = MapTile(
    "getGeodeticImageryWebp", "The imagery of a terrain tile as WebP", kGeodeticImage, kImageryParameters, kWebpReplies,
    {{"/jacksboro/imagery/geodetic/9/272/359.webp"}, {"/jacksboro/imagery/geodetic/9/272/359.webp?size=512"}});
const Operation kGeodeticImageryJpegOperation = MapTile(
    "getGeodeticImageryJpeg", "The imagery of a terrain tile as JPEG", kGeodeticImage, kImageryParameters, kJpegReplies,
    {{"/jacksboro/imagery/geodetic/9/272/359.jpg"}, {"/jacksboro/imagery/geodetic/9/272/359.jpg?size=512"}});

}  // namespace terrace::server
