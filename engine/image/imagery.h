// A georeferenced image of the ground, for the textures of tiles and for maps. Does not change after Open. Thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

class StampedFiles;  // engine/gdal/stamped_files.h, which is not installed

// Red, green, blue of every pixel, row by row from the NORTH-western one.
struct TilePicture {
  int side = 0;
  std::vector<std::uint8_t> rgb;  // 3 * side * side
};

// The same with alpha: 255 where the image has a colour. Elsewhere the pixel is black and alpha is 0.
struct MapPicture {
  int side = 0;
  std::vector<std::uint8_t> rgba;  // 4 * side * side
};

// Where an image lies, and the deepest levels of its map tiles: the first whose pixels are as fine as those of the
// image, at most geo::kMaxLevel.
struct ImageExtent {
  GeoBounds bounds;
  int max_mercator_depth = 1;  // depth d: a grid of 256 << d pixels around the Earth
  int max_geodetic_level = 0;  // of tiles of kMapSide pixels in the scheme of terrain tiles
};

class Imagery {
 public:
  static constexpr int kMinSide = 64, kMaxSide = 1024;
  // The colour of parts of a tile that the image does not show: a middle grey in sRGB.
  static constexpr std::array<std::uint8_t, 3> kNoPicture = {188, 188, 188};

  // Opens a georeferenced image with unsigned samples of 8 or 16 bits. The bands are one of:
  // - grey, with or without alpha
  // - a palette
  // - bands that state that they are red, green and blue
  // - 3 or 4 bands that do not; the first three are taken as red, green and blue, unless one states a colour of another
  //   model, such as cyan
  //
  // `path` is resolved at each use. `around`: the bounds of the dataset (DemInfo::bounds). kNotFound: there is no such
  // file. kInvalidArgument, with the remedy: no raster that may be opened, no georeference, other bands or samples, or
  // an image outside `around`. kChanged: a file was replaced meanwhile. kUnavailable: a file cannot be read.
  // kCancelled: `content.stop` was requested.
  static Result<std::unique_ptr<Imagery>> Open(const std::string& path, const GeoBounds& around,
                                               const FileContentOptions& content = {});
  ~Imagery();

  // Returns the number of pixels along the edge of a level's tiles. It is `max_side`, halved as long as the result is
  // at least 256 and the pixels are as fine as those of the image. Precondition: `max_side` is a power of two, kMinSide
  // .. kMaxSide.
  int SideOf(int level, int max_side) const;

  // Returns the picture of a tile, `side` x `side` pixels; nothing if the image shows no part of the tile. Pixels are
  // interpolated bilinearly at their centres. If the image is finer, they are interpolated between averages of its
  // pixels. A pixel depends only on its level, `side` and global position. Overviews are read if they are fine enough
  // and have the mask and the nodata values of the image. Preconditions: a valid key; `side` is a power of two,
  // kMinSide .. kMaxSide. kUnavailable: the image cannot be read now. kChanged: a file was replaced. kInvalidArgument:
  // too many pixels of the image are needed at once. kCancelled: `stop` was requested.
  Result<std::optional<TilePicture>> Read(const geo::TileKey& key, int side, std::stop_token stop = {}) const;

  // Pictures for maps, `side` x `side` pixels, by the rules of Read. Transparent where the image has no colour.
  // ReadMercator: from a Web Mercator grid of 256 << depth pixels around the Earth; `column` and `row` are those of the
  // north-western pixel. ReadGeodetic: of a tile in the scheme of terrain tiles. Preconditions: a depth of 0 ..
  // geo::kMaxLevel; pixels in the grid; a valid key; `side` as for Read. Errors: those of Read.
  Result<MapPicture> ReadMercator(int depth, std::int64_t column, std::int64_t row, int side,
                                  std::stop_token stop = {}) const;
  Result<MapPicture> ReadGeodetic(const geo::TileKey& key, int side, std::stop_token stop = {}) const;

  static constexpr int kMapSide = 256;  // the side that ImageExtent::max_geodetic_level is stated for
  ImageExtent extent() const;

  // A hash of the bytes and the georeference of its files. Copies have the same hash.
  std::uint64_t fingerprint() const;

  // The files of the image with their stamps at Open.
  const StampedFiles& files() const;

 private:
  class Impl;
  explicit Imagery(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace terrace::dem
