// What is known of a raster grid without reading samples: bounds on heights by the block tables, boxes around holes,
// the members below a tile, and the content hash.
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "engine/geo/tile_cover.h"
#include "engine/mosaic/raster_grid.h"

namespace terrace::dem {
namespace {

// Up to this level, tiles are too large to bound their outline in the source's CRS from a few positions.
constexpr int kLastWholeLevel = 4;

// The pixels of a tile in a geographic grid: eastwards from the grid's western edge, and one turn before.
std::vector<Box> GeographicBoxes(const Georeference& georeference, const geo::Lattice& lattice,
                                 const geo::TileKey& key) {
  std::array<Position, 2> corners = {
      {{lattice.Longitude(lattice.FirstColumn(key)), lattice.Latitude(lattice.FirstRow(key))},
       {0, lattice.Latitude(lattice.FirstRow(key) + lattice.cells)}}};
  georeference.ToPixels(corners);
  const double columns = lattice.cells * lattice.StepDegrees() / 360 * georeference.period();
  const double west = georeference.columns_run_east() ? corners[0].x : corners[0].x - columns;
  const auto [north, south] = std::minmax(corners[0].y, corners[1].y);
  std::vector<Box> boxes;
  for (int turn = -1; turn <= 1; ++turn) {
    const double shifted = west + turn * georeference.period();
    boxes.push_back({shifted, north, shifted + columns, south});
  }
  return boxes;
}

// A box around a tile's pixels in any CRS; nothing if it is unknown.
std::optional<Box> ProjectedBox(const Georeference& georeference, const geo::Lattice& lattice,
                                const geo::TileKey& key) {
  if (key.level <= kLastWholeLevel) return std::nullopt;
  constexpr int kSteps = 4;
  std::array<Position, (kSteps + 1) * (kSteps + 1)> nodes;
  for (int i = 0; i < static_cast<int>(nodes.size()); ++i) {
    nodes[static_cast<std::size_t>(i)] = {
        lattice.Longitude(lattice.FirstColumn(key) + i % (kSteps + 1) * lattice.cells / kSteps),
        lattice.Latitude(lattice.FirstRow(key) + i / (kSteps + 1) * lattice.cells / kSteps)};
  }
  georeference.ToPixels(nodes);
  Box box{nodes[0].x, nodes[0].y, nodes[0].x, nodes[0].y};
  for (const Position& node : nodes) {
    if (std::isnan(node.x)) return std::nullopt;
    box.min_x = std::min(box.min_x, node.x);
    box.max_x = std::max(box.max_x, node.x);
    box.min_y = std::min(box.min_y, node.y);
    box.max_y = std::max(box.max_y, node.y);
  }
  // From level 5 down, the tile's edges deviate by less than an eighth of the tile between nodes that are a quarter of
  // it apart.
  box.Grow((box.max_x - box.min_x) / 8, (box.max_y - box.min_y) / 8);
  return box;
}

// Where the samples of a tile may lie in a raster grid, in pixels.
struct TileBoxes {
  std::vector<Box> boxes;
  bool leaves_columns = false;  // some may lie west or east of the grid
};

TileBoxes BoxesOf(const Georeference& georeference, const geo::Lattice& lattice, const geo::TileKey& key, int width,
                  int height, bool wraps) {
  const auto leaves = [&](const Box& box) { return box.min_x < 0 || box.max_x > width; };
  if (georeference.is_geographic_grid() && georeference.is_affine()) {
    TileBoxes tile{GeographicBoxes(georeference, lattice, key)};
    tile.leaves_columns = !wraps && std::ranges::all_of(tile.boxes, leaves);
    return tile;
  }
  if (const auto box = ProjectedBox(georeference, lattice, key)) return {{*box}, leaves(*box)};
  return {{{0, 0, static_cast<double>(width), static_cast<double>(height)}}, true};
}

}  // namespace

BlockRange RasterGrid::Ranges(const Box& pixels) const {
  if (!wraps_) return RangesInTurn(pixels);
  // Columns beyond an end are those at the other end.
  BlockRange range;
  const double turn = columns_;
  for (const double shift : {0.0, -turn, turn}) {
    const Box part{std::max(pixels.min_x + shift, 0.0), pixels.min_y, std::min(pixels.max_x + shift, turn),
                   pixels.max_y};
    if (part.min_x < part.max_x || (shift == 0 && part.min_x == part.max_x)) range.Add(RangesInTurn(part));
  }
  return range;
}

BlockRange RasterGrid::RangesInTurn(const Box& pixels) const {
  if (members_.size() == 1) {
    return members_.front().raster->RangeIn(pixels.min_x, pixels.min_y, pixels.max_x, pixels.max_y);
  }
  BlockRange range;
  const double turn = wraps_ ? columns_ : 0;
  for (const std::size_t i : member_index_.Find(pixels)) {
    for (const double shift : {0.0, -turn, turn}) {
      const double x = static_cast<double>(members_[i].column) + shift, y = static_cast<double>(members_[i].row);
      range.Add(members_[i].raster->RangeIn(pixels.min_x - x, pixels.min_y - y, pixels.max_x - x, pixels.max_y - y));
      if (turn == 0) break;
    }
  }
  const auto pixel = [](double position, int count) {
    return static_cast<std::int64_t>(std::clamp(std::floor(position), 0.0, count - 1.0));
  };
  const PixelRange wanted{pixel(pixels.min_x, width_), pixel(pixels.min_y, height_), pixel(pixels.max_x, width_),
                          pixel(pixels.max_y, height_)};
  range.has_voids |= !cover_.Covers(wanted);
  return range;
}

std::optional<Box> RasterGrid::BoxAroundHoles(const Box& pixels, int factor) const {
  Box box = pixels;
  const auto has_holes = [&](double west, double north, double east, double south) {
    const double halo = 2.0 * factor;  // an average by overviews may be void beside a hole
    const Box wide{west - halo, north - halo, east + halo, south + halo};
    return Ranges(wide).has_enclosed_voids || voids_.SharesHole(wide);
  };
  if (options_.holes != HoleFill::kSmooth || !has_holes(box.min_x, box.min_y, box.max_x, box.max_y)) {
    return std::nullopt;
  }
  // The holes end where a surrounding band has none.
  const auto grow = [&](double& side, double end, double step, bool holes) {
    if (!holes || (step < 0 ? side <= end : side >= end)) return false;
    side += step;
    return true;
  };
  const double west = wraps_ ? -columns_ : 0, east = wraps_ ? 2.0 * columns_ : width_;
  for (bool grown = true; grown;) {
    const double x = RangeTable::kBlock + (box.max_x - box.min_x) / 4,
                 y = RangeTable::kBlock + (box.max_y - box.min_y) / 4;
    const bool at_west = has_holes(box.min_x - x, box.min_y - y, box.min_x, box.max_y + y);
    const bool at_east = has_holes(box.max_x, box.min_y - y, box.max_x + x, box.max_y + y);
    const bool at_north = has_holes(box.min_x - x, box.min_y - y, box.max_x + x, box.min_y);
    const bool at_south = has_holes(box.min_x - x, box.max_y, box.max_x + x, box.max_y + y);
    grown = grow(box.min_x, west, -x, at_west);
    grown |= grow(box.max_x, east, x, at_east);
    grown |= grow(box.min_y, 0, -y, at_north);
    grown |= grow(box.max_y, height_, y, at_south);
  }
  // Holes are filled from averages beside them by at least the factor; large holes by factors up to a sixtieth of their
  // size. Includes a margin of averages, and the samples from which narrow voids beside the hole are filled.
  const double size = std::max(box.max_x - box.min_x, box.max_y - box.min_y);
  const double reach = 4 * std::max<double>(factor, size / 32) + options_.max_void_gap;
  box.Grow(reach, reach);
  return box;
}

std::vector<std::size_t> RasterGrid::MembersBelow(const geo::TileKey& top, const std::vector<geo::Lattice>& lattices,
                                                  int deepest) const {
  int factor = 1;
  for (int level = top.level; level <= deepest; ++level) {
    factor = std::max(factor, AveragingFactor(SamplesPerCell(lattices[static_cast<std::size_t>(level)], spacing_)));
  }
  const geo::Lattice& lattice = lattices[static_cast<std::size_t>(top.level)];
  std::vector<Box> boxes = BoxesOf(georeference_, lattice, top, width_, height_, wraps_).boxes;
  std::set<std::size_t> members;
  for (Box& box : boxes) {
    // Tiles have a halo of one node of at most a 32nd of their size. Interpolation, blocks of averages and the samples
    // at the rim of a window reach a dozen averages at most.
    constexpr double kHalo = 1.0 / 16;
    const double reach = 12 * factor + options_.max_void_gap + 2;
    const double feather = options_.feather_m > 0 ? Feather(factor) : 0;
    box.Grow((box.max_x - box.min_x) * kHalo + reach + feather / spacing_.east,
             (box.max_y - box.min_y) * kHalo + reach + feather / spacing_.north);
    const auto add = [&](const Box& in) {
      for (const std::size_t member : member_index_.Find(in)) members.insert(member);
    };
    add(box);
    // Averages by each factor have holes of their own.
    for (int f = 1; f <= factor; f *= 2) {
      if (const auto around = BoxAroundHoles(box, f)) add(*around);
    }
  }
  return {members.begin(), members.end()};
}

void RasterGrid::AddTo(ContentHasher& hasher) const {
  for (const int number : {width_, height_, columns_, alignment_, options_.max_void_gap}) hasher.Add(number);
  hasher.Add(wraps_);
  hasher.Add(static_cast<std::uint8_t>(options_.holes));
  for (const double number : {spacing_.east, spacing_.north, spacing_.finer, spacing_.latitude, reach_.west,
                              reach_.south, reach_.east, reach_.north, options_.feather_m}) {
    hasher.Add(number);
  }
  hasher.Add(spacing_.geographic);
  for (const auto& height : pole_heights_) {
    hasher.Add(height.has_value());
    hasher.Add(height.value_or(0));
  }
}

bool RasterGrid::MayBlend(const Box& pixels, int factor) const {
  Box wide = pixels;
  wide.Grow(Feather(factor) / spacing_.east + 2 * factor, Feather(factor) / spacing_.north + 2 * factor);
  return wide.min_y < 0 || wide.max_y > height_ || (!wraps_ && (wide.min_x < 0 || wide.max_x > width_)) ||
         Ranges(wide).has_voids;
}

GridRange RasterGrid::RangeOf(const geo::Lattice& lattice, const geo::TileKey& key) const {
  const double extent = lattice.cells * lattice.StepDegrees();
  const std::int64_t south_row = lattice.FirstRow(key), north_row = south_row + lattice.cells;
  GridRange range;
  bool leaves = false;
  for (const std::int64_t row : {south_row, north_row}) {
    if (row > 0 && row < lattice.rows()) continue;
    const auto pole = PoleHeight(row <= 0 ? 0 : 1, HeightDatum::kEllipsoid);
    if (pole) range.blocks.Add(*pole);
    leaves |= georeference_.is_geographic_grid() && !pole;
  }
  if (!reach_.Touches(lattice.Longitude(lattice.FirstColumn(key)), lattice.Latitude(south_row), extent, extent)) {
    return range;
  }
  const int factor = AveragingFactor(SamplesPerCell(lattice, spacing_));
  TileBoxes tile = BoxesOf(georeference_, lattice, key, width_, height_, wraps_);
  leaves |= tile.leaves_columns;
  BlockRange blocks;
  bool blends = false;
  for (Box& box : tile.boxes) {
    leaves |= box.min_y < 0 || box.max_y > height_;
    if (options_.feather_m > 0) {
      blends |= MayBlend(box, factor);
    }
    // Bilinear interpolation reaches one and a half samples of the grid.
    box.Grow(1.5 * factor + 1, 1.5 * factor + 1);
    BlockRange here = Ranges(box);
    if (here.has_voids) {
      if (const auto around = BoxAroundHoles(box, factor)) here.Add(Ranges(*around));
      box.Grow(options_.max_void_gap + factor, options_.max_void_gap + factor);
      here.Add(Ranges(box));
    }
    blocks.Add(here);
  }
  range.shows_others = leaves || blends || blocks.has_voids || (undulations_ && !undulations_->is_complete());
  if (undulations_ && blocks.min <= blocks.max) {
    const HeightRange shift =
        undulations_->RangeOf(lattice.Longitude(lattice.FirstColumn(key)), lattice.Latitude(south_row), extent, extent);
    // Widened, because sums are rounded to float.
    constexpr double kRounding = 0.01;
    blocks.min = static_cast<float>(blocks.min + shift.min - kRounding);
    blocks.max = static_cast<float>(blocks.max + shift.max + kRounding);
  }
  range.blocks.Add(blocks);
  return range;
}

HeightRange RasterGrid::EllipsoidalRange() const {
  if (!undulations_) return heights_;
  // Per tile, because the geoid's range over a large raster grid is too wide.
  constexpr std::int64_t kMaxTiles = 1024;
  constexpr int kDeepest = 12;
  const auto count = [&](int level) {
    std::int64_t sum = 0;
    for (const geo::TileRange& range : TilesOverlapping(reach_, level)) sum += geo::Cells(range);
    return sum;
  };
  int level = 0;
  while (level < kDeepest && count(level + 1) <= kMaxTiles) ++level;
  BlockRange blocks;
  for (const geo::TileRange& range : TilesOverlapping(reach_, level)) {
    for (std::int64_t y = range.start_y; y <= range.end_y; ++y) {
      for (std::int64_t x = range.start_x; x <= range.end_x; ++x) {
        blocks.Add(RangeOf(geo::Lattice{level, 64}, {level, x, y}).blocks);
      }
    }
  }
  return blocks.min <= blocks.max ? HeightRange{blocks.min, blocks.max} : heights_;
}

}  // namespace terrace::dem
