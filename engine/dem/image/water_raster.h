// A raster that says where water is: a mask whose samples are not zero on water.
//
// WaterRaster is immutable after Open and safe to use from many threads. GDAL's types stay behind this header.
#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/dem_types.h"
#include "engine/dem/gdal/file_content.h"
#include "engine/dem/gdal/file_stamp.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

class WaterRaster {
 public:
  static constexpr int kSide = 256;  // pixels along a tile's edge

  // Band 1 of any raster that GDAL reads and that is georeferenced. kInvalidArgument, with the remedy: what OpenRaster
  // and Georeference refuse, and a raster that lies nowhere in `around`.
  static Result<std::unique_ptr<WaterRaster>> Open(const std::string& path, const GeoBounds& around,
                                                   const FileContentOptions& content = {});
  ~WaterRaster();

  // kSide x kSide pixels of a tile, row by row from the NORTH-western one: 0 land .. 255 water; in between, how much of
  // a pixel on the coast is water. Outside the raster, and where it has no data, is land.
  //
  // A pixel is a function of its level and global position alone. Where the raster is finer than the pixels, its
  // samples are averaged; where it is coarser, the coast is the line where half of the interpolated samples are water,
  // drawn as sharp as the pixels allow. Overviews are read where the raster has them: they should be made with
  // `gdaladdo -r nearest` or `-r mode`, as any sample but zero counts as water.
  //
  // Any valid key. kUnavailable: the raster cannot be read now. kCancelled: stopped.
  Result<std::vector<std::uint8_t>> Read(const geo::TileKey& key, std::stop_token stop = {}) const;

  // Identifies the content: the bytes of its files, and where they lie on the Earth. The same of every copy.
  std::uint64_t fingerprint() const;

  // What it is read from, as it was when it was opened.
  const StampedFiles& files() const;

 private:
  class Impl;
  explicit WaterRaster(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace terrace::dem
