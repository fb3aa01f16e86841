// Shared by the variants of `terrace mesh` that read heights: the option for voids, and warnings about the raster.
#pragma once

#include <functional>
#include <string>

#include "engine/sources/read_raster.h"

namespace CLI {
class App;
}

namespace terrace::cli {

// Adds --nodata to the command; `nodata` is its text.
void AddNodataOption(CLI::App& command, std::string& nodata);

// Precondition: the option accepted the text.
dem::ReadOptions ReadOptionsOf(const std::string& nodata, std::function<void(double)> progress);

// Warns on stderr about unexpected properties of the mesh in these coordinates (--coordinates) and in the format of
// `out`.
void WarnAbout(const std::string& path, const dem::RasterHeights& raster, const std::string& coordinates,
               const std::string& out);

}  // namespace terrace::cli
