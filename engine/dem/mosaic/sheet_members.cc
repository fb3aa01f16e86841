#include "engine/dem/mosaic/sheet_members.h"

#include "engine/dem/mosaic/sheet_layout.h"

namespace terrace::dem {

std::vector<SheetPlan> PlanSheets(const std::vector<std::shared_ptr<const RasterSource>>& rasters) {
  std::vector<PlacedRaster> placed;
  for (const auto& raster : rasters) placed.push_back({&raster->georeference(), &raster->vertical()});
  std::vector<SheetPlan> plans;
  for (const SheetLayout& layout : LayOutSheets(placed)) {
    SheetPlan& plan = plans.emplace_back(SheetPlan{{}, layout.width, layout.height});
    for (const LaidRaster& member : layout.members) {
      plan.members.push_back({rasters[member.raster], member.column, member.row});
    }
  }
  return plans;
}

}  // namespace terrace::dem
