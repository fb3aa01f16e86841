#include "engine/crs/geoid.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <new>
#include <numbers>
#include <optional>
#include <random>
#include <sstream>
#include <string_view>
#include <system_error>

#include "engine/core/plain_number.h"
#include "engine/crs/proj_handle.h"

namespace terrace::dem {
namespace {

constexpr double kNoAnswer = std::numeric_limits<double>::quiet_NaN();

// The vertical part of a reference system; null: none.
ProjObjectPtr VerticalPart(PJ_CONTEXT* context, const std::string& text) {
  ProjObjectPtr crs(proj_create(context, text.c_str()));
  if (crs != nullptr && proj_get_type(crs.get()) == PJ_TYPE_COMPOUND_CRS) {
    crs.reset(proj_crs_get_sub_crs(context, crs.get(), 1));
  }
  if (crs != nullptr && proj_get_type(crs.get()) == PJ_TYPE_BOUND_CRS) {
    crs.reset(proj_get_source_crs(context, crs.get()));
  }
  return crs != nullptr && proj_get_type(crs.get()) == PJ_TYPE_VERTICAL_CRS ? std::move(crs) : nullptr;
}

std::string UnitOf(PJ_CONTEXT* context, const PJ* vertical) {
  const ProjObjectPtr axes(proj_crs_get_coordinate_system(context, vertical));
  const char* unit = nullptr;
  if (axes == nullptr ||
      proj_cs_get_axis_info(context, axes.get(), 0, nullptr, nullptr, nullptr, nullptr, &unit, nullptr, nullptr) == 0) {
    return "";
  }
  return unit == nullptr ? "" : unit;
}

std::string Wkt(PJ_CONTEXT* context, const PJ* crs) {
  const char* text = crs == nullptr ? nullptr : proj_as_wkt(context, crs, PJ_WKT2_2019, nullptr);
  return text == nullptr ? "" : text;
}

// Operations from heights of that system, at WGS 84 positions, to ellipsoidal heights: the best first, without ballpark
// operations.
ProjListPtr OperationsFrom(PJ_CONTEXT* context, const PJ* vertical) {
  const ProjObjectPtr wgs84(proj_create(context, "EPSG:4326")), ellipsoidal(proj_create(context, "EPSG:4979"));
  const std::string text =
      fmt::format("COMPOUNDCRS[\"heights\",{},{}]", Wkt(context, wgs84.get()), Wkt(context, vertical));
  const ProjObjectPtr compound(proj_create(context, text.c_str()));
  const ProjFactoryPtr factory(proj_create_operation_factory_context(context, nullptr));
  if (compound == nullptr || ellipsoidal == nullptr || factory == nullptr) return nullptr;
  proj_operation_factory_context_set_allow_ballpark_transformations(context, factory.get(), 0);
  proj_operation_factory_context_set_spatial_criterion(context, factory.get(),
                                                       PROJ_SPATIAL_CRITERION_PARTIAL_INTERSECTION);
  proj_operation_factory_context_set_grid_availability_use(context, factory.get(), PROJ_GRID_AVAILABILITY_IGNORED);
  return ProjListPtr(proj_create_operations(context, compound.get(), ellipsoidal.get(), factory.get()));
}

// The longitude in -180 .. 180, as areas of use and PROJ require.
double WithinOneTurn(double longitude) { return std::remainder(longitude, 360); }

geo::GeoBounds AreaOf(PJ_CONTEXT* context, const PJ* operation) {
  geo::GeoBounds area, told;
  if (proj_get_area_of_use(context, operation, &told.west, &told.south, &told.east, &told.north, nullptr) == 0 ||
      told.west < -180) {  // it is not known
    return area;
  }
  return told;
}

std::string HowToGet(const ProjGrid& grid) {
  // The name is EPSG's, not that of a file.
  if (grid.url.empty()) return fmt::format("its grid {} is none that PROJ has a file for", grid.name);
  return fmt::format(
      "its grid {} is not installed: get {} and put it into a folder of PROJ's (/usr/share/proj, or one "
      "that PROJ_DATA names)",
      grid.name, grid.url);
}

std::string PipelineOf(PJ_CONTEXT* context, const PJ* operation) {
  // Longitude first, in degrees.
  const ProjObjectPtr ordered(proj_normalize_for_visualization(context, operation));
  const char* text = ordered == nullptr ? nullptr : proj_as_proj_string(context, ordered.get(), PJ_PROJ_5, nullptr);
  return text == nullptr ? "" : text;
}

// Converts a height above the geoid to a height above the ellipsoid.
double HeightAt(const ProjOperation& operation, Position degrees, double height) {
  const PJ_COORD at = proj_coord(WithinOneTurn(degrees.x), degrees.y, height, HUGE_VAL);
  const PJ_COORD result = proj_trans(operation.operation.get(), PJ_FWD, at);
  return std::isfinite(result.xyz.z) ? result.xyz.z : kNoAnswer;
}

// Whether a pipeline only shifts heights by one grid and changes units and the order of axes.
bool IsShiftByOneGrid(const std::string& pipeline) {
  std::istringstream words(pipeline);
  int shifts = 0;
  for (std::string word; words >> word;) {
    if (word.starts_with('+')) word.erase(0, 1);
    if (!word.starts_with("proj=")) continue;
    if (word == "proj=vgridshift") {
      ++shifts;
    } else if (word != "proj=pipeline" && word != "proj=unitconvert" && word != "proj=axisswap") {
      return false;
    }
  }
  return shifts == 1;
}

// Compares the grid with PROJ in cells at all edges and corners and in others, because PROJ defines what the grid's
// numbers mean.
bool Agrees(const UndulationGrid& grid, const ProjOperation& operation) {
  constexpr int kCells = 96;
  constexpr double kTolerance = 1e-6;  // metres
  std::mt19937 random(1);
  int known = 0;
  for (int i = 0; i < kCells; ++i) {
    const auto pick = [&random](int count, int edge) {
      const auto inside = static_cast<int>(random() % static_cast<unsigned>(count));
      return edge == 0 ? 0 : edge == 1 ? count - 1 : inside;
    };
    const int cells = grid.wraps() ? grid.columns() : grid.columns() - 1;
    const double column = pick(cells, i % 4) + 0.3, row = pick(grid.rows() - 1, i / 4 % 4) + 0.6;
    const AxisPosition x = grid.AtColumn(column), y = grid.AtRow(row);
    const auto patch = UndulationPatch::Read(grid, {&x, 1}, {&y, 1});
    if (!patch) return false;
    const double here = patch->At(x, y), there = HeightAt(operation, grid.DegreesOf(column, row), 0);
    known += std::isnan(here) ? 0 : 1;
    if (std::isnan(here) != std::isnan(there) || std::abs(here - there) > kTolerance) return false;
  }
  return known > 0;
}

// Returns 0 if unknown.
double CellOf(const std::string& file) {
  const PJ_GRID_INFO info = proj_grid_info(file.c_str());
  const double cell = std::min(info.cs_lon, info.cs_lat) * 180 / std::numbers::pi;
  return cell > 0 ? cell : 0;
}

}  // namespace

std::optional<std::string> NameOfDepths(const std::string& vertical_crs) {
  const ProjContextPtr context = MakeProjContext();
  const ProjObjectPtr vertical = VerticalPart(context.get(), vertical_crs);
  if (vertical == nullptr) return std::nullopt;
  const ProjObjectPtr axes(proj_crs_get_coordinate_system(context.get(), vertical.get()));
  const char* direction = nullptr;
  if (axes == nullptr || proj_cs_get_axis_info(context.get(), axes.get(), 0, nullptr, nullptr, &direction, nullptr,
                                               nullptr, nullptr, nullptr) == 0) {
    return std::nullopt;
  }
  if (direction == nullptr || std::string_view(direction) != "down") return std::nullopt;
  const char* const name = proj_get_name(vertical.get());
  return name == nullptr ? "unnamed" : name;
}

bool Covers(const geo::GeoBounds& area, Position degrees) {
  const auto& [west, south, east, north] = area;
  const double longitude = WithinOneTurn(degrees.x);
  const bool between = west <= east ? longitude >= west && longitude <= east : longitude >= west || longitude <= east;
  return between && degrees.y >= south && degrees.y <= north;
}

void Geoid::FindGrid() {
  finest_cell_ = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < files_.size(); ++i) finest_cell_ = std::min(finest_cell_, CellOf(files_.path(i)));
  if (files_.size() != 1 || !IsShiftByOneGrid(pipeline())) return;
  std::shared_ptr<const UndulationGrid> grid = UndulationGrid::Open(files_.path(0));
  const IdlePool<ProjOperation>::Handle operation = operations_.Borrow();
  if (!operation) return;
  if (grid != nullptr && Agrees(*grid, *operation)) {
    finest_cell_ = std::min(grid->column_step(), grid->row_step());
    grid_ = std::move(grid);
  }
}

