#include "tiler/area/area_mesh.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "engine/core/elapsed_time.h"
#include "engine/core/plain_number.h"
#include "engine/dem/tile_edits.h"
#include "engine/geo/ellipsoid.h"
#include "engine/geo/error_ladder.h"
#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh_error.h"
#include "proto/gltf/mesh_file.h"
#include "tiler/area/area_surface.h"
#include "tiler/mesh/edit_limits.h"
#include "tiler/mesh/restore_error_bound.h"
#include "tiler/tile/strong_etag.h"

namespace terrace::tiler {
namespace {

using Clock = std::chrono::steady_clock;

// Larger distances occur only for triangles that span half of the Earth and collapse into a line.
constexpr double kMaxSag_m = 1e6;

Result<void> CheckArea(const AreaRequest& area) {
  const bool has_box = area.west >= -180 && area.west <= 180 && area.west < area.east && area.east <= area.west + 360 &&
                       area.south >= -90 && area.south < area.north && area.north <= 90;
  if (!has_box) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "bbox: {},{},{},{} is not west,south,east,north in degrees, with west < east <= west + 360",
                     area.west, area.south, area.east, area.north);
  }
  if (std::isfinite(area.error_m) && area.error_m > 0) return {};
  return MakeError(ErrorCode::kInvalidArgument, "error: {} is not a number of metres above 0", area.error_m);
}

// The part of the area within the model's bounds. `step`: degrees between nodes of the finest lattice; gaps and parts
// narrower than that do not count. kInvalidArgument: there is no part, or there are two.
Result<AreaRequest> Clip(const AreaRequest& area, const dem::GeoBounds& bounds, double step) {
  AreaRequest clipped = area;
  clipped.south = std::max(area.south, bounds.south);
  clipped.north = std::min(area.north, bounds.north);
  const double bounds_east = bounds.east < bounds.west ? bounds.east + 360 : bounds.east;
  const bool is_dataset_around = bounds_east - bounds.west >= 360, is_area_around = area.east - area.west >= 360;
  std::vector<std::pair<double, double>> parts;  // west and east
  if (is_dataset_around) {
    parts.emplace_back(area.west, area.east);
  } else if (is_area_around) {
    parts.emplace_back(bounds.west, bounds_east);
  } else {
    for (const double turn : {-360.0, 0.0, 360.0}) {
      const double west = std::max(area.west, bounds.west + turn), east = std::min(area.east, bounds_east + turn);
      if (east <= west) continue;
      if (!parts.empty() && west - parts.back().second < step) {
        parts.back().second = east;
      } else {
        parts.emplace_back(west, east);
      }
    }
    if (parts.size() > 1) std::erase_if(parts, [&](const auto& part) { return part.second - part.first < step; });
  }
  if (parts.empty() || clipped.north <= clipped.south) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "bbox lies outside the dataset, whose bounds are {:.6f},{:.6f},{:.6f},{:.6f}", bounds.west,
                     bounds.south, bounds.east, bounds.north);
  }
  if (parts.size() > 1) {
    const auto longitude = [](double degrees) { return PlainNumber(std::remainder(degrees, 360)); };
    return MakeError(ErrorCode::kInvalidArgument,
                     "bbox has two parts of the dataset, at longitudes {} to {} and {} to {}; ask for one after the "
                     "other, or for a bbox that crosses the dataset once",
                     longitude(parts[0].first), longitude(parts[0].second), longitude(parts[1].first),
                     longitude(parts[1].second));
  }
  std::tie(clipped.west, clipped.east) = parts.front();
  return clipped;
}

// The size of a window in 64 bits: levels too fine for meshing have counts beyond int, and more samples than 64 bits
// can count.
struct NodeCounts {
  std::int64_t west = 0, south = 0, columns = 0, rows = 0;

  double samples() const { return static_cast<double>(columns) * static_cast<double>(rows); }
  dem::NodeWindow Window() const { return {west, south, static_cast<int>(columns), static_cast<int>(rows)}; }
};

