#include "engine/export/output_grid.h"

#include <fmt/format.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "engine/crs/projector.h"
#include "engine/gdal/gdal_runtime.h"

namespace terrace::dem {
namespace {

// A position that comes back farther away than this has no inverse. In units of a projected CRS, or 10^-5 degrees.
constexpr double kReturn = 1;

tl::unexpected<Error> Invalid(std::string message) {
  return tl::unexpected(Error{ErrorCode::kInvalidArgument, std::move(message)});
}

// Around a pole both axes have the same direction.
bool RunsEastAndNorth(const OGRSpatialReference& srs) {
  OGRAxisOrientation first = OAO_Other, second = OAO_Other;
  srs.GetAxis(nullptr, 0, &first);
  srs.GetAxis(nullptr, 1, &second);
  return first == second || (first != OAO_West && first != OAO_South && second != OAO_West && second != OAO_South);
}

Result<void> SetCrs(int epsg, OutputGrid& grid) {
  grid.epsg = epsg;
  Result<std::string> wkt = EpsgWkt(std::to_string(epsg));
  if (!wkt) return tl::unexpected(Error{wkt.error().code, "crs: " + wkt.error().message});
  grid.wkt = *std::move(wkt);
  OGRSpatialReference srs;
  const bool is_read = srs.importFromWkt(grid.wkt.c_str()) == OGRERR_NONE;
  if (!is_read || srs.IsCompound() || !(srs.IsProjected() || srs.IsGeographic()) || srs.GetAxesCount() != 2) {
    return Invalid(
        fmt::format("crs: EPSG:{} is no system of two axes, eastings and northings or longitudes and latitudes", epsg));
  }
  if (!RunsEastAndNorth(srs)) {
    return Invalid(
        fmt::format("crs: the axes of EPSG:{} run west or south; choose a system of eastings and northings", epsg));
  }
  grid.is_geographic = srs.IsGeographic() != 0;
  const char* unit = nullptr;
  if (grid.is_geographic) {
    constexpr double kDegree = std::numbers::pi / 180;
    if (std::abs(srs.GetAngularUnits(&unit) - kDegree) > 1e-9) {
      return Invalid(fmt::format("crs: EPSG:{} counts in {}; choose one in degrees, or a projected one", epsg,
                                 unit != nullptr ? unit : "an unknown unit"));
    }
  } else {
    srs.GetLinearUnits(&unit);
  }
  grid.counts_from_greenwich = srs.GetPrimeMeridian() == 0;
  grid.unit = unit != nullptr ? unit : "unknown unit";
  return {};
}

// The number of nodes along a side from `low` to `high`.
Result<std::int64_t> NodesAlong(double low, double high, const std::optional<std::int64_t>& given, double spacing,
                                const char* name) {
  // A side of whole steps, as decimals: its ends and the spacing are rounded.
  const double rounding = 4 * std::numeric_limits<double>::epsilon() * std::max(std::abs(low), std::abs(high));
  const double nodes = given ? static_cast<double>(*given) : std::floor((high - low + rounding) / spacing) + 1;
  if (nodes < 2) return Invalid(fmt::format("{}: a grid has at least 2 nodes on each side", name));
  return static_cast<std::int64_t>(std::min(nodes, 1e15));
}

Position CentreOf(const OutputGrid& grid) { return {(grid.west + grid.east) / 2, (grid.south + grid.north) / 2}; }

// Finds the positions of nodes. A node has one if it comes back from there. So does a node just beyond the edge of the
// CRS, because the boxes of worlds are rounded: it gets the position of a place nearer to the centre of the grid.
class Placement {
 public:
  Placement(const OutputGrid& grid, const Projector& projector) : grid_(grid), projector_(projector) {}

