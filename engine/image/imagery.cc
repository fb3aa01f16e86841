#include "engine/image/imagery.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "engine/core/check.h"
#include "engine/crs/footprint.h"
#include "engine/crs/georeference.h"
#include "engine/crs/level_plan.h"
#include "engine/crs/node_positions.h"
#include "engine/gdal/raster_file.h"
#include "engine/gdal/stamped_files.h"
#include "engine/geo/mercator_grid.h"
#include "engine/image/image_bins.h"
#include "engine/image/image_pool.h"
#include "engine/sources/located_raster.h"

namespace terrace::dem {
namespace {

// In pixels of the averaged image: much less than is visible with 8 bits per channel.
constexpr double kPositionTolerance = 1e-3;
constexpr int kMinSideOfCoarseImages = 256;  // with fewer, seams between interpolated tiles would be visible

bool IsSide(int side) {
  return side >= Imagery::kMinSide && side <= Imagery::kMaxSide && std::has_single_bit(static_cast<unsigned>(side));
}

}  // namespace

class Imagery::Impl {
 public:
  Impl(ImagePool images, Georeference where) : pool(std::move(images)), georeference(std::move(where)) {}

  // The factor by which pixels are averaged: the wanted one, or the largest that the memory allows.
  int FactorOf(int wanted) { return std::min(wanted, pool.LargestFactor()); }

  // The colours at positions in pixels of the full image, which are changed; empty if none of them lies in the image.
  // `what`: for error messages.
  Result<std::vector<Rgba>> ColorsAt(std::vector<Position>& positions, int factor, const std::string& what,
                                     const std::stop_token& stop);
  Result<std::vector<Rgba>> ColorsOfCells(const geo::TileKey& key, int side, const std::stop_token& stop);