// Most height systems have one operation for the whole Earth, which thousands of sources share; PROJ takes about 20 ms
// to look it up. Failures are not cached, because a missing grid may be installed later. Stores `made` if it is not
// null. Null: none is stored, or its grid has changed.
std::shared_ptr<const Geoid> Geoid::FindOrShare(const std::string& vertical_crs, std::shared_ptr<const Geoid> made) {
  static std::mutex mutex;
  // Never destroyed: at the end of the process, what GDAL and PROJ need to free their objects may be gone.
  static auto& shared = *new std::map<std::string, std::shared_ptr<const Geoid>>;
  const std::lock_guard lock(mutex);
  if (made != nullptr) return shared.insert_or_assign(vertical_crs, std::move(made)).first->second;
  const auto found = shared.find(vertical_crs);
  // A replaced grid is read again.
  return found == shared.end() || found->second->files_.FirstChanged() ? nullptr : found->second;
}

Result<std::shared_ptr<const Geoid>> Geoid::OfCrs(const std::string& vertical_crs, Position centre) {
  if (auto known = FindOrShare(vertical_crs, nullptr); known && Covers(known->area_, centre)) {
    return Checked(std::move(known), centre);
  }
  const ProjContextPtr context = MakeProjContext();
  const ProjObjectPtr vertical = VerticalPart(context.get(), vertical_crs);
  if (vertical == nullptr) {
    return MakeError(ErrorCode::kInvalidArgument, "\"{}\" is no vertical reference system that PROJ knows",
                     vertical_crs);
  }
  const char* name = proj_get_name(vertical.get());
  const std::shared_ptr<Geoid> geoid(new Geoid);
  geoid->name_ = name == nullptr ? "unnamed" : name;
  geoid->unit_ = UnitOf(context.get(), vertical.get());
  const ProjListPtr operations = OperationsFrom(context.get(), vertical.get());
  const int count = operations == nullptr ? 0 : proj_list_get_count(operations.get());
  std::string missing;  // of the best operation that is not available
  for (int i = 0; i < count; ++i) {
    const ProjObjectPtr operation(proj_list_get(context.get(), operations.get(), i));
    geoid->area_ = AreaOf(context.get(), operation.get());
    if (!Covers(geoid->area_, centre)) continue;
    const std::vector<ProjGrid> grids = GridsOf(context.get(), operation.get());
    const auto absent = std::ranges::find_if(grids, [](const ProjGrid& grid) { return grid.file.empty(); });
    if (absent != grids.end()) {
      if (missing.empty()) missing = HowToGet(*absent);
      continue;
    }
    geoid->operations_.set_pipeline(PipelineOf(context.get(), operation.get()));
    if (geoid->pipeline().empty()) continue;
    const PJ_PROJ_INFO info = proj_pj_info(operation.get());
    geoid->description_ = info.description == nullptr ? geoid->pipeline() : info.description;
    std::vector<std::string> files;
    for (const ProjGrid& grid : grids) files.push_back(grid.file);
    geoid->files_ = StampedFiles(files);
    geoid->FindGrid();
    auto checked = Checked(geoid, centre);
    if (checked && count == 1) FindOrShare(vertical_crs, *checked);
    return checked;
  }
  return MakeError(ErrorCode::kInvalidArgument, "{} cannot be converted to ellipsoidal heights: {}", geoid->name_,
                   missing.empty()
                       ? "PROJ knows no way from there to WGS 84 at the centre of the source; if the source names a "
                         "geoid grid, give that grid's file as `vertical`"
                       : missing);
}

