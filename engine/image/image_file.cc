#include "engine/image/image_file.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "engine/common/dem_types.h"
#include "engine/core/parse_number.h"
#include "engine/gdal/gdal_runtime.h"
#include "engine/gdal/raster_file.h"

namespace terrace::dem {
namespace {

// The value of a band's brightest pixels. Files may state that samples have fewer bits than their type.
std::uint32_t LargestLevel(GDALRasterBand& band) {
  const int all = band.GetRasterDataType() == GDT_Byte ? 8 : 16;
  const char* const stated = band.GetMetadataItem("NBITS", "IMAGE_STRUCTURE");
  const int bits = stated == nullptr ? all : ParseNumber<int>(stated).value_or(all);
  return (std::uint32_t{1} << (bits >= 1 && bits <= all ? bits : all)) - 1;
}

}  // namespace

Result<ImageFile> ImageFile::Open(const std::string& path, int overview) {
  auto dataset = OpenRaster(path, overview);
  if (!dataset) return tl::unexpected(dataset.error());
  ImageFile image(path, *std::move(dataset));
  if (auto found = image.FindBands(); !found) return tl::unexpected(found.error());
  image.FindMasks();
  return image;
}

Result<void> ImageFile::FindBands() {
  const int count = dataset_->GetRasterCount();
  GDALRasterBand* const first = dataset_->GetRasterBand(1);
  const bool has_alpha = dataset_->GetRasterBand(count)->GetColorInterpretation() == GCI_AlphaBand;
  if (const GDALDataType type = first->GetRasterDataType(); type != GDT_Byte && type != GDT_UInt16) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: samples are {}, colours must be unsigned, of 8 or 16 bits; convert with `gdal_translate -ot "
                     "Byte -scale in out.tif`",
                     path_, GDALGetDataTypeName(type));
  }
  if (count - (has_alpha ? 1 : 0) == 1) {
    bands_ = {first, first, first};
    const GDALColorTable* const table = first->GetColorTable();
    return table == nullptr ? Result<void>() : ReadPalette(*table);
  }
  for (int i = 1; i <= count; ++i) {
    GDALRasterBand* const band = dataset_->GetRasterBand(i);
    const int channel = band->GetColorInterpretation() - GCI_RedBand;  // red, green, blue follow each other
    if (channel >= 0 && channel < 3) bands_[static_cast<std::size_t>(channel)] = band;
  }
  if (std::find(bands_.begin(), bands_.end(), nullptr) == bands_.end()) return {};
  if (count != 3 && count != 4) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: has {} bands and does not say which are red, green and blue; choose them with "
                     "`gdal_translate -b 1 -b 2 -b 3 in out.tif`",
                     path_, count);
  }
  for (int i = 0; i < 3; ++i) {
    GDALRasterBand* const band = dataset_->GetRasterBand(i + 1);
    // The interpretations from hue on, such as cyan, are of other colour models.
    if (band->GetColorInterpretation() >= GCI_HueBand) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: band {} holds {}, colours must be red, green and blue; convert the image to RGB", path_,
                       i + 1, GDALGetColorInterpretationName(band->GetColorInterpretation()));
    }
    bands_[static_cast<std::size_t>(i)] = band;
  }
  return {};
}

Result<void> ImageFile::ReadPalette(const GDALColorTable& table) {
  if (table.GetPaletteInterpretation() != GPI_RGB) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: its palette holds no RGB colours; convert with `gdal_translate -expand rgb in out.tif`",
                     path_);
  }
  for (int i = 0; i < table.GetColorEntryCount(); ++i) {
    const GDALColorEntry* const entry = table.GetColorEntry(i);
    const auto level = [](short value) { return static_cast<std::uint8_t>(std::clamp<int>(value, 0, 255)); };
    palette_.push_back({level(entry->c1), level(entry->c2), level(entry->c3), level(entry->c4)});
  }
  return {};
}

