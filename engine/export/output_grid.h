// Grids of heights for other programs: their positions, and files of them.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"

namespace terrace::dem {

inline constexpr int kWgs84 = 4326;  // EPSG

// Rows run from the north, nodes in a row from the west; the outermost nodes lie on the box.
struct OutputGrid {
  int epsg = 4326;
  std::string wkt;                                  // of the CRS
  std::string unit;                                 // of its axes: "metre", "degree"
  bool is_geographic = true;                        // x and y are degrees of longitude and latitude
  bool counts_from_greenwich = true;                // if geographic
  double west = 0, south = 0, east = 0, north = 0;  // units of the CRS
  std::int64_t columns = 0, rows = 0;

  double step_x() const { return (east - west) / static_cast<double>(columns - 1); }
  double step_y() const { return (north - south) / static_cast<double>(rows - 1); }
};

struct GridRequest {
  int epsg = 4326;
  // Units of the CRS; degrees for geographic ones, where west > east is a box across the antimeridian.
  double west = 0, south = 0, east = 0, north = 0;
  // Either both numbers of nodes, or the spacing. With a spacing the box ends at the last node to the east and south.
  std::optional<std::int64_t> columns = {}, rows = {};
  std::optional<double> spacing = {};
};

// kInvalidArgument, with a message for clients: PROJ does not know the CRS, its axes are not two, run west or south, or
// count in grads; the box is empty; a side has fewer than 2 nodes; there are more than `max_nodes`.
Result<OutputGrid> PlanOutputGrid(const GridRequest& request, std::size_t max_nodes);

class Projector;

// Converts the nodes of a grid to longitudes and latitudes. Thread-safe.
class GridPositions {
 public:
  // kInvalidArgument, with a message for clients: PROJ has no transformation from the CRS to WGS 84.
  static Result<GridPositions> Make(OutputGrid grid);

  // Positions of the nodes of some rows, longitudes -180 .. 180. kInvalidArgument, with a message for clients: the CRS
  // has no position on Earth at a node. kCancelled: stopped.
  Result<std::vector<GeoPosition>> OfRows(std::int64_t first_row, std::int64_t rows, const std::stop_token& stop) const;

 private:
  GridPositions() = default;

  OutputGrid grid_;
  std::shared_ptr<const Projector> projector_;  // null: the grid is in EPSG:4326
};

// A box around `area` in the CRS of the grid, for messages. Geographic CRS: `area` itself, without shifts between
// datums; nothing if its longitudes are not counted from Greenwich. Projected CRS: the box around 33 points on each
// side of the area; nothing if one of them has no position there, or if the area crosses the antimeridian or touches a
// pole.
std::optional<GeoBounds> BoundsInCrs(const OutputGrid& grid, const GeoBounds& area);

// Errors as of WriteGeoTiff: whether it can write the grid, whatever the heights are.
Result<void> CheckGeoTiff(const OutputGrid& grid);
// A tiled GeoTIFF with deflate and a nodata value for NaN. Its pixels are centred on the nodes. kInvalidArgument, with
// a message for clients: GDAL cannot write the CRS into one. kUnavailable: GDAL cannot write it.
Result<std::string> WriteGeoTiff(const OutputGrid& grid, std::span<const float> heights);
// A grey image of 16 bits. `values`: one per node. kUnavailable: GDAL cannot write it.
Result<std::string> WritePng16(const OutputGrid& grid, std::span<const std::uint16_t> values);

}  // namespace terrace::dem
