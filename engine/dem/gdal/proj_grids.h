// The files of numbers that an operation of PROJ reads.
#pragma once

#include <string>
#include <vector>

#include "engine/dem/gdal/proj_handle.h"

namespace terrace::dem {

struct ProjGrid {
  std::string name;
  std::string file;  // empty: it is not installed
  std::string url;   // empty: nobody offers it
};

std::vector<ProjGrid> GridsOf(PJ_CONTEXT* context, const PJ* operation);

}  // namespace terrace::dem