NodeCounts NodesAt(const geo::Lattice& lattice, const AreaRequest& area) {
  const double step = lattice.StepDegrees();
  // A node within rounding of the area's edge lies on the edge.
  constexpr double kSlack = 1e-6;
  const auto first = [&](double degrees) { return static_cast<std::int64_t>(std::floor(degrees / step + kSlack)); };
  const auto last = [&](double degrees) { return static_cast<std::int64_t>(std::ceil(degrees / step - kSlack)); };
  const std::int64_t west = first(area.west + 180), east = std::max(last(area.east + 180), west + 1);
  const std::int64_t south = std::clamp<std::int64_t>(first(area.south + 90), 0, lattice.rows() - 1);
  const std::int64_t north = std::clamp<std::int64_t>(last(area.north + 90), south + 1, lattice.rows());
  return {west, south, east - west + 1, north - south + 1};
}

// The limits that a number of nodes exceeds, for a message; empty: none.
std::string ExceededLimits(const NodeCounts& nodes, std::size_t max_samples) {
  std::string limits;
  if (nodes.samples() > static_cast<double>(max_samples)) {
    limits = fmt::format("more than max_mesh_samples of this server ({})", max_samples);
  }
  if (std::max(nodes.columns, nodes.rows) > tin::HeightField::kMaxSide) {
    limits += fmt::format("{}more than the {} that a mesh may have on a side", limits.empty() ? "" : ", and ",
                          tin::HeightField::kMaxSide);
  }
  return limits;
}

// `level`: the requested level. Names the smallest error for which the area can be meshed, if there is one.
tl::unexpected<Error> TooLarge(const dem::ElevationModel& model, double error_fraction, const AreaRequest& area,
                               int level, std::size_t max_samples) {
  const auto nodes_at = [&](int at) { return NodesAt(model.LatticeOf(at), area); };
  int fitting = level - 1;
  while (fitting >= 0 && !ExceededLimits(nodes_at(fitting), max_samples).empty()) --fitting;
  const NodeCounts nodes = nodes_at(fitting >= 0 ? level : 0);
  const std::string size = fmt::format("this area has {} x {} = {:.0f} samples, {}", nodes.columns, nodes.rows,
                                       nodes.samples(), ExceededLimits(nodes, max_samples));
  if (fitting < 0) {
    return MakeError(ErrorCode::kInvalidArgument, "even at the largest error {}; ask for a smaller bbox", size);
  }
  return MakeError(ErrorCode::kInvalidArgument,
                   "at an error of {} m {}; ask for a smaller bbox, or for an error of {} m or more",
                   PlainNumber(area.error_m), size, PlainNumberUp(geo::DefaultError(fitting, error_fraction), 3));
}

struct Frame {
  geo::Vec3 origin, east, north, up;

  static Frame At(const dem::GeoPosition& centre) {
    const geo::Vec3 up = geo::SurfaceNormal(centre.longitude, centre.latitude);
    const geo::Vec3 meridian = geo::SurfaceNormal(centre.longitude, 0);
    const geo::Vec3 east{-meridian.y, meridian.x, 0};
    return {geo::ToEcef(centre.longitude, centre.latitude, 0), east, geo::Cross(up, east), up};
  }
  geo::Vec3 ToLocal(geo::Vec3 ecef) const {
    const geo::Vec3 d = ecef - origin;
    return {geo::Dot(d, east), geo::Dot(d, north), geo::Dot(d, up)};
  }
  geo::Vec3 ToEcef(geo::Vec3 local) const { return origin + east * local.x + north * local.y + up * local.z; }
};

struct PlacedMesh {
  std::vector<proto::MeshVertex> vertices;
  double max_error_m = 0;
};

PlacedMesh PlaceFlat(const tin::HeightField& field, const tin::TinMesh& mesh, const AreaSurface& surface,
                     const std::stop_token& stop) {
  PlacedMesh placed;
  for (const tin::SamplePosition p : mesh.vertices) {
    const dem::GeoPosition at = surface.At(p.x, p.y);
    placed.vertices.push_back({at.longitude, at.latitude, field.VertexHeight(p.x, p.y)});
  }
  placed.max_error_m = tin::MeasureError(field, mesh, stop).max;
  return placed;
}

