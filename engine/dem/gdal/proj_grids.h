// The grid files that a PROJ operation reads.
#pragma once

#include <string>
#include <vector>

#include "engine/dem/gdal/proj_handle.h"

namespace terrace::dem {

struct ProjGrid {
  std::string name;
  std::string file;  // empty: not installed
  std::string url;   // empty: no known download
};

std::vector<ProjGrid> GridsOf(PJ_CONTEXT* context, const PJ* operation);

}  // namespace terrace::dem