  // Converts nodes to degrees, in place. Returns the index of the first that has no position; nothing: all have one.
  std::optional<std::size_t> Place(std::span<Position> nodes) const {
    const std::vector<Position> wanted(nodes.begin(), nodes.end());
    projector_.Inverse(nodes);
    std::vector<Position> back(nodes.begin(), nodes.end());
    projector_.Forward(back);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (IsOnEarth(nodes[i]) && IsNear(back[i], wanted[i])) continue;
      const Position inner = MovedInwards(wanted[i]);
      nodes[i] = inner;
      projector_.Inverse(nodes.subspan(i, 1));
      Position inner_back = nodes[i];
      projector_.Forward({&inner_back, 1});
      if (!IsOnEarth(nodes[i]) || !IsNear(inner_back, inner)) return i;
    }
    return std::nullopt;
  }

 private:
  static bool IsOnEarth(const Position& degrees) { return !std::isnan(degrees.x) && std::abs(degrees.y) <= 90; }
  double nearest() const { return grid_.is_geographic ? kReturn * 1e-5 : kReturn; }
  bool IsNear(const Position& a, const Position& b) const {
    const double x = grid_.is_geographic ? std::remainder(a.x - b.x, 360) : a.x - b.x;
    return std::hypot(x, a.y - b.y) <= nearest();
  }
  Position MovedInwards(const Position& node) const {
    const auto move = [&](double at, double low, double high) {
      return at + std::clamp((low + high) / 2 - at, -nearest(), nearest());
    };
    return {move(node.x, grid_.west, grid_.east), move(node.y, grid_.south, grid_.north)};
  }

  const OutputGrid& grid_;
  const Projector& projector_;
};

}  // namespace

Result<OutputGrid> PlanOutputGrid(const GridRequest& request, std::size_t max_nodes) {
  InitGdal();
  OutputGrid grid;
  if (const Result<void> set = SetCrs(request.epsg, grid); !set) return tl::unexpected(set.error());
  grid.west = request.west, grid.south = request.south, grid.east = request.east, grid.north = request.north;
  if (grid.is_geographic) {
    for (const double longitude : {grid.west, grid.east}) {
      if (std::abs(longitude) > 180) return Invalid("bbox: longitudes must be numbers from -180 to 180");
    }
    for (const double latitude : {grid.south, grid.north}) {
      if (std::abs(latitude) > 90)
        return Invalid("bbox: latitudes must be numbers from -90 to 90; longitudes come first");
    }
    if (grid.east < grid.west) grid.east += 360;
  }
  if (!(grid.west < grid.east) || !(grid.south < grid.north)) {
    return Invalid("bbox is empty; it is west,south,east,north in the units of the crs");
  }
  const double spacing = request.spacing.value_or(1);
  const auto columns =
      NodesAlong(grid.west, grid.east, request.columns, spacing, request.spacing ? "spacing" : "width");
  if (!columns) return tl::unexpected(columns.error());
  const auto rows = NodesAlong(grid.south, grid.north, request.rows, spacing, request.spacing ? "spacing" : "height");
  if (!rows) return tl::unexpected(rows.error());
  grid.columns = *columns, grid.rows = *rows;
  constexpr std::int64_t kLongestSide = 65536;
  const double nodes = static_cast<double>(grid.columns) * static_cast<double>(grid.rows);
  if (nodes > static_cast<double>(max_nodes) || std::max(grid.columns, grid.rows) > kLongestSide) {
    return Invalid(fmt::format(
        "the grid has {} x {} nodes, more than max_mesh_samples of this server ({}) or than {} on "
        "a side; ask for fewer, ask for parts of the area, or start the server with a larger --max-mesh-samples",
        grid.columns, grid.rows, max_nodes, kLongestSide));
  }
  if (request.spacing) {  // rounded, the last nodes of whole steps may be beyond the box, and beyond a pole
    grid.east = std::min(grid.east, grid.west + spacing * static_cast<double>(grid.columns - 1));
    grid.south = std::max(grid.south, grid.north - spacing * static_cast<double>(grid.rows - 1));
  }
  return grid;
}

