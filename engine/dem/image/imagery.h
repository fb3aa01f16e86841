// A picture of the ground, cut to tiles: what textures are made from.
//
// Imagery is immutable after Open and safe to use from many threads. GDAL's types stay behind this header.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/dem_types.h"
#include "engine/dem/gdal/file_content.h"
#include "engine/dem/gdal/file_stamp.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

// Red, green, blue of every pixel, row by row from the NORTH-western one.
struct TilePicture {
  int side = 0;
  std::vector<std::uint8_t> rgb;  // 3 * side * side
};

class Imagery {
 public:
  static constexpr int kMinSide = 64, kMaxSide = 1024;
  // Where there is no picture of a part of a tile: a middle grey, as sRGB has it.
  static constexpr std::array<std::uint8_t, 3> kNoPicture = {188, 188, 188};

  // What raster_colors.h reads, with a georeference. kInvalidArgument, with the remedy: what OpenRaster and
  // Georeference refuse, bands that are no colours, and an image that lies nowhere in `around`.
  static Result<std::unique_ptr<Imagery>> Open(const std::string& path, const GeoBounds& around,
                                               const FileContentOptions& content = {});
  ~Imagery();

  // Pixels along the edge of a level's tiles: `most`, or half of it again and again, down to 256, as long as that is
  // still as fine as the image. A function of image and level alone. Precondition: a power of two from kMinSide to
  // kMaxSide.
  int SideOf(int level, int most) const;

  // The picture of a tile, `side` x `side` pixels; nothing where the image shows no part of it. A pixel is the image at
  // the pixel's centre, interpolated bilinearly; where the image is finer, between averages of its pixels. Overviews
  // are used where they are fine enough. A pixel is a function of its level, `side` and global position alone.
  // Preconditions: a valid key; side as above. kUnavailable: the image cannot be read now. kCancelled: stopped.
  Result<std::optional<TilePicture>> Read(const geo::TileKey& key, int side, std::stop_token stop = {}) const;

  // Identifies the content: the bytes of its files, and where they lie on the Earth. The same of every copy.
  std::uint64_t fingerprint() const;

  // What it is read from, as it was when it was opened.
  const StampedFiles& files() const;

 private:
  class Impl;
  explicit Imagery(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace terrace::dem
