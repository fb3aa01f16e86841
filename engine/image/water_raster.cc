#include "engine/image/water_raster.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/common/source_log.h"
#include "engine/core/check.h"
#include "engine/crs/footprint.h"
#include "engine/crs/georeference.h"
#include "engine/crs/level_plan.h"
#include "engine/crs/node_positions.h"
#include "engine/gdal/handle_pool.h"
#include "engine/gdal/raster_file.h"
#include "engine/gdal/sample_rules.h"
#include "engine/gdal/stamped_files.h"
#include "engine/raster/grid_cells.h"
#include "engine/raster/raster_layout.h"
#include "engine/sources/located_raster.h"

namespace terrace::dem {
namespace {

// In samples of the grid that is read: much less than is visible with 8 bits.
constexpr double kWaterPositionTolerance = 1e-3;

}  // namespace

class WaterRaster::Impl {
 public:
  Impl(std::string path_of_file, StampedFiles files, Georeference where)
      : path(std::move(path_of_file)), handles(path, std::move(files)), georeference(std::move(where)) {}

  const std::string path;
  HandlePool handles;
  const Georeference georeference;
  SourceSpacing spacing;
  RasterLayout layout;
  Footprint footprint;  // padded; there is no water outside
  std::uint64_t fingerprint = 0;

  bool IsInside(const Position& position) const {  // false for NaN
    const bool row = position.y >= 0 && position.y <= layout.height;
    return row && (layout.wraps ? !std::isnan(position.x) : position.x >= 0 && position.x <= layout.width);
  }
};

WaterRaster::WaterRaster(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
WaterRaster::~WaterRaster() = default;

Result<std::unique_ptr<WaterRaster>> WaterRaster::Open(const std::string& path, const GeoBounds& around,
                                                       const FileContentOptions& content) {
  auto located = OpenLocatedRaster(path);
  if (!located) return tl::unexpected(located.error());
  const Footprint footprint = Footprint::Of(located->georeference);
  if (auto touches = CheckOverlap(footprint, around, path); !touches) return tl::unexpected(touches.error());

  auto impl = std::make_unique<Impl>(path, std::move(located->files), std::move(located->georeference));
  impl->spacing = located->spacing;
  impl->layout = RasterLayout::Of(*located->dataset, impl->georeference, "");
  impl->layout.rules.is_indicator = true;
  if (const std::string why = WhyOverviewsLackMasks(HeightBand(*located->dataset)); !why.empty()) {
    LogSource(SourceLog::Level::kWarn, path, "its overviews are not used: {}", why);
    impl->layout.overview_factors.clear();
  }
  impl->footprint = footprint.Padded();
  const auto fingerprint = impl->georeference.FingerprintWith(impl->handles.files(), content);
  if (!fingerprint) return tl::unexpected(fingerprint.error());
  impl->fingerprint = *fingerprint;
  if (auto unchanged = impl->handles.CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  return std::unique_ptr<WaterRaster>(new WaterRaster(std::move(impl)));
}

Result<std::vector<std::uint8_t>> WaterRaster::Read(const geo::TileKey& key, std::stop_token stop) const {
  TERRACE_CHECK(geo::IsValid(key));
  HandlePool& handles = impl_->handles;
  const RasterLayout& layout = impl_->layout;
  std::vector<std::uint8_t> pixels(std::size_t{kSide} * kSide, 0);
  const geo::Lattice lattice{key.level, kSide};
  const double samples_per_pixel = SamplesPerCell(lattice, impl_->spacing);
  const int factor = AveragingFactor(samples_per_pixel);
  // The transition from land to water takes one pixel, whatever the spacing of samples is.
  const double sharpness = std::max(1.0, factor / samples_per_pixel);

  const std::vector<Position> positions =
      CellCentrePositions(impl_->georeference, impl_->footprint, lattice, key, kWaterPositionTolerance * factor);
  const GridAxes axes{
      {layout.columns, factor, layout.wraps}, {layout.height, factor, false}, layout.width, layout.height};
  std::vector<GridCell> cells;
  std::vector<std::size_t> targets;  // pixel of each cell
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (!impl_->IsInside(positions[i])) continue;
    cells.push_back(axes.CellAt(positions[i]));
    const std::size_t row_from_south = i / kSide;
    targets.push_back((kSide - 1 - row_from_south) * kSide + i % kSide);
  }
  // Checks the files even if nothing is read, so that no tile outlives its mask.
  auto handle = handles.Borrow();
  if (!handle) return tl::unexpected(handle.error());
  if (cells.empty()) return pixels;
  const GridWindow window = MoveTogether(cells, axes);
  const auto shares = ReadAverages(**handle, layout, factor, window, stop);
  if (auto unchanged = handles.CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  if (!shares) {
    return MakeError(shares.error().code, "{}: tile {}: {}", impl_->path, geo::ToString(key), shares.error().message);
  }
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const double share = Interpolate(*shares, window, cells[i]).value_or(0);
    const double sharp = std::clamp(0.5 + (share - 0.5) * sharpness, 0.0, 1.0);
    pixels[targets[i]] = static_cast<std::uint8_t>(std::lround(255 * sharp));
  }
  return pixels;
}

std::uint64_t WaterRaster::fingerprint() const { return impl_->fingerprint; }
const StampedFiles& WaterRaster::files() const { return impl_->handles.files(); }

}  // namespace terrace::dem
