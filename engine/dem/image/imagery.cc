#include "engine/dem/image/imagery.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "engine/core/check.h"
#include "engine/dem/crs/footprint.h"
#include "engine/dem/crs/georeference.h"
#include "engine/dem/crs/level_plan.h"
#include "engine/dem/crs/node_positions.h"
#include "engine/dem/gdal/raster_file.h"
#include "engine/dem/image/image_bins.h"
#include "engine/dem/image/image_pool.h"

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

  ImagePool pool;
  const Georeference georeference;
  SourceSpacing spacing;
  Footprint footprint;  // padded; there is no picture outside
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
  if (auto complete = CheckComplete(image->dataset(), path, kMaxBands); !complete) {
    return tl::unexpected(complete.error());
  }
  auto files = StampedFiles::OfOpened(FilesOf(image->dataset(), path), before);
  if (!files) return tl::unexpected(files.error());
  auto georeference = Georeference::Of(image->dataset(), path);
  if (!georeference) return tl::unexpected(georeference.error());
  const auto spacing = SourceSpacing::Of(*georeference, path);
  if (!spacing) return tl::unexpected(spacing.error());
  const Footprint footprint = Footprint::Of(*georeference);
  if (auto touches = CheckOverlap(footprint, around, path); !touches) return tl::unexpected(touches.error());
  auto impl = std::make_unique<Impl>(ImagePool(*std::move(image), *std::move(files)), *std::move(georeference));
  impl->spacing = *spacing;
  impl->footprint = footprint.Padded();
  const auto fingerprint = impl->georeference.FingerprintWith(impl->pool.files(), content);
  if (!fingerprint) return tl::unexpected(fingerprint.error());
  impl->fingerprint = *fingerprint;
  return std::unique_ptr<Imagery>(new Imagery(std::move(impl)));
}

int Imagery::SideOf(int level, int most) const {
  TERRACE_CHECK(IsSide(most));
  constexpr double kSlack = 1.01;  // pixels as fine as the image are fine enough, despite rounding of its spacing
  int side = most;
  while (side > kMinSideOfCoarseImages && SamplesPerCell({level, side / 2}, impl_->spacing) <= kSlack) side /= 2;
  return side;
}

Result<std::optional<TilePicture>> Imagery::Read(const geo::TileKey& key, int side, std::stop_token stop) const {
  TERRACE_CHECK(geo::IsValid(key) && IsSide(side));
  ImagePool& pool = impl_->pool;
  const Georeference& georeference = impl_->georeference;
  const Footprint& footprint = impl_->footprint;
  if (auto unchanged = pool.CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  const geo::Lattice lattice{key.level, side};
  const double extent = lattice.cells * lattice.StepDegrees();
  if (!footprint.Touches(lattice.Longitude(lattice.FirstColumn(key)), lattice.Latitude(lattice.FirstRow(key)), extent,
                         extent)) {
    return std::nullopt;
  }
  const int factor = std::min(AveragingFactor(SamplesPerCell(lattice, impl_->spacing)), pool.LargestFactor());
  auto image = pool.Borrow(factor);
  if (!image) return tl::unexpected(image.error());

  std::vector<Position> positions =
      CellCentrePositions(georeference, footprint, lattice, key, kPositionTolerance * factor);
  bool is_there = false;
  for (Position& p : positions) {
    const bool is_inside = p.x >= 0 && p.x <= georeference.width() && p.y >= 0 && p.y <= georeference.height();
    is_there = is_there || is_inside;
    p = is_inside ? Position{p.x / image->size->across, p.y / image->size->down} : Position{NAN, NAN};
  }
  if (!is_there) return std::nullopt;
  const auto bins = ImageBins::Read(*image->image, factor / image->size->factor, positions, stop);
  if (!bins) return MakeError(bins.error().code, "tile {}: {}", geo::ToString(key), bins.error().message);
  if (auto unchanged = pool.CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());

  TilePicture picture;
  picture.side = side;
  picture.rgb.resize(3 * positions.size());
  is_there = false;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const ColorSample color = bins->At(positions[i]);
    is_there = is_there || color[3] != 0;
    const auto pixels = static_cast<std::size_t>(side);
    std::uint8_t* const out = picture.rgb.data() + 3 * ((pixels - 1 - i / pixels) * pixels + i % pixels);
    std::copy_n(color[3] != 0 ? color.data() : kNoPicture.data(), 3, out);
  }
  return is_there ? std::optional(std::move(picture)) : std::nullopt;
}

std::uint64_t Imagery::fingerprint() const { return impl_->fingerprint; }
const StampedFiles& Imagery::files() const { return impl_->pool.files(); }

}  // namespace terrace::dem
