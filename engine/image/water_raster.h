// A water mask: a raster whose samples are not zero on water. Does not change after Open. Thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

class StampedFiles;  // engine/gdal/stamped_files.h, which is not installed

class WaterRaster {
 public:
  static constexpr int kSide = 256;  // pixels along a tile's edge

  // Opens band 1 of a georeferenced raster. Parameters and errors: those of Imagery::Open, except that any number of
  // bands is accepted, and any type of samples but complex numbers.
  static Result<std::unique_ptr<WaterRaster>> Open(const std::string& path, const GeoBounds& around,
                                                   const FileContentOptions& content = {});
  ~WaterRaster();

  // Returns kSide x kSide pixels of a tile, row by row from the NORTH-western one: 0 is land, 255 is water, and a value
  // in between is the share of water in a pixel on the coast. Pixels outside the raster or without data are land. A
  // pixel depends only on its level and global position.
  //
  // A sample counts as 1 (water) if it is not zero, else as 0. If the raster is finer than the pixels, these values are
  // averaged. If it is coarser, these values are interpolated. The coast is the line where the result is one half, and
  // is as sharp as the pixels allow. Overviews are read if they have the mask of the raster. Make them with the method
  // nearest or mode of gdaladdo: other methods make samples along the coast that are not zero, and would count as
  // water.
  //
  // Precondition: a valid key. kUnavailable: the raster cannot be read now. kChanged: a file was replaced. kCancelled:
  // `stop` was requested.
  Result<std::vector<std::uint8_t>> Read(const geo::TileKey& key, std::stop_token stop = {}) const;

  // A hash of the bytes and the georeference of its files. Copies have the same hash.
  std::uint64_t fingerprint() const;

  // The files of the raster with their stamps at Open.
  const StampedFiles& files() const;

 private:
  class Impl;
  explicit WaterRaster(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace terrace::dem