// The mesh was refined in longitude and latitude. In space its triangles are displaced by the curvature of parallels.
// The displacement is small, but at a cliff or near a pole the error can exceed the bound. Inserts samples that exceed
// it.
Result<PlacedMesh> PlaceInSpace(const tin::HeightField& field, tin::TinMesh& mesh, const AreaSurface& surface,
                                const std::optional<Frame>& frame, double bound_m, const tin::SampleLimits& limits,
                                const std::stop_token& stop) {
  constexpr double kRounding_m = 0x1p-8;  // the error of RoundPosition on a steep slope, which vertices cannot reduce
  std::vector<float> allowed = AllowedErrors(limits, bound_m);
  for (float& bound : allowed) bound = std::max(bound, static_cast<float>(kRounding_m));
  PlacedMesh placed;
  const auto measure = [&](const tin::TinMesh& rounded_mesh) {
    placed.vertices.clear();
    std::vector<geo::Vec3> ecef;
    for (const tin::SamplePosition p : rounded_mesh.vertices) {
      const geo::Vec3 exact = surface.Ecef(p.x, p.y, field.VertexHeight(p.x, p.y));
      const geo::Vec3 rounded = RoundPosition(frame ? frame->ToLocal(exact) : exact);
      placed.vertices.push_back({rounded.x, rounded.y, rounded.z});
      ecef.push_back(frame ? frame->ToEcef(rounded) : rounded);
    }
    return surface.MeasureError(field, rounded_mesh, ecef, std::max(bound_m, kRounding_m), allowed, stop);
  };
  const std::size_t every_sample = static_cast<std::size_t>(field.width()) * static_cast<std::size_t>(field.height());
  const Result<proto::TileError> error = RestoreErrorBound(mesh, measure, every_sample, stop);
  if (!error) return tl::unexpected(error.error());
  placed.max_error_m = std::ceil(error->max_m * 1024) / 1024;  // up to the next step of positions
  return placed;
}

// Removes the triangles in holes, and vertices that no remaining triangle uses.
void DropHoles(const dem::MeshDemands& demands, int width, tin::TinMesh& mesh,
               std::vector<proto::MeshVertex>& vertices) {
  const std::vector<std::uint8_t> in_hole = TrianglesInHoles(demands, width, mesh);
  if (in_hole.empty()) return;
  constexpr std::uint32_t kUnused = 0xffffffff;
  std::vector<std::uint32_t> numbers(mesh.vertices.size(), kUnused);
  tin::TinMesh kept;
  std::vector<proto::MeshVertex> kept_vertices;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (in_hole[t] != 0) continue;
    auto triangle = mesh.triangles[t];
    for (auto& corner : triangle) {
      if (numbers[corner] == kUnused) {
        numbers[corner] = static_cast<std::uint32_t>(kept.vertices.size());
        kept.vertices.push_back(mesh.vertices[corner]);
        kept_vertices.push_back(vertices[corner]);
      }
      corner = numbers[corner];
    }
    kept.triangles.push_back(triangle);
  }
  mesh = std::move(kept);
  vertices = std::move(kept_vertices);
}

// Whether all tiles of a level that touch the area exist.
bool IsCovered(const dem::ElevationModel& model, const AreaRequest& area, int level) {
  constexpr std::int64_t kMaxTiles = 1 << 16;  // tiles; levels that edits have added are small
  const double side = 180.0 / static_cast<double>(geo::TileRows(level));
  const auto at = [&](double degrees) { return static_cast<std::int64_t>(std::floor(degrees / side)); };
  const std::int64_t west = at(area.west + 180), east = at(area.east + 180), south = at(area.south + 90),
                     north = std::min(at(area.north + 90), geo::TileRows(level) - 1), around = geo::TileColumns(level);
  if ((east - west + 1) * (north - south + 1) > kMaxTiles) return false;
  for (std::int64_t y = south; y <= north; ++y) {
    for (std::int64_t x = west; x <= east; ++x) {
      if (!model.IsAvailable({level, (x % around + around) % around, y})) return false;
    }
  }
  return true;
}

}  // namespace

