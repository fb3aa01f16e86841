// What the kinds of `terrace mesh` that read heights have in common: which samples are voids, and what is told of them.
#pragma once

#include <functional>
#include <string>

#include "engine/dem/dem_source.h"
#include "engine/dem/sources/read_raster.h"

namespace CLI {
class App;
}

namespace terrace::cli {

// Adds --nodata to the command; `nodata` is its text.
void AddNodataOption(CLI::App& command, std::string& nodata);

// Precondition: the option took the text.
dem::ReadOptions ReadOptionsOf(const std::string& nodata, std::function<void(double)> progress);

// On stderr, what a mesh of the raster in these coordinates (--coordinates), in the file `out`, may surprise by.
void WarnAbout(const std::string& path, const dem::RasterHeights& raster, const std::string& coordinates,
               const std::string& out);

}  // namespace terrace::cli
