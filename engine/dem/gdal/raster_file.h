// Opening a raster file as one band of heights, with every check that must come before its first sample is read.
#pragma once

#include <gdal_priv.h>

#include <string>
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

// Whether a driver takes the file for one of its own, by name and first bytes. Overviews and masks beside a raster are
// none.
bool IsRaster(const std::string& path);

// The same without the checks, for further handles on a file that passed them; null when it cannot be opened.
GDALDatasetUniquePtr ReopenRaster(const std::string& path, int overview = -1);

// Refuses (kUnavailable) a GeoTIFF that ends before the samples, overviews or mask of its first bands do: one that a
// copy left unfinished opens all the same, and would fail in the tiles of what is not there. Remote files are not
// looked at.
Result<void> CheckComplete(GDALDataset& dataset, const std::string& path, int bands = 1);

// The file, and those that GDAL reads with it: overviews, masks, the parts of a mosaic with theirs. Some may not exist.
std::vector<std::string> FilesOf(GDALDataset& dataset, const std::string& path);

// Refuses what is too large to mesh in one piece.
Result<void> CheckSizeToMesh(const std::string& path, int width, int height);

// Whether another band says which samples are valid: the mask of the dataset or of this band alone, or alpha that GDAL
// takes for one. A nodata value is none.
bool HasMaskBand(GDALRasterBand& band);

// What of a picture a band is, as GDAL calls it; empty where it may be heights, as a grey one well may. Indices into a
// palette may not.
std::string PicturePartOf(GDALRasterBand& band);

// Band 1: the heights. Precondition: the dataset came from OpenRaster or ReopenRaster.
inline GDALRasterBand& HeightBand(GDALDataset& dataset) { return *dataset.GetRasterBand(1); }

}  // namespace terrace::dem
