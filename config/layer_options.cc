#include "config/layer_options.h"

#include <cmath>

#include "config/option_table.h"

namespace terrace::config {
namespace {

// As a flag: a number is a sea level, everything else the path of a mask.
Json WaterToJson(const std::string& text) {
  Json number = NumberToJson(text);
  if (number.is_number()) return Json{{"sea_level", std::move(number)}};
  return Json{{"mask", text}};
}

void ReadWater(const Json& value, const Place& place, DatasetConfig& dataset) {
  const std::size_t keys = value.is_object() ? value.size() : 0;
  if (keys != 1 || !(value.contains("mask") || value.contains("sea_level"))) {
    return place.Expected(R"({"mask": "water.tif"} or {"sea_level": 0}, one of both)");
  }
  if (value.contains("sea_level")) {
    const Json& level = value["sea_level"];
    const double metres = level.is_number() ? level.get<double>() : std::nan("");
    if (!(std::abs(metres) <= kMostHeight)) {
      return place.At("sea_level").Expected(fmt::format("a number from {} to {}", -kMostHeight, kMostHeight));
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

Codec<ImageryConfig> ImageryImage() {
  return {[](const Json& value, const Place& place, ImageryConfig& imagery) {
            if (!value.is_string() || value.get_ref<const std::string&>().empty()) {
              return place.Expected("the path of an image");
            }
            imagery.image = place.Resolve(value.get<std::string>());
          },
          [](const ImageryConfig& imagery) { return Json(imagery.image); }, TextToJson};
}

const std::vector<Option<ImageryConfig>>& ImageryOptionTable() {
  static const std::vector<Option<ImageryConfig>> table = {
      {"image", "FILE", "The image", ImageryImage()},
      {"attribution", "TEXT", "Who to thank for it", Text(&ImageryConfig::attribution, CheckOneLine)},
      {"texture", "FORMAT", "jpeg, webp or none",
       Choice(&ImageryConfig::texture, {{"jpeg", proto::TextureFormat::kJpeg},
                                        {"webp", proto::TextureFormat::kWebp},
                                        {"none", proto::TextureFormat::kNone}})},
      {"size", "PIXELS", "Pixels along the edge of a tile",
       Choice(&ImageryConfig::size,
              {{Json(64), 64}, {Json(128), 128}, {Json(256), 256}, {Json(512), 512}, {Json(1024), 1024}})},
      {"quality", "N", "1 smallest .. 100 best", Integer(&ImageryConfig::quality, 1, 100)},
  };
  return table;
}

}  // namespace

Codec<DatasetConfig> WaterCodec() { return {ReadWater, WriteWater, WaterToJson}; }

Codec<DatasetConfig> ImageryCodec() {
  return {[](const Json& value, const Place& place, DatasetConfig& dataset) {
            if (!value.is_object()) return place.Expected(R"({"image": "photo.tif"})");
            ReadObject(value, place, ImageryOptionTable(), dataset.imagery);
            if (!value.contains("image")) place.Fail("\"image\" is missing: the path of an image");
          },
          [](const DatasetConfig& dataset) {
            return dataset.imagery.image.empty() ? Json() : WriteObject(dataset.imagery, ImageryOptionTable());
          },
          [](const std::string& text) {
            return Json{{"image", text}};
          }};
}

}  // namespace terrace::config
