// Edits of a dataset: opening them, and their effect on what is read.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "engine/core/check.h"
#include "engine/crs/footprint.h"
#include "engine/crs/node_positions.h"
#include "engine/dem/corner_edges.h"
#include "engine/dem/dem_impl.h"
#include "engine/dem/tile_edits.h"
#include "engine/edits/edit_error_bound.h"
#include "engine/edits/edit_shape.h"
#include "engine/edits/read_edits.h"
#include "engine/gdal/stamped_files.h"
#include "engine/geo/mercator_grid.h"
#include "engine/raster/grid_cells.h"

namespace terrace::dem {
namespace {

bool Meets(const Box& box, const GeoBounds& bounds) {
  return Footprint::Of(bounds).Touches(box.min_x, box.min_y, box.max_x - box.min_x, box.max_y - box.min_y);
}

GeoPosition MiddleOf(const Edit& edit) { return {edit.plane.longitude, edit.plane.latitude}; }

// Latitude and longitude in each other's place.
Box Swapped(const Box& box) { return {box.min_y, box.min_x, box.max_y, box.max_x}; }

EditFault FaultOf(const Edit& edit, std::string message) {
  return {edit.file, edit.feature, MiddleOf(edit), std::move(message)};
}

// Rows at equal distances over all polygons of an edit, but not between them. Metres on its plane, ascending.
std::vector<double> RowsOver(const Edit& edit, int count) {
  std::vector<std::pair<double, double>> spans;  // south and north of each ring
  for (const auto& ring : edit.rings) {
    const auto [south, north] = std::ranges::minmax(ring, {}, &PlanPoint::y);
    spans.emplace_back(south.y, north.y);
  }
  std::ranges::sort(spans);
  std::vector<std::pair<double, double>> merged;
  double height_m = 0;
  for (const auto& [south, north] : spans) {
    if (!merged.empty() && south <= merged.back().second) {
      height_m += std::max(north - merged.back().second, 0.0);
      merged.back().second = std::max(merged.back().second, north);
    } else {
      height_m += north - south;
      merged.emplace_back(south, north);
    }
  }
  std::vector<double> rows;
  double below_m = 0;  // in the spans before
  for (const auto& [south, north] : merged) {
    for (auto j = static_cast<int>(rows.size()); j < count; ++j) {
      const double y = south + height_m * (j + 0.5) / count - below_m;
      if (y >= north) break;
      rows.push_back(y);
    }
    below_m += north - south;
  }
  return rows;
}

// About a thousand positions inside the polygons: equally far from one another along rows at equal distances.
std::vector<GeoPosition> PositionsInside(const Edit& edit) {
  constexpr int kRows = 32, kPositions = 1024;
  std::vector<EditRow> rows;
  double length_m = 0;  // of all parts of rows inside
  for (const double y : RowsOver(edit, kRows)) {
    rows.emplace_back(edit, y);
    const std::vector<double>& crossings = rows.back().crossings();
    for (std::size_t k = 0; k + 1 < crossings.size(); k += 2) length_m += crossings[k + 1] - crossings[k];
  }
  std::vector<GeoPosition> inside;
  const double step_m = length_m / kPositions;
  double next_m = step_m / 2;  // from the begin of a part
  for (const EditRow& row : rows) {
    const std::vector<double>& crossings = row.crossings();
    for (std::size_t k = 0; k + 1 < crossings.size(); k += 2) {
      const double part_m = crossings[k + 1] - crossings[k];
      for (; next_m < part_m; next_m += step_m) {
        const double longitude = edit.plane.longitude + (crossings[k] + next_m) / edit.plane.east_m;
        inside.push_back({std::remainder(longitude, 360), edit.plane.latitude + row.y() / edit.plane.north_m});
      }
      next_m -= part_m;
    }
  }
  return inside;
}

std::optional<double> FlatHeightOf(FlatHeight kind, std::vector<float> heights) {
  std::erase_if(heights, [](float height) { return std::isnan(height); });
  if (heights.empty()) return std::nullopt;
  if (kind == FlatHeight::kMean) {
    double sum = 0;
    for (const float height : heights) sum += static_cast<double>(height);
    return static_cast<double>(RoundHeight(sum / static_cast<double>(heights.size())));
  }
  std::ranges::sort(heights);
  return static_cast<double>(heights[heights.size() / 2]);
}

}  // namespace

Result<std::string> ElevationModel::Impl::ResolveEdit(Edit& edit, const DemOptions& options,
                                                      std::map<std::string, std::size_t>& opened) {
  if (!Meets(edit.reach, info.bounds)) {
    const bool is_swapped = Meets(Swapped(edit.reach), info.bounds);
    return fmt::format("lies outside of the data, which is {:.4f} to {:.4f} N, {:.4f} to {:.4f} E{}", info.bounds.south,
                       info.bounds.north, info.bounds.west, info.bounds.east,
                       is_swapped ? "; are the axes swapped? GeoJSON has [longitude, latitude]" : "");
  }
  if (edit.datum == EditDatum::kOrthometric) {
    if (auto wrong = AddUndulations(edit); !wrong || !wrong->empty()) return wrong;
  }
  if (edit.op == EditOp::kFlatten && edit.flat != FlatHeight::kGiven) return AddFlatHeight(edit, options.stop);
  if (edit.op == EditOp::kReplace) return OpenReplacement(edit, options, opened);
  return std::string();
}

Result<std::string> ElevationModel::Impl::AddFlatHeight(Edit& edit, const std::stop_token& stop) const {
  const std::vector<GeoPosition> inside = PositionsInside(edit);
  auto heights = PointsUnedited(inside, HeightDatum::kEllipsoid, stop);
  if (!heights) return tl::unexpected(std::move(heights).error());
  for (std::size_t k = 0; k < inside.size() && edit.undulations != nullptr; ++k) {
    const PlanPoint at{edit.plane.X(inside[k].longitude), edit.plane.Y(inside[k].latitude)};
    (*heights)[k] -= static_cast<float>(edit.undulations->At(at));
  }
  const auto height = FlatHeightOf(edit.flat, *std::move(heights));
  if (!height) return "there are no heights inside it to take the mean or median of; give a height";
  edit.height_m = *height;
  Complete(edit);
  return std::string();
}

Result<std::string> ElevationModel::Impl::OpenReplacement(Edit& edit, const DemOptions& options,
                                                          std::map<std::string, std::size_t>& opened) {
  const auto [known, is_new] = opened.emplace(edit.source_vertical + '\n' + edit.source, replacements.size());
  if (is_new) {
    DemOptions of_replacement;
    of_replacement.source = options.source;
    of_replacement.holes = HoleFill::kFloor;  // its voids show what is below, also narrow ones
    of_replacement.max_void_gap = 0;
    if (!edit.source_vertical.empty()) of_replacement.source.vertical = edit.source_vertical;
    of_replacement.cache = options.cache;
    of_replacement.stop = options.stop;
    auto model = ElevationModel::Open(edit.source, of_replacement);
    if (!model) {
      opened.erase(known);
      if (model.error().code == ErrorCode::kCancelled) return tl::unexpected(std::move(model).error());
      return fmt::format("its source: {}", model.error().message);
    }
    replacements.push_back(*std::move(model));
  }
  edit.replacement = known->second;
  const ElevationModel& model = *replacements[edit.replacement];
  edit.low_m = model.info().heights.min;
  edit.high_m = model.info().heights.max;
  const auto is_in = [&](HeightDatum datum) {
    const std::string geoid = GeoidIn(datum, model.impl_->grids.front().vertical());
    return model.impl_->AreHeightsAbove(geoid, datum, edit.reach) && AreHeightsAbove(geoid, datum, edit.reach);
  };
  edit.is_in_source_datum = is_in(HeightDatum::kSource);
  edit.is_in_orthometric = is_in(HeightDatum::kOrthometric);
  ContentHasher hasher;
  hasher.Add(edit.hash);
  hasher.Add(model.fingerprint());
  hasher.Add(edit.is_in_source_datum);
  edit.hash = hasher.Hash();
  return std::string();
}

// Faults are collected: of files, of features, and of features and the sources together.
Result<void> ElevationModel::Impl::OpenEdits(const DemOptions& options) {
  unedited_fingerprint = fingerprint;
  unedited_heights = info.heights;
  if (options.edits.empty()) return {};
  std::vector<Edit> read;
  std::vector<EditFault> faults;
  edit_files = StampedFiles(options.edits);
  for (const std::string& file : options.edits) ReadEdits(file, read, faults);
  std::map<std::string, std::size_t> opened;
  for (Edit& edit : read) {
    if (options.stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "stopped");
    auto wrong = ResolveEdit(edit, options, opened);
    if (!wrong) return tl::unexpected(std::move(wrong).error());
    if (!wrong->empty()) faults.push_back(FaultOf(edit, *std::move(wrong)));
  }
  if (const auto changed = edit_files.FirstChanged()) return tl::unexpected(ChangedError(*changed));
  if (!faults.empty()) return MakeError(ErrorCode::kInvalidArgument, "edits: {}", TextOf(faults));
  for (const auto& model : replacements) edit_files.Append(model->files());
  ContentHasher hasher;
  hasher.Add(unedited_fingerprint);
  hasher.Add(std::uint64_t{read.size()});
  std::vector<std::size_t> all;
  for (const Edit& edit : read) {
    hasher.Add(edit.hash);
    all.push_back(all.size());
  }
  fingerprint = hasher.Hash().low;
  edits = std::make_unique<const EditSet>(std::move(read));
  info.heights = edits->Extended(info.heights, all, [&](const Edit& edit) -> HeightRange {
    return {edit.low_m, edit.high_m};
  });
  info.edits = edits->edits().size();
  AddDeeperLevels(options.error_fraction);
  return {};
}

std::vector<std::size_t> ElevationModel::Impl::EditsAt(const geo::NodeGrid& node_grid, const NodeWindow& window) const {
  if (edits == nullptr) return {};
  return edits->Find(BoxOf(node_grid, window));
}

Result<void> ElevationModel::Impl::ApplyEdits(const geo::NodeGrid& node_grid, const NodeWindow& window,
                                              std::span<const std::size_t> which, const EditedDatum& datum,
                                              std::span<float> heights, const std::stop_token& stop,
                                              double* error_m) const {
  // Heights of a replacement, without its floor, so that its voids show what is below. Features with the same source
  // and datum share them.
  std::map<std::pair<std::size_t, HeightDatum>, ReplacementHeights> known;
  const auto replacement = [&](const Edit& edit) -> Result<const ReplacementHeights*> {
    const std::pair wanted(edit.replacement, edit.TargetDatum(datum.datum));
    if (const auto found = known.find(wanted); found != known.end()) return &found->second;
    const Impl& other = *replacements[edit.replacement]->impl_;
    std::vector<PartReading> readings;
    auto read =
        other.ReadGrids(node_grid, window, wanted.second, edit.source, stop, error_m != nullptr ? &readings : nullptr);
    if (!read) return tl::unexpected(std::move(read).error());
    ReplacementHeights result{*std::move(read), 0};
    if (const geo::Lattice* const lattice = node_grid.lattice(); lattice != nullptr && error_m != nullptr) {
      result.void_cells = other.VoidCells(*lattice, window, readings);
      TileHeights tile{*lattice, window.columns, result.heights};
      for (std::size_t k = 0; k < tile.heights.size(); ++k) {
        if (std::isnan(tile.heights[k])) tile.heights[k] = heights[k];
      }
      // The samples of the sources lie between those of the replacement, and are compared with its heights there.
      const auto bound = other.BoundError(tile, window, std::move(readings), stop, /*counts_between=*/true);
      if (!bound) return tl::unexpected(bound.error());
      result.error_m = *bound;
    }
    return &known.emplace(wanted, std::move(result)).first->second;
  };
  return edits->Apply(node_grid, window, which, datum, heights, replacement, stop, error_m);
}

// Where there is no height, an edit whose weight is 1 makes one if `datum` is kEllipsoid; in other datums it stays
// void.
Result<void> ElevationModel::Impl::EditPoints(std::span<const GeoPosition> points, HeightDatum datum,
                                              std::span<float> heights, const std::stop_token& stop) const {
  std::vector<std::size_t> edited;
  std::vector<std::vector<std::size_t>> which;
  const auto is_stopped = [&](std::size_t point) { return point % 64 == 0 && stop.stop_requested(); };
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (is_stopped(i)) return MakeError(ErrorCode::kCancelled, "stopped");
    const double x = std::remainder(points[i].longitude, 360.0), y = points[i].latitude;
    if (auto found = edits->Find({x, y, x, y}); !found.empty()) {
      edited.push_back(i);
      which.push_back(std::move(found));
    }
  }
  if (edited.empty()) return {};
  std::vector<GeoPosition> at;
  for (const std::size_t i : edited) at.push_back(points[i]);
  std::vector<float> above;
  if (datum != HeightDatum::kEllipsoid) {
    auto read = PointsUnedited(at, HeightDatum::kEllipsoid, stop);
    if (!read) return tl::unexpected(std::move(read).error());
    above = *std::move(read);
  }
  std::map<std::pair<std::size_t, HeightDatum>, std::vector<float>> others;  // by replacement and datum
  const auto of = [&](const Edit& edit) { return std::pair(edit.replacement, edit.TargetDatum(datum)); };
  for (std::size_t k = 0; k < at.size(); ++k) {
    for (const std::size_t number : which[k]) {
      const Edit& edit = edits->edits()[number];
      if (edit.op != EditOp::kReplace || others.contains(of(edit))) continue;
      auto read = replacements[edit.replacement]->ReadPoints(at, of(edit).second, stop);
      if (!read) return tl::unexpected(std::move(read).error());
      others[of(edit)] = *std::move(read);
    }
  }
  EditRows rows;
  for (std::size_t k = 0; k < at.size(); ++k) {
    if (is_stopped(k)) return MakeError(ErrorCode::kCancelled, "stopped");
    const auto height = static_cast<double>(heights[edited[k]]);
    if (!above.empty() && std::isnan(height)) continue;
    const double zero = above.empty() ? 0 : static_cast<double>(above[k]) - height;
    heights[edited[k]] = static_cast<float>(edits->ApplyAt(
        at[k], which[k], {datum, std::span(&zero, 1)}, height,
        [&](const Edit& edit) { return static_cast<double>(others.at(of(edit))[k]); }, rows));
  }
  return {};
}

