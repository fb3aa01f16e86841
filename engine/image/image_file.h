// An image file, read as red, green, blue and alpha whatever its bands are.
#pragma once

#include <gdal_priv.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/image/raster_colors.h"

namespace terrace::dem {

// Not thread-safe: a GDAL dataset belongs to one thread at a time.
class ImageFile {
 public:
  // Errors, with the remedy: those of OpenRaster, and bands that are not colours. `overview`: number of an overview to
  // open instead of the full image; -1: the full image.
  static Result<ImageFile> Open(const std::string& path, int overview = -1);

  const std::string& path() const { return path_; }
  GDALDataset& dataset() const { return *dataset_; }
  // Of red, green and blue; a band of greys or of a palette is all three.
  const std::array<GDALRasterBand*, 3>& bands() const { return bands_; }
  int width() const { return dataset_->GetRasterXSize(); }
  int height() const { return dataset_->GetRasterYSize(); }

  // Reads a window of the image, row by row, into `out`. kUnavailable: it cannot be read.
  Result<void> Read(int col, int row, int cols, int rows, Rgba* out);

 private:
  ImageFile(std::string path, GDALDatasetUniquePtr dataset) : path_(std::move(path)), dataset_(std::move(dataset)) {}

  Result<void> FindBands();
  Result<void> ReadPalette(const GDALColorTable& table);
  void FindMasks();
  bool ReadBand(int i, int col, int row, int cols, int rows, Rgba* out);
  bool ReadMasks(int col, int row, int cols, int rows, Rgba* out);

  std::string path_;
  GDALDatasetUniquePtr dataset_;
  std::array<GDALRasterBand*, 3> bands_{};  // three equal pointers: grey or palette
  std::vector<Rgba> palette_;               // by index; empty: no palette
  std::vector<GDALRasterBand*> masks_;      // a pixel is valid if one of them says so; empty: all are valid
  GDALRasterBand* alpha_ = nullptr;         // a valid pixel is hidden where it is 0; null: none is hidden
  std::vector<std::uint16_t> levels_;       // of one band and window
};

}  // namespace terrace::dem
