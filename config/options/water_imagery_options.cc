#include <cmath>

#include "config/options/option_table.h"
#include "proto/gltf/gltf_names.h"

namespace terrace::config {
namespace {

// As a flag: a number is a sea level, everything else the path of a mask.
Json WaterToJson(const std::string& text) {
  Json number = NumberToJson(text);
  if (number.is_number()) return Json{{"sea_level", std::move(number)}};
  return Json{{"mask", text}};
}

void ReadWater(const Json& value, const ConfigLocation& place, DatasetConfig& dataset) {
  const std::size_t keys = value.is_object() ? value.size() : 0;
  if (keys != 1 || !(value.contains("mask") || value.contains("sea_level"))) {
    return place.Expected(R"({"mask": "water.tif"} or {"sea_level": 0}, exactly one of them)");
  }
  if (value.contains("sea_level")) {
    const Json& level = value["sea_level"];
    const double metres = level.is_number() ? level.get<double>() : std::nan("");
    if (!(std::abs(metres) <= kMaxHeight)) {
      return place.At("sea_level").Expected(fmt::format("a number from {} to {}", -kMaxHeight, kMaxHeight));
    }
    dataset.water = {"", metres};
    return;
  }
  const Json& mask = value["mask"];
  if (!mask.is_string() || mask.get_ref<const std::string&>().empty()) {
    return place.At("mask").Expected("the path of a raster");
  }
  dataset.water = {place.Resolve(mask.get<std::string>()), std::nullopt};
}

Json WriteWater(const DatasetConfig& dataset) {
  if (dataset.water.sea_level) return Json{{"sea_level", NumberOut(*dataset.water.sea_level)}};
  return dataset.water.mask.empty() ? Json() : Json{{"mask", dataset.water.mask}};
}

constexpr const char* kWaterSchema = R"({
  "type": "object", "additionalProperties": false, "minProperties": 1, "maxProperties": 1,
  "properties": {"mask": {"type": "string", "minLength": 1}, "sea_level": {"type": "number"}},
  "examples": [{"sea_level": 0}, {"mask": "water.tif"}]
})";

Json WaterSchema() {
  Json schema = Json::parse(kWaterSchema);
  schema["properties"]["sea_level"] = InRange("number", NumberOut(-kMaxHeight), NumberOut(kMaxHeight));
  return schema;
}

}  // namespace

const std::vector<Option<ImageryConfig>>& ImageryOptionTable() {
  static const std::vector<Option<ImageryConfig>> table = {
      {.key = "image",
       .value = "FILE",
       .help = "Georeferenced image that GDAL can read: grey, RGB or a palette",
       .codec = Path(&ImageryConfig::image, "the path of an image"),
       .missing = ": the path of an image"},
      {.key = "attribution",
       .value = "TEXT",
       .help = "Attribution of the image, for maps and in textured tiles",
       .details = "One line of text or HTML, as of a dataset. In these tiles it follows the dataset's attribution in "
                  "`asset.copyright`; CesiumJS can show it",
       .codec = OneLine(&ImageryConfig::attribution)},
      {.key = "texture",
       .value = "FORMAT",
       .help = "Format of textures whose requests do not name one: jpeg, webp or none",
       .details = "`webp` is smaller; not every client reads it",
       .codec = Choice(&ImageryConfig::texture, proto::kTextureFormatNames)},
      {.key = "size",
       .value = "PIXELS",
       .help = "Largest number of pixels along the edge of a tile",
       .details = "At levels finer than the image, textures have fewer pixels, down to 256",
       .codec = Choice(&ImageryConfig::size,
                       {{Json(64), 64}, {Json(128), 128}, {Json(256), 256}, {Json(512), 512}, {Json(1024), 1024}})},
      {.key = "quality",
       .value = "N",
       .help = "Quality of textures and imagery tiles: 1 is smallest, 100 best",
       .codec = Integer(&ImageryConfig::quality, 1, 100)},
  };
  return table;
}

Codec<DatasetConfig> WaterCodec() { return {ReadWater, WriteWater, WaterToJson, WaterSchema()}; }

Codec<DatasetConfig> ImageryCodec() {
  return ObjectOf(&DatasetConfig::imagery, &ImageryConfig::image, ImageryOptionTable(), R"({"image": "photo.tif"})");
}

}  // namespace terrace::config
