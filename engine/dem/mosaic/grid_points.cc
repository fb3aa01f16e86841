// Reads heights at single points, at full resolution, with voids filled as in tiles. Points are read in the order of
// the source's blocks: neighbours share a read, and no block is decoded twice.
#include <algorithm>
#include <cmath>
#include <tuple>

#include "engine/dem/mosaic/raster_grid.h"
#include "engine/dem/raster/grid_cells.h"

namespace terrace::dem {
namespace {

// Samples per axis in one read.
constexpr std::int64_t kBlock = 256;
// Points between two checks of the stop token.
constexpr std::size_t kBatch = 1024;

struct PointCell {
  std::size_t point;
  std::int64_t block_column, block_row;
  GridCell cell;
};

// Converts from a source's vertical datum to the requested one.
class Conversion {
 public:
  static Result<Conversion> For(const VerticalDatum& source, HeightDatum wanted) {
    Conversion conversion;
    if (wanted == HeightDatum::kEllipsoid && source.geoid) {
      conversion.geoid_ = source.geoid;
      conversion.sign_ = 1;
    } else if (wanted == HeightDatum::kOrthometric && source.is_known() && !source.geoid) {
      auto egm96 = Geoid::OfCrs("EPSG:5773", {0, 0});
      if (!egm96) return tl::unexpected(egm96.error());
      conversion.geoid_ = *std::move(egm96);
      conversion.sign_ = -1;
    }
    if (conversion.geoid_) conversion.reader_ = std::make_unique<Geoid::Reader>(*conversion.geoid_);
    return conversion;
  }

  // NaN if the geoid is not known.
  double Of(double height, const GeoPosition& point) const {
    return reader_ ? height + sign_ * reader_->At({point.longitude, point.latitude}) : height;
  }

 private:
  std::shared_ptr<const Geoid> geoid_;  // null: none needed
  std::unique_ptr<Geoid::Reader> reader_;
  double sign_ = 0;
};

}  // namespace

Result<void> RasterGrid::FillPoints(std::span<const GeoPosition> points, HeightDatum datum, const NodeHeights& nodes,
                                    std::span<std::uint8_t> filled, const std::stop_token& stop) const {
  const std::span<float> heights = nodes.heights;
  const auto converted = Conversion::For(vertical(), datum);
  if (!converted) return tl::unexpected(converted.error());
  const GridAxes axes = Axes(1);
  std::vector<PointCell> found;
  std::vector<Position> batch;
  for (std::size_t done = 0; done < points.size(); done += batch.size()) {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "reading points was stopped");
    batch.clear();
    for (const GeoPosition& point : points.subspan(done, std::min(kBatch, points.size() - done))) {
      batch.push_back({point.longitude, point.latitude});
    }
    georeference_.ToPixels(batch);
    const std::vector<std::uint8_t> inside = cover_.Inside(batch);
    for (std::size_t i = 0; i < batch.size(); ++i) {
      if (inside[i] == 0 || !std::isnan(heights[done + i])) continue;
      const GridCell cell = axes.CellAt(batch[i]);
      found.push_back({done + i, (cell.column + kBlock) / kBlock, cell.row / kBlock, cell});
    }
  }
  if (found.empty()) return CheckUnread();
  std::ranges::sort(found, {}, [](const PointCell& p) { return std::tuple(p.block_row, p.block_column, p.point); });

  std::vector<GridCell> cells;
  for (auto first = found.begin(); first != found.end();) {
    const auto end = std::find_if(first, found.end(), [&](const PointCell& p) {
      return p.block_column != first->block_column || p.block_row != first->block_row;
    });
    cells.clear();
    for (auto p = first; p != end; ++p) cells.push_back(p->cell);
    const GridWindow window = WindowOf(cells, axes);
    std::vector<float> measured;
    const auto bridged = ReadBridged(1, window, stop, &measured);
    if (!bridged) return tl::unexpected(bridged.error());
    const auto smoothed = FillHoles(1, window, *bridged, stop);
    if (!smoothed) return tl::unexpected(smoothed.error());
    const std::vector<float>& samples = smoothed->empty() ? bridged->heights : *smoothed;
    for (std::size_t i = 0; first != end; ++first, ++i) {
      const auto height = Interpolate(samples, window, cells[i]);
      if (!height) continue;
      const float rounded = RoundHeight(converted->Of(*height, points[first->point]));
      const bool is_in_hole = !HasSample(bridged->heights, window, cells[i]);
      (is_in_hole ? nodes.smooth : heights)[first->point] = rounded;
      filled[first->point] = is_in_hole || !IsNearestValid(measured, window, cells[i]) ? 1 : 0;
    }
  }
  return {};
}

}  // namespace terrace::dem
