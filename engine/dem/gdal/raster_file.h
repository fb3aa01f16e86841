// Opening a raster file as one band of heights, with every check that must come before its first sample is read.
#pragma once

#include <gdal_priv.h>

#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"

namespace terrace::dem {

// Opens `path` read-only. Refuses, with the remedy: what the source policy does not allow, no raster, has no band,
// complex samples, sides, bands or storage blocks of an absurd size.
// `overview`: the raster as the overview of that number has it; -1: in full.
Result<GDALDatasetUniquePtr> OpenRaster(const std::string& path, int overview = -1);

// Before a dataset is opened anew: lets go of what GDAL remembers of remote files, the raster or the parts of a VRT, so
// that they are read as they are now and not as they once were.
void ForgetRemote(const std::string& path);

// Whether a GDAL driver accepts the file, by name and first bytes. Overviews and masks beside a raster do not count.
bool IsRaster(const std::string& path);

// The same without the checks, for further handles on a file that passed them; null when it cannot be opened.
GDALDatasetUniquePtr ReopenRaster(const std::string& path, int overview = -1);

// Refuses (kUnavailable) a GeoTIFF that ends before the samples, overviews or mask of its first bands do. An incomplete
// copy can be opened, but reading the missing part would fail later, in single tiles. Remote files are not checked.
Result<void> CheckComplete(GDALDataset& dataset, const std::string& path, int bands = 1);

// The file, and those that GDAL reads with it: overviews, masks, the parts of a mosaic with theirs. Some may not exist.
std::vector<std::string> FilesOf(GDALDataset& dataset, const std::string& path);

// Whether GDAL reads a file with that ending beside or as the raster.
bool HasFileEndingWith(GDALDataset& dataset, std::string_view ending);

// Refuses what is too large to mesh in one piece.
Result<void> CheckSizeToMesh(const std::string& path, int width, int height);

// Whether another band says which samples are valid: the mask of the dataset or of this band alone, or alpha that GDAL
// takes for one. A nodata value is none.
bool HasMaskBand(GDALRasterBand& band);

// The part of a picture that a band is, as GDAL names it; empty if the band may contain heights, as a grey band may. A
// band of palette indices may not.
std::string PicturePartOf(GDALRasterBand& band);

// Band 1: the heights. Precondition: the dataset came from OpenRaster or ReopenRaster.
inline GDALRasterBand& HeightBand(GDALDataset& dataset) { return *dataset.GetRasterBand(1); }

}  // namespace terrace::dem