HeightRange ElevationModel::Impl::RangeOfReplacement(const Edit& edit, const geo::Lattice& lattice,
                                                     const geo::TileKey& key) const {
  return replacements[edit.replacement]->impl_->UneditedRange(lattice, key);
}

std::uint64_t ElevationModel::unedited_fingerprint() const { return impl_->unedited_fingerprint; }

MeshDemands TileEdits::DemandsOf(const geo::TileKey& key) const {
  TERRACE_CHECK(geo::IsValid(key));
  if (model_.edits == nullptr) return {};
  const geo::Lattice& lattice = model_.LatticeOf(key.level);
  const NodeWindow window{lattice.FirstColumn(key), lattice.FirstRow(key), lattice.cells + 1, lattice.cells + 1};
  // With the halo: both neighbours must find a line beside the edge that passes nodes of the edge.
  const auto which = model_.EditsAt(lattice, WindowOfTile(lattice, key));
  if (which.empty()) return {};
  return model_.edits->DemandsOf(lattice, window, which);
}

MeshDemands TileEdits::DemandsOf(int level, const NodeWindow& window) const {
  if (model_.edits == nullptr) return {};
  const geo::Lattice& lattice = model_.LatticeOf(level);
  const auto which = model_.EditsAt(lattice, {window.column - 1, window.row - 1, window.columns + 2, window.rows + 2});
  if (which.empty()) return {};
  return model_.edits->DemandsOf(lattice, window, which);
}

