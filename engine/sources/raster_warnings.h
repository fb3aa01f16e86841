// What people should know about a raster that is served as it is.
#pragma once

#include <gdal_priv.h>

#include <string>
#include <vector>

#include "engine/crs/georeference.h"
#include "engine/crs/vertical_datum.h"
#include "engine/raster/raster_layout.h"

namespace terrace::dem {

// Warnings about the position and the unit of a raster's heights, each with the remedy. `wanted_vertical`: as for
// ResolveVertical, which gave `vertical`. `spacing_m`: between samples on the ground.
std::vector<std::string> WarningsOf(GDALDataset& dataset, const Georeference& georeference, double spacing_m,
                                    const VerticalDatum& vertical, const std::string& wanted_vertical,
                                    const RasterLayout& layout);

}  // namespace terrace::dem