Result<GridPositions> GridPositions::Make(OutputGrid grid) {
  GridPositions positions;
  if (grid.epsg != kWgs84) {
    auto projector = Projector::Make(grid.wkt, CentreOf(grid));
    if (!projector) return Invalid(fmt::format("crs: EPSG:{}: {}", grid.epsg, projector.error().message));
    positions.projector_ = *std::move(projector);
  }
  positions.grid_ = std::move(grid);
  return positions;
}

Result<std::vector<GeoPosition>> GridPositions::OfRows(std::int64_t first_row, std::int64_t rows,
                                                       const std::stop_token& stop) const {
  const OutputGrid& grid = grid_;
  std::vector<Position> nodes;
  nodes.reserve(Area(grid.columns, rows));
  for (std::int64_t row = first_row; row < first_row + rows; ++row) {
    const double y = row == grid.rows - 1 ? grid.south : grid.north - static_cast<double>(row) * grid.step_y();
    for (std::int64_t column = 0; column < grid.columns; ++column) {
      nodes.push_back(
          {column == grid.columns - 1 ? grid.east : grid.west + static_cast<double>(column) * grid.step_x(), y});
    }
  }
  if (projector_) {
    const Placement placement(grid, *projector_);
    constexpr std::size_t kBatch = 4096;
    for (std::size_t done = 0; done < nodes.size(); done += kBatch) {
      if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "placing a grid was stopped");
      const auto failed = placement.Place(std::span(nodes).subspan(done, std::min(kBatch, nodes.size() - done)));
      if (!failed) continue;
      const auto i = static_cast<std::int64_t>(done + *failed);
      return Invalid(
          fmt::format("bbox: EPSG:{} has no place on Earth for column {}, row {} of the grid; choose a bbox "
                      "within the area that the CRS is made for",
                      grid.epsg, i % grid.columns, first_row + i / grid.columns));
    }
  }
  std::vector<GeoPosition> positions;
  positions.reserve(nodes.size());
  for (const Position& node : nodes) positions.push_back({std::remainder(node.x, 360), node.y});
  return positions;
}

std::optional<GeoBounds> BoundsInCrs(const OutputGrid& grid, const GeoBounds& area) {
  if (grid.is_geographic && !grid.counts_from_greenwich) return std::nullopt;
  if (grid.is_geographic) return area;  // datum shifts are far smaller than what a bbox needs
  // The edges of an area across the antimeridian or around a pole do not bound it.
  if (area.east < area.west || area.south <= -90 || area.north >= 90) return std::nullopt;
  std::vector<Position> edge;
  constexpr int kSteps = 32;
  for (int i = 0; i <= kSteps; ++i) {
    const double along = static_cast<double>(i) / kSteps;
    const double x = std::lerp(area.west, area.east, along), y = std::lerp(area.south, area.north, along);
    for (const Position& on_edge : {Position{x, area.south}, {x, area.north}, {area.west, y}, {area.east, y}}) {
      edge.push_back(on_edge);
    }
  }
  const auto projector = Projector::Make(grid.wkt, CentreOf(grid));
  if (!projector) return std::nullopt;
  std::vector<Position> placed = edge;
  (*projector)->Forward(placed);
  std::vector<Position> back = placed;
  (*projector)->Inverse(back);
  GeoBounds box{placed[0].x, placed[0].y, placed[0].x, placed[0].y};
  for (std::size_t i = 0; i < edge.size(); ++i) {
    const double off = std::hypot(std::remainder(back[i].x - edge[i].x, 360), back[i].y - edge[i].y);
    if (!(off <= kReturn * 1e-5)) return std::nullopt;  // also NaN
    box.west = std::min(box.west, placed[i].x), box.east = std::max(box.east, placed[i].x);
    box.south = std::min(box.south, placed[i].y), box.north = std::max(box.north, placed[i].y);
  }
  return box;
}

}  // namespace terrace::dem