// Files may declare 0 as nodata per band, but black is a colour: a pixel is missing only if all of its bands are. The
// alpha band counts beside these masks, because GDAL prefers a nodata value or a mask to it.
void ImageFile::FindMasks() {
  for (int i = 1; i <= dataset_->GetRasterCount(); ++i) {
    GDALRasterBand* const band = dataset_->GetRasterBand(i);
    if (alpha_ == nullptr && band->GetColorInterpretation() == GCI_AlphaBand) alpha_ = band;
  }
  for (GDALRasterBand* const band : bands_) {
    const int flags = band->GetMaskFlags();
    const bool has_only_alpha = alpha_ != nullptr && (flags & GMF_ALPHA) != 0;
    if ((flags & GMF_ALL_VALID) != 0 || has_only_alpha) {
      masks_.clear();
      return;
    }
    GDALRasterBand* const mask = band->GetMaskBand();
    if (std::find(masks_.begin(), masks_.end(), mask) == masks_.end()) masks_.push_back(mask);
  }
}

Result<void> ImageFile::Read(int col, int row, int cols, int rows, Rgba* out) {
  const std::size_t pixels = Area(cols, rows);
  levels_.resize(pixels);
  bool is_read = ReadMasks(col, row, cols, rows, out);
  const int channels = bands_[0] == bands_[1] ? 1 : 3;
  for (int i = 0; is_read && i < channels; ++i) is_read = ReadBand(i, col, row, cols, rows, out);
  if (!is_read) {
    return MakeError(ErrorCode::kUnavailable,
                     "{}: rows {}..{} cannot be read ({}); the file may be damaged: check it with gdalinfo -checksum",
                     path_, row, row + rows - 1, TakeGdalError());
  }
  return {};
}

// Reads into levels_, then copies to the pixels.
bool ImageFile::ReadBand(int i, int col, int row, int cols, int rows, Rgba* out) {
  GDALRasterBand& band = *bands_[static_cast<std::size_t>(i)];
  if (!ReadRaw(band, col, row, cols, rows, GDT_UInt16, levels_.data())) return false;
  if (!palette_.empty()) {
    for (std::size_t k = 0; k < levels_.size(); ++k) {
      const bool is_there = out[k][3] != 0 && levels_[k] < palette_.size();
      out[k] = is_there ? palette_[levels_[k]] : Rgba{};
      if (out[k][3] != 0) out[k][3] = 255;
    }
    return true;
  }
  const bool is_grey = bands_[0] == bands_[1];
  const std::uint32_t largest = LargestLevel(band);
  for (std::size_t k = 0; k < levels_.size(); ++k) {
    const auto level = static_cast<std::uint8_t>(std::min((levels_[k] * 255 + largest / 2) / largest, 255U));
    if (is_grey) {
      out[k] = {level, level, level, out[k][3]};
    } else {
      out[k][static_cast<std::size_t>(i)] = level;
    }
  }
  return true;
}

bool ImageFile::ReadMasks(int col, int row, int cols, int rows, Rgba* out) {
  const std::uint8_t without_masks = masks_.empty() ? 255 : 0;
  std::fill(out, out + levels_.size(), Rgba{0, 0, 0, without_masks});
  for (GDALRasterBand* const mask : masks_) {
    if (!ReadRaw(*mask, col, row, cols, rows, GDT_UInt16, levels_.data())) return false;
    for (std::size_t k = 0; k < levels_.size(); ++k) {
      if (levels_[k] != 0) out[k][3] = 255;
    }
  }
  if (alpha_ == nullptr) return true;
  if (!ReadRaw(*alpha_, col, row, cols, rows, GDT_UInt16, levels_.data())) return false;
  for (std::size_t k = 0; k < levels_.size(); ++k) {
    if (levels_[k] == 0) out[k][3] = 0;
  }
  return true;
}

}  // namespace terrace::dem