Result<std::shared_ptr<const Geoid>> Geoid::OfGrid(const std::string& path, Position centre) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) {
    return MakeError(ErrorCode::kNotFound, "geoid grid {} is no file that can be read", path);
  }
  if (path.find_first_of(",\"\\") != std::string::npos) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "geoid grid {}: commas, quotes and backslashes in its name mean something else to PROJ; rename it",
                     path);
  }
  const std::shared_ptr<Geoid> geoid(new Geoid);
  geoid->name_ = std::filesystem::path(path).filename().string();
  geoid->description_ = "undulations of " + path;
  geoid->files_ = StampedFiles({path});
  geoid->is_of_file_ = true;
  geoid->operations_.set_pipeline(
      fmt::format("+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=vgridshift +grids=\"{}\" "
                  "+multiplier=1 +step +proj=unitconvert +xy_in=rad +xy_out=deg",
                  std::filesystem::absolute(path, ignored).string()));
  geoid->FindGrid();
  auto checked = Checked(geoid, centre);
  if (!checked) return checked;
  const double undulation = Reader(*geoid).At(centre);
  constexpr double kMaxUndulation = 200;  // metres; on Earth -107 to 86
  if (std::abs(undulation) > kMaxUndulation) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "{}: its value at the centre of the source is {} m; undulations are from -107 to 86 m: give a grid "
        "of undulations in metres",
        path, PlainNumber(undulation, 2));
  }
  return checked;
}