std::array<std::vector<MeshDemands>, 4> TileEdits::DemandsBeyondCorners(const geo::TileKey& key) const {
  std::array<std::vector<MeshDemands>, 4> demands;
  if (model_.edits == nullptr) return demands;
  const auto edges = EdgesBeyondCorners(model_.LatticeOf(key.level), key);
  for (std::size_t corner = 0; corner < edges.size(); ++corner) {
    for (const NodeWindow& edge : edges[corner]) demands[corner].push_back(DemandsOf(key.level, edge));
  }
  return demands;
}

std::uint64_t TileEdits::Hash(const geo::TileKey& key) const {
  if (model_.edits == nullptr || !geo::IsValid(key) || key.level > geo::kMaxLevel) return 0;
  return model_.ComputeEditsHash(key);
}

std::uint64_t TileEdits::MercatorHash(int depth, const NodeWindow& window) const {
  if (model_.edits == nullptr) return 0;
  const geo::MercatorGrid grid{depth};
  if (!model_.edits->Any(BoxOf(grid, window))) return 0;
  const ElevationModel::Impl::HashKey memo_key = {depth, window.column, window.row, window.columns, window.rows};
  if (const auto known = model_.KnownHash(memo_key)) return *known;
  ContentHasher hasher;
  for (const std::size_t number : model_.EditsAt(grid, window)) hasher.Add(model_.edits->edits()[number].hash);
  const std::uint64_t hash = hasher.Hash().low | 1;
  model_.KeepHash(memo_key, hash);
  return hash;
}

