#include "engine/dem/gdal/proj_grids.h"

namespace terrace::dem {

std::vector<ProjGrid> GridsOf(PJ_CONTEXT* context, const PJ* operation) {
  std::vector<ProjGrid> grids;
  const int count = proj_coordoperation_get_grid_used_count(context, operation);
  for (int i = 0; i < count; ++i) {
    const char *name = nullptr, *file = nullptr, *url = nullptr;
    proj_coordoperation_get_grid_used(context, operation, i, &name, &file, nullptr, &url, nullptr, nullptr, nullptr);
    const auto text = [](const char* value) { return std::string(value == nullptr ? "" : value); };
    grids.push_back({text(name), text(file), text(url)});
  }
  return grids;
}

}  // namespace terrace::dem
