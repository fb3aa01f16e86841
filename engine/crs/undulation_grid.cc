#include "engine/crs/undulation_grid.h"

#include <cpl_string.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/common/dem_types.h"
#include "engine/gdal/driver_list.h"
#include "engine/gdal/gdal_runtime.h"
#include "engine/gdal/raster_file.h"

namespace terrace::dem {
namespace {

constexpr double kNoUndulation = std::numeric_limits<double>::quiet_NaN();

// PROJ moves positions within this distance outside to the edge; in steps of the grid (REL_TOLERANCE_HGRIDSHIFT).
constexpr double kGridEdgeTolerance = 1e-5;

// PROJ finds the undulations among the samples of a GeoTIFF by their description.
int BandOfUndulations(GDALDataset& dataset) {
  for (int i = 1; i <= dataset.GetRasterCount(); ++i) {
    const std::string_view what = dataset.GetRasterBand(i)->GetDescription();
    if (what == "geoid_undulation" || what == "vertical_offset" || what == "hydroid_height") return i;
  }
  return dataset.GetRasterCount() == 1 ? 1 : 0;
}

// The first and the last node around places.
std::pair<int, int> FirstAndLast(std::span<const AxisPosition> places) {
  std::pair<int, int> ends{std::numeric_limits<int>::max(), -1};
  for (const AxisPosition& place : places) {
    if (!place.is_inside()) continue;
    ends.first = std::min({ends.first, place.node, place.next});
    ends.second = std::max({ends.second, place.node, place.next});
  }
  return ends;
}

}  // namespace

std::shared_ptr<const UndulationGrid> UndulationGrid::Open(const std::string& path) {
  InitGdal();
  std::shared_ptr<UndulationGrid> grid(new UndulationGrid);
  grid->path_ = path;
  grid->dataset_ = OpenWithDriver("GTX", path);
  grid->is_gtx_ = grid->dataset_ != nullptr;
  if (!grid->is_gtx_) grid->dataset_ = OpenWithDriver("GTiff", path);
  if (grid->dataset_ == nullptr) return nullptr;
  GDALDataset& dataset = *grid->dataset_;
  std::array<double, 6> to_degrees{};
  const OGRSpatialReference* const srs = dataset.GetSpatialRef();
  if (dataset.GetGeoTransform(to_degrees.data()) != CE_None || to_degrees[2] != 0 || to_degrees[4] != 0 ||
      !(to_degrees[1] > 0) || !(to_degrees[5] < 0) || (srs != nullptr && srs->IsGeographic() == 0) ||
      CSLCount(dataset.GetMetadata("SUBDATASETS")) > 0) {
    return nullptr;
  }
  grid->columns_ = dataset.GetRasterXSize();
  grid->rows_ = dataset.GetRasterYSize();
  grid->column_step_ = to_degrees[1];
  grid->row_step_ = -to_degrees[5];
  grid->west_ = to_degrees[0] + grid->column_step_ / 2;
  grid->north_ = to_degrees[3] - grid->row_step_ / 2;
  grid->wraps_ = std::abs(grid->columns_ * grid->column_step_ - 360) < 1e-6 * grid->column_step_;
  grid->band_ = BandOfUndulations(dataset);
  if (grid->columns_ < 2 || grid->rows_ < 2 || grid->band_ == 0) return nullptr;
  GDALRasterBand& band = *dataset.GetRasterBand(grid->band_);
  grid->scale_ = band.GetScale();
  grid->offset_ = band.GetOffset();
  int has_no_data = 0;
  const double no_data = band.GetNoDataValue(&has_no_data);
  if (has_no_data != 0) grid->no_data_ = no_data;
  return grid;
}

double UndulationGrid::ColumnOf(double longitude) const {
  const double column = (longitude - west_) / column_step_, turn = 360 / column_step_;
  if (!wraps_) return column - turn * std::round((column - (columns_ - 1) / 2.0) / turn);
  const double wrapped = column - columns_ * std::floor(column / columns_);
  return wrapped < columns_ ? wrapped : 0;
}

AxisPosition UndulationGrid::AtColumn(double column) const {
  if (!wraps_) {
    if (!(column >= -kGridEdgeTolerance && column <= columns_ - 1 + kGridEdgeTolerance)) return {};
    column = std::clamp(column, 0.0, columns_ - 1.0);
  }
  const double floor = std::floor(column);
  const auto node = static_cast<int>(floor);
  if (!wraps_) return {node, std::min(node + 1, columns_ - 1), column - floor};
  return {(node % columns_ + columns_) % columns_, ((node + 1) % columns_ + columns_) % columns_, column - floor};
}

AxisPosition UndulationGrid::AtRow(double row) const {
  if (!(row >= -kGridEdgeTolerance && row <= rows_ - 1 + kGridEdgeTolerance)) return {};
  row = std::clamp(row, 0.0, rows_ - 1.0);
  const double floor = std::floor(row);
  const auto node = static_cast<int>(floor);
  return {node, std::min(node + 1, rows_ - 1), row - floor};
}

Result<std::vector<float>> UndulationGrid::Read(int column, int row, int columns, int rows) const {
  std::vector<float> heights(Area(columns, rows));
  {
    const std::lock_guard lock(mutex_);
    if (!ReadRaw(*dataset_->GetRasterBand(band_), column, row, columns, rows, GDT_Float32, heights.data())) {
      return MakeError(ErrorCode::kUnavailable, "the grid of undulations {} cannot be read ({}); check the file", path_,
                       TakeGdalError());
    }
  }
  constexpr float kLargest = 1000;  // PROJ's, of .gtx
  for (float& height : heights) {
    const bool is_void =
        (no_data_ && height == static_cast<float>(*no_data_)) || (is_gtx_ && std::abs(height) > kLargest);
    height = is_void ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(height * scale_ + offset_);
  }
  return heights;
}

std::int64_t UndulationPatch::CountNodes(std::span<const AxisPosition> columns, std::span<const AxisPosition> rows) {
  const auto [west, east] = FirstAndLast(columns);
  const auto [north, south] = FirstAndLast(rows);
  return east < 0 || south < 0 ? 0 : std::int64_t{east - west + 1} * (south - north + 1);
}

Result<UndulationPatch> UndulationPatch::Read(const UndulationGrid& grid, std::span<const AxisPosition> columns,
                                              std::span<const AxisPosition> rows) {
  const auto [west, east] = FirstAndLast(columns);
  const auto [north, south] = FirstAndLast(rows);
  UndulationPatch patch;
  if (east < 0 || south < 0) return patch;
  auto heights = grid.Read(west, north, east - west + 1, south - north + 1);
  if (!heights) return tl::unexpected(heights.error());
  patch.first_column_ = west;
  patch.first_row_ = north;
  patch.columns_ = east - west + 1;
  patch.heights_ = *std::move(heights);
  patch.is_whole_ = std::ranges::none_of(patch.heights_, [](float height) { return std::isnan(height); });
  return patch;
}

std::array<double, 4> UndulationPatch::Around(const AxisPosition& column, const AxisPosition& row) const {
  const auto node = [&](int c, int r) {
    return double{heights_[IndexAt(c - first_column_, r - first_row_, columns_)]};
  };
  return {node(column.node, row.node), node(column.next, row.node), node(column.node, row.next),
          node(column.next, row.next)};
}

bool UndulationPatch::IsWhole(const AxisPosition& column, const AxisPosition& row) const {
  if (!column.is_inside() || !row.is_inside()) return false;
  const std::array<double, 4> nodes = Around(column, row);
  return !std::isnan(nodes[0] + nodes[1] + nodes[2] + nodes[3]);
}

double UndulationPatch::At(const AxisPosition& column, const AxisPosition& row) const {
  if (!column.is_inside() || !row.is_inside()) return kNoUndulation;
  const double x = column.weight, y = row.weight;
  const std::array<double, 4> nodes = Around(column, row);
  const std::array<double, 4> weights = {(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y};
  const double sum = weights[0] * nodes[0] + weights[1] * nodes[1] + weights[2] * nodes[2] + weights[3] * nodes[3];
  if (!std::isnan(sum)) return sum;
  double known = 0, weight = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    if (std::isnan(nodes[i])) continue;
    known += weights[i] * nodes[i];
    weight += weights[i];
  }
  return weight > 0 ? known / weight : kNoUndulation;
}

// Columns between the same nodes share them: a run of columns takes the same sums as At, without looking nodes up.
void UndulationPatch::At(std::span<const AxisPosition> columns, const AxisPosition& row, std::span<double> out) const {
  for (std::size_t i = 0; i < columns.size();) {
    const AxisPosition& first = columns[i];
    std::size_t end = i + 1;
    while (end < columns.size() && columns[end].node == first.node && columns[end].next == first.next) ++end;
    if (!is_whole_ || !first.is_inside() || !row.is_inside()) {
      for (; i < end; ++i) out[i] = At(columns[i], row);
      continue;
    }
    const auto [nw, ne, sw, se] = Around(first, row);
    const double y = row.weight;
    for (; i < end; ++i) {
      const double x = columns[i].weight;
      out[i] = (1 - x) * (1 - y) * nw + x * (1 - y) * ne + (1 - x) * y * sw + x * y * se;
    }
  }
}

}  // namespace terrace::dem
