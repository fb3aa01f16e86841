#include "engine/dem/sheet_tables.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace terrace::dem {

SheetTables::SheetTables(const Sheet& sheet, const SheetTrace& trace)
    : sheet_(sheet), trace_(trace), near_(MembersAround()), heights_(sheet.members().front().raster->info().heights) {
  for (const SheetMember& member : sheet.members()) {
    heights_.min = std::min(heights_.min, member.raster->info().heights.min);
    heights_.max = std::max(heights_.max, member.raster->info().heights.max);
  }
  for (const std::size_t i : near_) {
    const Position& off = sheet.members()[i].misplacement;
    misplacement_ = {std::max(misplacement_.x, off.x), std::max(misplacement_.y, off.y)};
  }
}

std::vector<std::size_t> SheetTables::MembersAround() const {
  if (sheet_.members().size() == 1) return {0};
  Box hull{1e300, 1e300, -1e300, -1e300};
  bool known = !sheet_.wraps();
  for (const Position& p : trace_.positions) {
    if (trace_.is_part && std::isnan(p.x)) continue;  // far from the sheet
    known &= std::isfinite(p.x) && std::isfinite(p.y);
    hull = {std::min(hull.west, p.x), std::min(hull.south, p.y), std::max(hull.east, p.x), std::max(hull.north, p.y)};
  }
  const double halo = 4.0 * trace_.factor;
  if (!known) hull = {-1e300, -1e300, 1e300, 1e300};
  return sheet_.MembersAt({hull.west - halo, hull.south - halo, hull.east + halo, hull.north + halo});
}

BlockRange SheetTables::Ranges(double west, double north, double east, double south) const {
  BlockRange range;
  for (const std::size_t i : near_) {
    const SheetMember& member = sheet_.members()[i];
    const auto x = static_cast<double>(member.column), y = static_cast<double>(member.row);
    range.Add(member.raster->ranges().Query(west - x, north - y, east - x, south - y));
  }
  return range;
}

float SheetTables::ErrorOfAverages(double west, double north, double east, double south) const {
  const int factor = trace_.factor;
  if (factor == 1) return 0;  // averages of one sample
  if (sheet_.members().size() == 1) {
    return sheet_.members().front().raster->averaging_errors().Largest(factor, west, north, east, south);
  }
  constexpr float kNotTold = std::numeric_limits<float>::infinity();
  if (sheet_.alignment() < factor) return kNotTold;
  const SheetMember* only = nullptr;
  for (const std::size_t i : near_) {
    const geo::TileRange pixels = sheet_.members()[i].pixels();
    if (east < static_cast<double>(pixels.start_x) || west > static_cast<double>(pixels.end_x + 1) ||
        south < static_cast<double>(pixels.start_y) || north > static_cast<double>(pixels.end_y + 1)) {
      continue;
    }
    if (only != nullptr) return kNotTold;
    only = &sheet_.members()[i];
  }
  if (only == nullptr) return 0;
  const RasterLayout& layout = only->raster->layout();
  const auto whole = [factor](int samples) { return static_cast<double>(samples / factor * factor); };
  const auto x = static_cast<double>(only->column), y = static_cast<double>(only->row);
  if (west < x || north < y || east > x + whole(layout.columns) || south > y + whole(layout.height)) return kNotTold;
  return only->raster->averaging_errors().Largest(factor, west - x, north - y, east - x, south - y);
}

float SheetTables::AveragingError(double west, double north, double east, double south) const {
  const double factor = trace_.factor, turn = sheet_.columns();
  west *= factor, north *= factor, east = (east + 1) * factor, south = (south + 1) * factor;
  const auto error = [&](double shift) { return ErrorOfAverages(west + shift, north, east + shift, south); };
  float largest = error(0);
  if (sheet_.wraps() && west < 0) largest = std::max(largest, error(turn));
  if (sheet_.wraps() && east > turn) largest = std::max(largest, error(-turn));
  return largest;
}

}  // namespace terrace::dem
