#include "engine/dem/mosaic/grid_members.h"

#include "engine/dem/mosaic/grid_layout.h"

namespace terrace::dem {

std::vector<GridPlan> PlanGrids(const std::vector<std::shared_ptr<const RasterSource>>& rasters) {
  std::vector<PlacedRaster> placed;
  for (const auto& raster : rasters) placed.push_back({&raster->georeference(), &raster->vertical()});
  std::vector<GridPlan> plans;
  for (const GridLayout& layout : LayOutGrids(placed)) {
    GridPlan& plan = plans.emplace_back(GridPlan{{}, layout.width, layout.height});
    for (const LaidRaster& member : layout.members) {
      plan.members.push_back({rasters[member.raster], member.column, member.row});
    }
  }
  return plans;
}

}  // namespace terrace::dem