Result<void> Geoid::AddTo(ContentHasher& hasher, const FileContentOptions& options) const {
  const auto grids = HashFiles(files_, options);
  if (!grids) return tl::unexpected(grids.error());
  hasher.AddText(is_of_file_ ? "a grid" : pipeline());
  hasher.Add(*grids);
  return {};
}

// Operations that cannot be evaluated, and systems of depths, are found here, not while a tile is built.
Result<std::shared_ptr<const Geoid>> Geoid::Checked(std::shared_ptr<const Geoid> geoid, Position centre) {
  const IdlePool<ProjOperation>::Handle operation = geoid->operations_.Borrow();
  if (!operation) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: PROJ cannot read its grid ({}); check it with `gdalinfo {}`",
                     geoid->name_, geoid->description_, geoid->files_.size() == 0 ? "" : geoid->files_.path(0));
  }
  const double base = HeightAt(*operation, centre, 0), above = HeightAt(*operation, centre, 1);
  if (std::isnan(base)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{} is not known at the centre of the source, {} degrees east and {} north", geoid->name_,
                     PlainNumber(centre.x), PlainNumber(centre.y));
  }
  if (above < base) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: PROJ's operation for it turns heights upside down; name another `vertical`", geoid->name_);
  }
  return geoid;
}

Geoid::Reader::Reader(const Geoid& geoid) : operation_(geoid.operations_.Borrow()) {
  // The operation was created before, so memory or descriptors have run out; the caller's read fails.
  if (!operation_) throw std::bad_alloc();
}

double Geoid::Reader::At(Position degrees) const { return HeightAt(*operation_, degrees, 0); }

}  // namespace terrace::dem