Result<AreaPlan> PlanArea(const dem::ElevationModel& model, double error_fraction, const AreaRequest& area,
                          std::size_t max_samples) {
  if (const Result<void> valid = CheckArea(area); !valid) return tl::unexpected(valid.error());
  const Result<AreaRequest> clipped =
      Clip(area, model.info().bounds, model.LatticeOf(model.max_source_level()).StepDegrees());
  if (!clipped) return tl::unexpected(clipped.error());
  AreaPlan plan;
  const auto is_coarse = [&] { return geo::DefaultError(plan.level, error_fraction) > area.error_m; };
  while (plan.level < model.max_source_level() && is_coarse()) ++plan.level;
  const auto nodes_at = [&](int level) { return NodesAt(model.LatticeOf(level), *clipped); };
  // Deeper levels exist around edits alone. An edit must not make an area too large.
  plan.depends_on_limit = plan.level < model.max_level() && is_coarse();
  while (plan.level < model.max_level() && is_coarse() &&
         ExceededLimits(nodes_at(plan.level + 1), max_samples).empty() && IsCovered(model, *clipped, plan.level + 1)) {
    ++plan.level;
  }
  const NodeCounts nodes = nodes_at(plan.level);
  if (!ExceededLimits(nodes, max_samples).empty()) {
    return TooLarge(model, error_fraction, *clipped, plan.level, max_samples);
  }
  plan.window = nodes.Window();
  plan.centre = {(clipped->west + clipped->east) / 2, (clipped->south + clipped->north) / 2};
  return plan;
}

Result<EncodedTile> BuildAreaMesh(const dem::ElevationModel& model, const AreaPlan& plan, const AreaRequest& area,
                                  std::stop_token stop) {
  const auto cancelled = [] { return MakeError(ErrorCode::kCancelled, "nobody waits for this mesh any more"); };
  EncodedTile encoded;
  Clock::time_point start = Clock::now();
  Result<std::vector<float>> heights = model.ReadNodes(plan.level, plan.window, stop);
  if (!heights) return tl::unexpected(std::move(heights).error());
  encoded.times.read = MicrosecondsSince(start);

  start = Clock::now();
  const auto field = tin::HeightField::Make(plan.window.columns, plan.window.rows, *std::move(heights));
  TERRACE_CHECK(field.has_value());  // every height is finite, and PlanArea limits the sides
  const AreaSurface surface(model.LatticeOf(plan.level), plan.window);
  tin::GreedyOptions options;
  if (area.coordinates != AreaCoordinates::kGeographic) surface.AddCurvature(options);
  dem::MeshDemands demands = dem::TileEdits(model).DemandsOf(plan.level, plan.window);
  options.limits = LimitsOf(demands);
  const tin::SampleLimits limits = options.limits;
  tin::GreedyTriangulation greedy(*field, std::move(options));
  const double bound_m =
      area.coordinates == AreaCoordinates::kGeographic ? area.error_m : std::min(area.error_m, kMaxSag_m);
  tin::GreedyGoal goal;
  goal.max_error = bound_m;
  if (!greedy.Run(goal, stop)) return cancelled();
  tin::TinMesh mesh = greedy.Mesh();
  encoded.times.refine = MicrosecondsSince(start);

  start = Clock::now();
  std::optional<Frame> frame;
  if (area.coordinates == AreaCoordinates::kEnu) frame = Frame::At(plan.centre);
  Result<PlacedMesh> placed = area.coordinates == AreaCoordinates::kGeographic
                                  ? PlaceFlat(*field, mesh, surface, stop)
                                  : PlaceInSpace(*field, mesh, surface, frame, bound_m, limits, stop);
  if (!placed || stop.stop_requested()) return cancelled();
  DropHoles(demands, plan.window.columns, mesh, placed->vertices);
  if (mesh.triangles.empty()) {
    return MakeError(ErrorCode::kInvalidArgument, "all of the area lies in a hole of the dataset's edits");
  }
  std::ostringstream out;
  if (auto written = proto::WriteMesh(out, area.format, std::move(placed->vertices), mesh.triangles, {}, {}, stop);
      !written) {
    return tl::unexpected(std::move(written).error());
  }
  encoded.bytes = std::move(out).str();
  encoded.times.encode = MicrosecondsSince(start);
  encoded.etag = StrongETag(encoded.bytes);
  encoded.max_error_m = placed->max_error_m;
  encoded.vertices = static_cast<std::uint32_t>(mesh.vertices.size());
  encoded.triangles = static_cast<std::uint32_t>(mesh.triangles.size());
  return encoded;
}

}  // namespace terrace::tiler
