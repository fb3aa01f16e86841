#include "bake/cell_list.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "engine/dem/planned_tiles.h"
#include "engine/geo/ellipsoid.h"

namespace terrace::bake {
namespace {

// Samples of a row of a Copernicus cell are wider than those of a column by this factor.
double WidthFactor(double latitude) {
  constexpr struct { double below, factor; } kSteps[] = {{50, 1}, {60, 1.5}, {70, 2}, {80, 3}, {85, 5}};
  for (const auto& [below, factor] : kSteps) {
    if (std::abs(latitude) < below) return factor;
  }
  return 10;
}

}  // namespace

Result<Pyramid> PlanCells(std::string_view text, double arc_seconds, double error_fraction) {
  std::vector<dem::PlannedRaster> rasters;
  const double degrees = arc_seconds / 3600;
  std::size_t number = 0;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string line(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    ++number;
    if (line.ends_with('\r')) line.pop_back();
    if (line.empty()) continue;
    char north = 0, east = 0, rest = 0;
    int south = 0, west = 0;
    // %2d and %3d also accept a sign and blanks.
    const bool has_digits =
        line.size() == 7 && std::ranges::count_if(line, [](char c) { return c >= '0' && c <= '9'; }) == 5;
    const bool is_cell = has_digits &&
                         std::sscanf(line.c_str(), "%c%2d%c%3d%c", &north, &south, &east, &west, &rest) == 4 &&
                         (north == 'N' || north == 'S') && (east == 'E' || east == 'W');
    if (north == 'S') south = -south;
    if (east == 'W') west = -west;
    if (!is_cell || south < -90 || south > 89 || west < -180 || west > 179) {
      return MakeError(ErrorCode::kInvalidArgument, "line {}: \"{}\" is no cell such as N46E008", number, line);
    }
    const double centre = south + 0.5;
    rasters.push_back({{static_cast<double>(west), static_cast<double>(south), static_cast<double>(west + 1),
                        static_cast<double>(south + 1)},
                       degrees * WidthFactor(centre) * geo::MetresPerDegreeEast(centre),
                       degrees * geo::MetresPerDegreeNorth(centre)});
  }
  if (rasters.empty())
    return MakeError(ErrorCode::kInvalidArgument, "lists no cells; a line is a cell such as N46E008");
  return dem::PlannedTiles(rasters, error_fraction);
}

}  // namespace terrace::bake
