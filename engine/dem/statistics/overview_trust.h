// Detects overviews that are not averages of valid heights alone: many contain averaged nodata values.
#pragma once

#include <gdal_priv.h>

#include <string>

#include "engine/dem/raster/sample_grid.h"
#include "engine/dem/statistics/raster_statistics.h"

namespace terrace::dem {

// Removes from the layout the overviews that must not be read: those that include voids, by the nodata values of the
// file and the configuration, and those whose size is not that of a grid of averages. Returns the reason, with the
// remedy, for people; empty if nothing was removed.
std::string DropMisleadingOverviews(GDALDataset& dataset, RasterLayout& layout);

// The same, based on the statistics of the raster and its overviews.
std::string DropMisleadingOverviews(GDALDataset& dataset, const RasterStatistics& statistics, RasterLayout& layout);

}  // namespace terrace::dem
