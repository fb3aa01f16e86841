// Edits whose heights count from the geoid of the sources.
#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/crs/geoid.h"
#include "engine/dem/dem_impl.h"

namespace terrace::dem {
namespace {

// The geoid that the first raster grid at the middle of an edit refers to; EGM96 if none refers to one. Null: a datum
// is not known.
Result<std::shared_ptr<const Geoid>> GeoidAt(const std::vector<RasterGrid>& grids,
                                             const std::vector<std::size_t>& there) {
  for (const std::size_t i : there) {
    const VerticalDatum& vertical = grids[i].vertical();
    if (!vertical.is_known()) return std::shared_ptr<const Geoid>();
    if (vertical.geoid != nullptr) return vertical.geoid;
  }
  return Geoid::OfCrs("EPSG:5773", {0, 0});
}

}  // namespace

Result<std::string> ElevationModel::Impl::AddUndulations(Edit& edit) const {
  const EditPlane& plane = edit.plane;
  const auto geoid = GeoidAt(grids, GridsAt({plane.longitude, plane.latitude, plane.longitude, plane.latitude}));
  if (!geoid) return tl::unexpected(geoid.error());
  if (*geoid == nullptr) {
    return std::string(
        "its heights are orthometric, but the vertical datum of the source there is not known; set "
        "`vertical` of the source, such as \"egm96\", or \"vertical\": \"ellipsoid\" of the feature");
  }
  // The finest geoid models have nodes two kilometres apart.
  constexpr double kStep_m = 500, kMaxSteps = 64;
  const Box& reach = edit.reach;
  const double width = (reach.max_x - reach.min_x) * plane.east_m, height = (reach.max_y - reach.min_y) * plane.north_m;
  const auto steps = [&](double metres) { return std::clamp(std::ceil(metres / kStep_m), 1.0, kMaxSteps); };
  auto patch = std::make_shared<EditUndulations>();
  patch->south_west = {(reach.min_x - plane.longitude) * plane.east_m, (reach.min_y - plane.latitude) * plane.north_m};
  patch->columns = static_cast<std::size_t>(steps(width)) + 1;
  patch->rows = static_cast<std::size_t>(steps(height)) + 1;
  patch->step_x = width / steps(width);
  patch->step_y = height / steps(height);
  const Geoid::Reader reader(**geoid);
  for (std::size_t j = 0; j < patch->rows; ++j) {
    const double latitude = reach.min_y + static_cast<double>(j) * patch->step_y / plane.north_m;
    for (std::size_t i = 0; i < patch->columns; ++i) {
      const double longitude = reach.min_x + static_cast<double>(i) * patch->step_x / plane.east_m;
      const double metres = reader.At({std::remainder(longitude, 360), latitude});
      if (!std::isfinite(metres))
        return fmt::format("its heights are orthometric, and {} has none there", (*geoid)->name());
      patch->values.push_back(std::round(metres * 4096) / 4096);  // equal on all processors
    }
  }
  edit.undulations = std::move(patch);
  edit.is_in_source_datum = AreHeightsAbove((*geoid)->pipeline(), HeightDatum::kSource, edit.reach);
  edit.is_in_orthometric = AreHeightsAbove((*geoid)->pipeline(), HeightDatum::kOrthometric, edit.reach);
  Complete(edit);
  return std::string();
}

std::string GeoidIn(HeightDatum datum, const VerticalDatum& source) {
  if (source.geoid != nullptr) return source.geoid->pipeline();
  if (datum != HeightDatum::kOrthometric || !source.is_known()) return "";
  static const std::string egm96 = [] {
    const auto geoid = Geoid::OfCrs("EPSG:5773", {0, 0});
    return geoid ? (*geoid)->pipeline() : "";
  }();
  return egm96;
}

bool ElevationModel::Impl::AreHeightsAbove(const std::string& geoid, HeightDatum datum, const Box& reach) const {
  // The floor shows where no source has a height.
  if (datum == HeightDatum::kSource && floor_undulations != nullptr && floor_undulations->geoid().pipeline() != geoid) {
    return false;
  }
  return std::ranges::all_of(GridsAt(reach),
                             [&](std::size_t i) { return GeoidIn(datum, grids[i].vertical()) == geoid; });
}

Result<std::vector<double>> ElevationModel::Impl::DatumUndulations(
    const geo::NodeGrid& node_grid, const NodeWindow& window, std::span<const std::size_t> which, HeightDatum datum,
    std::span<const float> unedited, const std::string& what, const std::stop_token& stop) const {
  const bool are_in_datum = std::ranges::all_of(which, [&](std::size_t number) {
    const Edit& edit = edits->edits()[number];
    return !edit.changes_heights() || edit.TargetDatum(datum) == datum;
  });
  if (are_in_datum) return std::vector<double>();
  const auto above = ReadUnedited(node_grid, window, HeightDatum::kEllipsoid, what, stop);
  if (!above) return tl::unexpected(above.error());
  std::vector<double> undulations(above->begin(), above->end());
  for (std::size_t k = 0; k < undulations.size(); ++k) undulations[k] -= static_cast<double>(unedited[k]);
  return undulations;
}

}  // namespace terrace::dem
