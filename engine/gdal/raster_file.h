// Opens a raster file as one band of heights, after all checks that must precede the first read of a sample.
#pragma once

#include <gdal_priv.h>

#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"

namespace terrace::dem {

// Opens `path` read-only. Errors, with the remedy: the source policy does not allow the name, the file is not a raster,
// is remote and not a GeoTIFF, has no band, has complex samples, has fewer than 2 x 2 samples, or is too large: more
// than 2^22 samples on a side, 2^36 samples, 4,096 bands or 128 MiB in a storage block. `overview`: number of an
// overview to open instead of the full raster, of any size; -1: the full raster.
Result<GDALDatasetUniquePtr> OpenRaster(const std::string& path, int overview = -1);

// Reads a rectangle of a band as `type`, row by row from the north, without rescaling. False: it cannot be read;
// TakeGdalError says why. Also false for blocks of GeoPackages and MBTiles that GDAL silently fills with zeros.
bool ReadRaw(GDALRasterBand& band, int col, int row, int cols, int rows, GDALDataType type, void* out);

// Clears what GDAL has cached of remote files: of the raster, or of the parts of a VRT. Call before a dataset is
// reopened, so that the current content is read.
void ForgetRemote(const std::string& path);

// Whether OpenRaster should be tried: a GDAL driver accepts the name and the first bytes, or the source policy refuses
// the file, and OpenRaster returns the reason. False for sidecars: overviews, masks, headers, world files.
bool IsRaster(const std::string& path);

// OpenRaster without the checks, for further handles on a file that passed them. Null: the file cannot be opened.
GDALDatasetUniquePtr ReopenRaster(const std::string& path, int overview = -1);

// kUnavailable: a GeoTIFF is truncated within the samples, overviews or mask of its first bands, or an ENVI, classic
// netCDF or JPEG file is truncated. A truncated file can be opened, but reads of the missing part would fail later, in
// single tiles; of ENVI and netCDF they would be zeros, of JPEG grey. Of a VRT, checks the parts: kUnavailable, an
// ENVI, classic netCDF or JPEG file is truncated; kInvalidArgument, a part cannot be opened, has a sidecar that GDAL
// cannot read and would ignore, or names overviews elsewhere. Remote files are not checked.
Result<void> CheckComplete(GDALDataset& dataset, const std::string& path, int bands = 1);

// Returns the file and all files that GDAL reads with it: overviews, masks, and the parts of a mosaic with their own.
// Some may not exist.
std::vector<std::string> FilesOf(GDALDataset& dataset, const std::string& path);

// Whether one of the files that GDAL lists for the dataset has a name with this ending, such as ".ovr".
bool HasFileEndingWith(GDALDataset& dataset, std::string_view ending);

// kInvalidArgument: more than 2^15 samples on a side, or more than 2^29 samples.
Result<void> CheckSizeToMesh(const std::string& path, int width, int height);

// Whether a mask says which samples are valid: a mask of the dataset or of this band, or an alpha band that GDAL uses
// as a mask. A nodata value is not a mask.
bool HasMaskBand(GDALRasterBand& band);

// Returns GDAL's name of a colour band ("Red", "Palette"); empty if the band may contain heights, as grey bands may.
std::string PictureColorOf(GDALRasterBand& band);

// Returns band 1, which contains the heights. Precondition: the dataset came from OpenRaster or ReopenRaster.
inline GDALRasterBand& HeightBand(GDALDataset& dataset) { return *dataset.GetRasterBand(1); }

}  // namespace terrace::dem