  ImagePool pool;
  const Georeference georeference;
  SourceSpacing spacing;
  Footprint footprint;  // padded; there is no picture outside
  GeoBounds bounds;     // without the padding
  std::uint64_t fingerprint = 0;
};

Imagery::Imagery(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Imagery::~Imagery() = default;

Result<std::unique_ptr<Imagery>> Imagery::Open(const std::string& path, const GeoBounds& around,
                                               const FileContentOptions& content) {
  ForgetRemote(path);
  const auto before = StampOf(path);
  auto image = ImageFile::Open(path);
  if (!image) return tl::unexpected(image.error());
  constexpr int kMaxBands = 4;  // red, green, blue and alpha
  auto located = LocateRaster(image->dataset(), path, before, kMaxBands);
  if (!located) return tl::unexpected(located.error());
  const Footprint footprint = Footprint::Of(located->georeference);
  if (auto touches = CheckOverlap(footprint, around, path); !touches) return tl::unexpected(touches.error());
  auto impl =
      std::make_unique<Impl>(ImagePool(*std::move(image), std::move(located->files)), std::move(located->georeference));
  impl->spacing = located->spacing;
  impl->footprint = footprint.Padded();
  impl->bounds = footprint.Bounds();
  const auto fingerprint = impl->georeference.FingerprintWith(impl->pool.files(), content);
  if (!fingerprint) return tl::unexpected(fingerprint.error());
  impl->fingerprint = *fingerprint;
  return std::unique_ptr<Imagery>(new Imagery(std::move(impl)));
}

int Imagery::SideOf(int level, int max_side) const {
  TERRACE_CHECK(IsSide(max_side));
  constexpr double kSlack = 1.01;  // pixels as fine as the image are fine enough, despite rounding of its spacing
  int side = max_side;
  while (side > kMinSideOfCoarseImages && SamplesPerCell({level, side / 2}, impl_->spacing) <= kSlack) side /= 2;
  return side;
}

// The colours of a tile's lattice cells, row by row from the south-western one; empty if the image shows none of them.
Result<std::vector<Rgba>> Imagery::Impl::ColorsOfCells(const geo::TileKey& key, int side, const std::stop_token& stop) {
  TERRACE_CHECK(geo::IsValid(key) && IsSide(side));
  if (auto unchanged = pool.CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  const geo::Lattice lattice{key.level, side};
  const double size = lattice.cells * lattice.StepDegrees();
  if (!footprint.Touches(lattice.Longitude(lattice.FirstColumn(key)), lattice.Latitude(lattice.FirstRow(key)), size,
                         size)) {
    return std::vector<Rgba>();
  }
  const int factor = FactorOf(AveragingFactor(SamplesPerCell(lattice, spacing)));
  std::vector<Position> positions =
      CellCentrePositions(georeference, footprint, lattice, key, kPositionTolerance * factor);
  return ColorsAt(positions, factor, "tile " + geo::ToString(key), stop);
}

Result<std::optional<TilePicture>> Imagery::Read(const geo::TileKey& key, int side, std::stop_token stop) const {
  const auto colors = impl_->ColorsOfCells(key, side, stop);
  if (!colors) return tl::unexpected(colors.error());
  const auto pixels = static_cast<std::size_t>(side);
  TilePicture picture;
  picture.side = side;
  picture.rgb.resize(3 * colors->size());
  bool is_there = false;
  for (std::size_t i = 0; i < colors->size(); ++i) {
    const Rgba color = (*colors)[i];
    is_there = is_there || color[3] != 0;
    std::uint8_t* const out = picture.rgb.data() + 3 * ((pixels - 1 - i / pixels) * pixels + i % pixels);
    std::copy_n(color[3] != 0 ? color.data() : kNoPicture.data(), 3, out);
  }
  return is_there ? std::optional(std::move(picture)) : std::nullopt;
}

Result<std::vector<Rgba>> Imagery::Impl::ColorsAt(std::vector<Position>& positions, int factor, const std::string& what,
                                                  const std::stop_token& stop) {
  if (auto unchanged = pool.CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  auto image = pool.Borrow(factor);
  if (!image) return tl::unexpected(image.error());
  bool is_there = false;
  for (Position& p : positions) {
    const bool is_inside = p.x >= 0 && p.x <= georeference.width() && p.y >= 0 && p.y <= georeference.height();
    is_there = is_there || is_inside;
    p = is_inside ? Position{p.x / image->size->across, p.y / image->size->down} : Position{NAN, NAN};
  }
  std::vector<Rgba> colors;
  if (!is_there) return colors;
  const auto bins = ImageBins::Read(*image->image, factor / image->size->factor, positions, stop);
  if (!bins) return MakeError(bins.error().code, "{}: {}", what, bins.error().message);
  if (auto unchanged = pool.CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  colors.reserve(positions.size());
  for (const Position& p : positions) colors.push_back(bins->At(p));
  return colors;
}

Result<MapPicture> Imagery::ReadMercator(int depth, std::int64_t column, std::int64_t row, int side,
                                         std::stop_token stop) const {
  const geo::MercatorGrid grid{depth};
  TERRACE_CHECK(depth >= 0 && depth <= geo::kMaxLevel && IsSide(side));
  TERRACE_CHECK(column >= 0 && column + side <= grid.columns() && row >= 0 && row + side <= grid.rows());
  const int factor = impl_->FactorOf(MercatorFactor(depth, impl_->spacing));
  const NodePositions found = NodePositions::Of(impl_->georeference, impl_->footprint, grid,
                                                NodeWindow{column, row, side, side}, kPositionTolerance * factor);
  std::vector<Position> positions;
  positions.reserve(Area(side, side));
  for (std::size_t j = 0; j < found.rows(); ++j) {
    for (std::size_t i = 0; i < found.columns(); ++i) positions.push_back(found.At(i, j));
  }
  const auto colors = impl_->ColorsAt(positions, factor, fmt::format("Mercator pixels of depth {}", depth), stop);
  if (!colors) return tl::unexpected(colors.error());
  MapPicture picture{side, std::vector<std::uint8_t>(4 * positions.size())};
  for (std::size_t i = 0; i < colors->size(); ++i) {
    if ((*colors)[i][3] != 0) std::copy_n((*colors)[i].data(), 4, picture.rgba.data() + 4 * i);
  }
  return picture;
}

Result<MapPicture> Imagery::ReadGeodetic(const geo::TileKey& key, int side, std::stop_token stop) const {
  const auto read = impl_->ColorsOfCells(key, side, stop);
  if (!read) return tl::unexpected(read.error());
  const auto pixels = static_cast<std::size_t>(side);
  MapPicture picture{side, std::vector<std::uint8_t>(4 * pixels * pixels)};
  for (std::size_t i = 0; i < read->size(); ++i) {
    std::uint8_t* const out = picture.rgba.data() + 4 * ((pixels - 1 - i / pixels) * pixels + i % pixels);
    if ((*read)[i][3] != 0) std::copy_n((*read)[i].data(), 4, out);
  }
  return picture;
}

ImageExtent Imagery::extent() const {
  constexpr double kSlack = 1.01;  // as in SideOf
  ImageExtent extent;
  extent.bounds = impl_->bounds;
  extent.max_mercator_depth = DeepestMercator(impl_->spacing);
  while (extent.max_geodetic_level < geo::kMaxLevel &&
         SamplesPerCell({extent.max_geodetic_level, kMapSide}, impl_->spacing) > kSlack) {
    ++extent.max_geodetic_level;
  }
  return extent;
}

std::uint64_t Imagery::fingerprint() const { return impl_->fingerprint; }
const StampedFiles& Imagery::files() const { return impl_->pool.files(); }

}  // namespace terrace::dem
