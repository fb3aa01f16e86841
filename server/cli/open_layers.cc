#include "server/cli/open_layers.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>
#include <utility>

namespace terrace::cli {
namespace {

Result<tiler::WaterRules> OpenWater(const config::WaterConfig& wanted, const dem::GeoBounds& bounds) {
  tiler::WaterRules water;
  water.sea_level_m = wanted.sea_level;
  if (wanted.mask.empty()) return water;
  auto mask = dem::WaterRaster::Open(wanted.mask, bounds);
  if (!mask) {
    std::error_code unreadable;
    const bool exists = std::filesystem::exists(wanted.mask, unreadable);
    return MakeError(mask.error().code, "water mask {}{}", mask.error().message,
                     exists ? "" : ", or for a sea level a number of metres");
  }
  water.mask = *std::move(mask);
  return water;
}

proto::TextureFormat TextureOf(config::Texture texture) {
  switch (texture) {
    case config::Texture::kJpeg:
      return proto::TextureFormat::kJpeg;
    case config::Texture::kWebp:
      return proto::TextureFormat::kWebp;
    case config::Texture::kNone:
      break;
  }
  return proto::TextureFormat::kNone;
}

Result<tiler::ImageryRules> OpenImagery(const config::ImageryConfig& wanted, const dem::GeoBounds& bounds) {
  tiler::ImageryRules imagery;
  if (wanted.image.empty()) return imagery;
  auto image = dem::Imagery::Open(wanted.image, bounds);
  if (!image) return MakeError(image.error().code, "imagery {}", image.error().message);
  imagery.image = *std::move(image);
  imagery.texture = TextureOf(wanted.texture);
  imagery.side = wanted.size;
  imagery.quality = wanted.quality;
  imagery.attribution = wanted.attribution;
  return imagery;
}

}  // namespace

Result<void> OpenLayers(const config::DatasetConfig& wanted, tiler::Dataset& dataset) {
  const dem::GeoBounds& bounds = dataset.source->info().bounds;
  auto water = OpenWater(wanted.water, bounds);
  if (!water) return tl::unexpected(water.error());
  auto imagery = OpenImagery(wanted.imagery, bounds);
  if (!imagery) return tl::unexpected(imagery.error());
  dataset.water = *std::move(water);
  dataset.imagery = *std::move(imagery);
  dataset.metadata_levels = wanted.metadata_availability;
  return {};
}

std::string LayersFingerprint(const tiler::Dataset& dataset) {
  const tiler::WaterRules& water = dataset.water;
  const tiler::ImageryRules& imagery = dataset.imagery;
  return fmt::format("{} {} {} {} {} {} {} {}", water.mask ? water.mask->fingerprint() : 0,
                     water.sea_level_m ? fmt::format("{}", *water.sea_level_m) : "none", dataset.metadata_levels,
                     imagery.image ? imagery.image->fingerprint() : 0, imagery.side, imagery.quality,
                     imagery.attribution, dataset.attribution);
}

}  // namespace terrace::cli
