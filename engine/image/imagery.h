// A georeferenced image of the ground, from which the textures of tiles are made. Immutable after Open and thread-safe.
// No GDAL type appears in this header.
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
#include "engine/gdal/file_stamp.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

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

// Where an image lies, and the deepest levels of its map tiles. They are the first levels whose pixels are as fine as
// those of the image, and at most geo::kMaxLevel.
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

  // Opens a georeferenced image with unsigned samples of 8 or 16 bits. Its bands are grey with or without alpha; a
  // palette; bands that state red, green and blue; or 3 or 4 bands that do not state them, of which the first three are
  // taken as red, green and blue. `around`: the bounds of the dataset (DemInfo::bounds). `path` is resolved at each
  // use. `content`: where hashes of large files are stored, and the token that stops Open. kNotFound: there is no such
  // file. kInvalidArgument, with the remedy: no raster that may be opened, no georeference, bands that are not colours,
  // or an image outside `around`. kChanged: a file was replaced meanwhile. kUnavailable: it cannot be read. kCancelled:
  // stopped.
  static Result<std::unique_ptr<Imagery>> Open(const std::string& path, const GeoBounds& around,
                                               const FileContentOptions& content = {});
  ~Imagery();

  // Returns the number of pixels along the edge of a level's tiles: `max_side`, halved as long as the result is at
  // least 256 and the pixels are as fine as those of the image. Depends only on image, level and `max_side`.
  // Precondition: `max_side` is a power of two from kMinSide to kMaxSide.
  int SideOf(int level, int max_side) const;

  // Returns the picture of a tile, `side` x `side` pixels; nothing if the image shows no part of the tile. A pixel is
  // interpolated bilinearly at its centre, between averages of image pixels if the image is finer. Uses overviews that
  // are fine enough, if they have the mask and the nodata values of the image. A pixel depends only on its level,
  // `side` and global position. Preconditions: a valid key; `side` is a power of two from kMinSide to kMaxSide.
  // kUnavailable: the image cannot be read now. kChanged: a file was replaced. kInvalidArgument: too many pixels of the
  // image are needed at once. kCancelled: stopped.
  Result<std::optional<TilePicture>> Read(const geo::TileKey& key, int side, std::stop_token stop = {}) const;

  // Pictures for maps with `side` x `side` pixels, by the rules of Read. ReadMercator: of a Web Mercator grid, from the
  // pixel in `column` and `row`. ReadGeodetic: of a tile in the scheme of terrain tiles. Transparent where the image
  // has no colour. Preconditions: a depth of 0 .. geo::kMaxLevel; the pixels lie in the grid; a valid key; `side` as
  // for Read. Errors: those of Read.
  Result<MapPicture> ReadMercator(int depth, std::int64_t column, std::int64_t row, int side,
                                  std::stop_token stop = {}) const;
  Result<MapPicture> ReadGeodetic(const geo::TileKey& key, int side, std::stop_token stop = {}) const;

  static constexpr int kMapSide = 256;  // the side that ImageExtent::max_geodetic_level is stated for
  ImageExtent extent() const;

  // A hash of the bytes of its files and of their georeference. Copies have the same hash.
  std::uint64_t fingerprint() const;

  // The files of the image with their stamps at Open.
  const StampedFiles& files() const;

 private:
  class Impl;
  explicit Imagery(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace terrace::dem