std::optional<std::uint64_t> ElevationModel::Impl::KnownHash(const HashKey& key) const {
  const std::lock_guard lock(hashes_mutex);
  const auto known = hashes.find(key);
  return known != hashes.end() ? std::optional(known->second) : std::nullopt;
}

void ElevationModel::Impl::KeepHash(const HashKey& key, std::uint64_t hash) const {
  constexpr std::size_t kMaxHashes = std::size_t{1} << 18;
  const std::lock_guard lock(hashes_mutex);
  if (hashes.size() >= kMaxHashes) hashes.clear();
  hashes.emplace(key, hash);
}

void ElevationModel::Impl::AddPrecisionBeyondCorners(const geo::TileKey& key, std::set<std::size_t>& found) const {
  const geo::Lattice& lattice = LatticeOf(key.level);
  for (const auto& edges : EdgesBeyondCorners(lattice, key)) {
    for (const NodeWindow& edge : edges) {
      for (const std::size_t number : EditsAt(lattice, edge)) {
        const Edit& edit = edits->edits()[number];
        if (edit.op == EditOp::kPrecision && key.level >= edit.min_level) found.insert(number);
      }
    }
  }
}

// The edits that reach the tile's samples or their halo. The height steps of common edges and corners depend on the
// ranges of neighbours that edits have changed, and on the precision on edges beyond the corners
// (proto/mesh/edge_steps.h).
std::uint64_t ElevationModel::Impl::ComputeEditsHash(const geo::TileKey& key) const {
  const geo::Lattice& lattice = LatticeOf(key.level);
  const bool is_polar = key.y == 0 || key.y == geo::TileRows(key.level) - 1;
  const bool is_range_edited = unedited_heights.min != info.heights.min || unedited_heights.max != info.heights.max;
  NodeWindow around = WindowOfTile(lattice, key);
  around.column -= lattice.cells;
  around.columns += 2 * lattice.cells;
  const std::int64_t first = std::max<std::int64_t>(around.row - lattice.cells, 0);
  const std::int64_t last = std::min(around.row + around.rows + lattice.cells, lattice.rows() + 1);
  around.row = first;
  around.rows = static_cast<int>(last - first);
  Box box = BoxOf(lattice, around);
  box.Grow(1e-8, 1e-8);  // contains the boxes of all nine tiles, whose corners are rounded in other ways
  const bool is_alone = !edits->Any(box);
  if (is_alone && !(is_polar && is_range_edited)) return 0;
  const HashKey memo_key = {key.level, key.x, key.y, 0, 0};
  if (const auto known = KnownHash(memo_key)) return *known;
  ContentHasher hasher;
  const std::vector<std::size_t> own = EditsAt(lattice, WindowOfTile(lattice, key));
  for (const std::size_t number : own) hasher.Add(edits->edits()[number].hash);
  std::set<std::size_t> beyond;
  AddPrecisionBeyondCorners(key, beyond);
  for (const std::size_t number : own) beyond.erase(number);
  for (const std::size_t number : beyond) hasher.Add(edits->edits()[number].hash);
  bool is_touched = !own.empty() || !beyond.empty();
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const geo::TileKey neighbour = geo::Neighbour(key, dx, dy);
      if ((dx == 0 && dy == 0) || neighbour.y < 0 || neighbour.y >= geo::TileRows(key.level)) continue;
      const auto which = EditsAt(lattice, WindowOfTile(lattice, neighbour));
      if (which.empty()) continue;
      const HeightRange before = UneditedRange(lattice, neighbour);
      const HeightRange after = edits->Extended(
          before, which, [&](const Edit& edit) { return RangeOfReplacement(edit, lattice, neighbour); });
      if (after.min == before.min && after.max == before.max) continue;
      is_touched = true;
      for (const double value : {double(dx), double(dy), after.min, after.max}) hasher.Add(value);
    }
  }
  if (is_polar && is_range_edited) {
    is_touched = true;
    hasher.Add(info.heights.min);
    hasher.Add(info.heights.max);
  }
  const std::uint64_t hash = is_touched ? hasher.Hash().low | 1 : 0;
  KeepHash(memo_key, hash);
  return hash;
}

std::vector<EditOutline> TileEdits::Outlines() const {
  std::vector<EditOutline> outlines;
  if (model_.edits == nullptr) return outlines;
  for (const Edit& edit : model_.edits->edits()) {
    EditOutline& outline = outlines.emplace_back();
    outline.op = NameOf(edit.op);
    outline.is_area = edit.is_area;
    outline.file = edit.file;
    outline.feature = edit.feature;
    for (const auto& ring : edit.rings) {
      auto& line = outline.lines.emplace_back();
      // One part of a feature may be across the antimeridian from the plane's origin.
      const auto [west, east] = std::ranges::minmax(ring, {}, &PlanPoint::x);
      const double middle = edit.plane.longitude + (west.x + east.x) / 2 / edit.plane.east_m;
      const double turn = std::remainder(middle, 360) - middle;
      for (const PlanPoint point : ring) {
        const double longitude = edit.plane.longitude + point.x / edit.plane.east_m + turn;
        line.push_back({std::clamp(longitude, -180.0, 180.0), edit.plane.latitude + point.y / edit.plane.north_m});
      }
      if (edit.is_area) line.push_back(line.front());
    }
  }
  return outlines;
}

}  // namespace terrace::dem
