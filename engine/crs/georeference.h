// The position of a raster on the globe: converts geographic positions to pixel positions and back.
//
// Pixel positions are GDAL's: (0, 0) is the outer corner of the first pixel, (.5, .5) its centre; columns to the right,
// rows downwards in the file.
#pragma once

#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "engine/core/result.h"
#include "engine/crs/projector.h"
#include "engine/gdal/file_content.h"

namespace terrace::dem {

// Offset of another raster's first pixel on the same grid, in pixels.
struct PixelOffset {
  std::int64_t column = 0, row = 0;
};

// Immutable and thread-safe.
class Georeference {
 public:
  // Reads the georeference of a dataset. kInvalidArgument: it has none that can be used, or its rows are not evenly
  // spaced; the message says what is missing and which command adds it.
  static Result<Georeference> Of(GDALDataset& dataset, const std::string& path);

  // Returns the position of the first pixel of `other` if both have the same CRS and pixel grid; else nothing. Columns
  // are not wrapped around the Earth.
  std::optional<PixelOffset> OffsetOf(const Georeference& other) const;
  // Offsets within a hundredth of a pixel count as on the grid, because files state corners with few digits. FindPeriod
  // has the same tolerance.
  static constexpr double kOffsetTolerance = 0.01;
  static constexpr double kFarthestPixel = 1LL << 40;  // rasters farther apart count as on different grids

  // Returns false if the rasters cannot lie on one pixel grid, whatever their offset: OffsetOf then returns nothing.
  bool MayAlign(const Georeference& other) const;
  // Returns the outer corner of the first pixel of `other`, in pixels of this raster. Precondition: both have the same
  // CRS.
  Position CornerOf(const Georeference& other) const;

  // Returns the largest offset, on each axis and in pixels, between the pixels of `other` and the pixels of this grid
  // that they are matched with. `first`: the match of its first pixel. Columns of geographic grids count modulo 360
  // degrees.
  Position LargestMisplacement(const Georeference& other, const PixelOffset& first) const;

  // Returns the georeference of a window of this grid that begins at `first`. `name`: the window's name in error
  // messages.
  Result<Georeference> Moved(const PixelOffset& first, int width, int height, const std::string& name) const;

  // Converts degrees to pixels, in place; NaN if the CRS has no such position. Longitudes of geographic sources are
  // taken modulo 360 degrees: the column is the one inside the raster, if there is one.
  void ToPixels(std::span<Position> positions) const;

  // Pixels to degrees, in place; longitudes may lie beyond +-180.
  void ToDegrees(std::span<Position> positions) const;

  // Whether pixel positions are an affine function of degrees; then neither PROJ nor interpolation is needed.
  bool is_affine() const { return projector_ == nullptr; }
  // Whether the CRS is geographic: its coordinates are longitudes and latitudes.
  bool is_geographic() const { return is_geographic_; }
  // Whether columns follow meridians: the CRS is geographic, and neither the raster nor the pole is rotated. Rows may
  // run either way.
  bool is_geographic_grid() const { return period_ > 0; }
  bool columns_run_east() const { return to_crs_[1] > 0; }
  // The number of columns in 360 degrees; 0 if this is not a geographic grid.
  double period() const { return period_; }
  // The number of columns after which a raster around the whole Earth repeats itself; 0 for other rasters. Further
  // columns are duplicates.
  int wrap_columns() const { return wrap_columns_; }

  int width() const { return width_; }
  int height() const { return height_; }

  const std::string& crs() const { return crs_; }
  // The datum that the CRS states: "EGM96 geoid". A three-dimensional CRS states "ellipsoid" for that of WGS 84 and
  // GRS 80, else "ellipsoid" and its name: "ellipsoid Bessel 1841". Empty: none.
  const std::string& vertical_datum() const { return vertical_datum_; }
  // The compound reference system including the vertical one, as WKT; empty if heights are ellipsoidal or no vertical
  // system is stated.
  const std::string& vertical_crs() const { return vertical_crs_; }
  const std::string& vertical_unit() const { return vertical_unit_; }
  const std::string& pixel_unit() const { return pixel_unit_; }
  double pixel_width() const;
  double pixel_height() const;
  // The geotransform from pixels to the CRS, in GDAL's order.
  const std::array<double, 6>& to_crs() const { return to_crs_; }
  // The horizontal part of the CRS as WKT; empty: none.
  const std::string& horizontal_wkt() const { return horizontal_wkt_; }
  const Projector* projector() const { return projector_.get(); }  // null where is_affine()
  std::string transform() const { return projector_ == nullptr ? "" : projector_->description(); }
  std::string pipeline() const { return projector_ == nullptr ? "" : projector_->pipeline(); }

  // Whether all corners are coordinates that longitudes and latitudes could have.
  bool MayBeInDegrees() const;

  // Adds to a hash everything that the positions of pixels depend on, including the PROJ operation and its grids, which
  // depend on the installation. Errors: those of HashFiles.
  Result<void> AddTo(ContentHasher& hasher, const FileContentOptions& options) const;
  // A hash of this georeference and of the bytes of a raster's files. Errors: those of HashFiles.
  Result<std::uint64_t> FingerprintWith(const StampedFiles& files, const FileContentOptions& options) const;

 private:
  Result<void> SetAffine(const std::string& path);
  Result<void> ReadCrs(const OGRSpatialReference& srs, const std::string& path);
  void FindPeriod(const OGRSpatialReference& srs);
  void FindTurn();
  bool HasPixelsOf(const Georeference& other, int side) const;
  double CanonicalColumn(double column) const;

  int width_ = 0, height_ = 0;
  std::array<double, 6> to_crs_{};    // pixels -> CRS, GDAL's order
  std::array<double, 6> to_pixel_{};  // CRS -> pixels
  // 360 degrees in units of the CRS, if the CRS is geographic or continues beyond the antimeridian; else 0.
  double full_circle_ = 0;
  double centre_x_ = 0;  // of the raster, in the same units
  bool is_geographic_ = false;
  double period_ = 0;
  int wrap_columns_ = 0;
  std::shared_ptr<const Projector> projector_;  // null: the CRS is WGS 84 longitude and latitude
  std::string wkt_, horizontal_wkt_;            // of the CRS as stated, and of its horizontal part
  std::string crs_, vertical_datum_, vertical_unit_, vertical_crs_, pixel_unit_;
};

// Returns the horizontal part of a reference system.
OGRSpatialReference HorizontalPart(const OGRSpatialReference& srs);

}  // namespace terrace::dem
