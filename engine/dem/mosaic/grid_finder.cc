#include "engine/dem/mosaic/grid_finder.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace terrace::dem {
namespace {

// Buckets per axis. Offsets that OffsetOf treats as equal differ by less than a bucket, so they lie in the same or in
// adjacent buckets.
constexpr int kBuckets = 64;
static_assert(Georeference::kOffsetTolerance < 0.9 / kBuckets);

std::array<double, 4> PixelOf(const Georeference& where) {
  const std::array<double, 6>& affine = where.to_crs();
  return {affine[1], affine[2], affine[4], affine[5]};
}

struct Bucket {
  int x = 0, y = 0;

  std::uint32_t key() const {
    const auto wrapped = [](int index) { return static_cast<std::uint32_t>((index + kBuckets) % kBuckets); };
    return wrapped(x) * kBuckets + wrapped(y);
  }
};

// Returns nothing if the raster is so far away that the fraction of a pixel is lost.
std::optional<Bucket> BucketOf(const Georeference& first, const Georeference& where) {
  const Position offset = first.CornerOf(where);
  if (!(std::max(std::abs(offset.x), std::abs(offset.y)) < Georeference::kFarthestPixel)) return std::nullopt;
  const auto index = [](double pixels) {
    return std::min(static_cast<int>((pixels - std::floor(pixels)) * kBuckets), kBuckets - 1);
  };
  return Bucket{index(offset.x), index(offset.y)};
}

}  // namespace

GridFinder::Kind& GridFinder::KindOf(const PlacedRaster& raster) {
  std::vector<Kind>& kinds = kinds_[raster.where->horizontal_wkt()];
  const auto known =
      std::ranges::find_if(kinds, [&](const Kind& kind) { return kind.vertical->IsSame(*raster.vertical); });
  if (known != kinds.end()) return *known;
  return kinds.emplace_back(Kind{raster.vertical, {}, {}});
}

// Includes all grids of the family that the raster fits.
std::vector<std::size_t> GridFinder::Candidates(const Family& family, const Georeference& where) const {
  const auto bucket = BucketOf(*family.first, where);
  if (!bucket) return family.grids;
  std::vector<std::size_t> grids = family.far;
  for (int x = bucket->x - 1; x <= bucket->x + 1; ++x) {
    for (int y = bucket->y - 1; y <= bucket->y + 1; ++y) {
      const auto found = family.by_phase.find(Bucket{x, y}.key());
      if (found != family.by_phase.end()) grids.insert(grids.end(), found->second.begin(), found->second.end());
    }
  }
  std::ranges::sort(grids);
  return grids;
}

GridFinder::Membership GridFinder::Add(const PlacedRaster& raster) {
  const Georeference& where = *raster.where;
  Kind& kind = KindOf(raster);
  std::optional<Membership> first;
  for (const Family& family : kind.families) {
    // Families are in the order of their first grids.
    if (first && family.grids.front() > first->grid) break;
    if (!family.first->MayAlign(where)) continue;
    for (const std::size_t grid : Candidates(family, where)) {
      if (first && grid > first->grid) break;
      ++grids_compared_;
      if (const auto offset = grids_[grid]->OffsetOf(where)) {
        first = Membership{grid, *offset};
        break;
      }
    }
  }
  if (first) return *first;
  Keep(kind, where, grids_.size());
  grids_.push_back(&where);
  return {grids_.size() - 1, {}};
}

void GridFinder::Keep(Kind& kind, const Georeference& where, std::size_t grid) {
  const auto [known, is_new] = kind.by_pixel.try_emplace(PixelOf(where), kind.families.size());
  if (is_new) kind.families.push_back(Family{&where, {}, {}, {}});
  Family& family = kind.families[known->second];
  family.grids.push_back(grid);
  const auto bucket = BucketOf(*family.first, where);
  (bucket ? family.by_phase[bucket->key()] : family.far).push_back(grid);
}

}  // namespace terrace::dem
