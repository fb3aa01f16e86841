// Whether a raster's overviews are averages of its heights alone: many were made of what is no height as well.
#pragma once

#include <gdal_priv.h>

#include <string>

#include "engine/dem/raster/sample_grid.h"
#include "engine/dem/statistics/raster_statistics.h"

namespace terrace::dem {

// Takes overviews that must not be read from the layout: those that were made of voids, by what the file and its owner
// state, and those with other sides than a grid of averages has. Why, for people, with a way out; empty: all of them
// stay, or there are none.
std::string DropMisleadingOverviews(GDALDataset& dataset, RasterLayout& layout);

// The same by what the statistics of the raster and its overviews has found.
std::string DropMisleadingOverviews(GDALDataset& dataset, const RasterStatistics& statistics, RasterLayout& layout);

}  // namespace terrace::dem
