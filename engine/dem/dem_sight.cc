// Lines of sight over a dataset: a ray is measured over the raster grids in order of precedence, over each where those
// before it have no height.
#include <algorithm>
#include <span>
#include <utility>

#include "engine/dem/dem_impl.h"
#include "engine/sight/grid_sight.h"
#include "engine/sight/sight_search.h"

namespace terrace::dem {
namespace {

// Rays between two checks of the stop token.
constexpr std::size_t kStopPeriod = 64;

// A box in degrees around pieces of a ray.
Box BoxAround(std::span<const TrackPiece> pieces) {
  Box box{360, 90, -360, -90};
  for (const TrackPiece& piece : pieces) {
    const Quadratic::Range x = piece.longitude.Over(0, 1), y = piece.latitude.Over(0, 1);
    box = {std::min(box.min_x, x.min), std::min(box.min_y, y.min), std::max(box.max_x, x.max),
           std::max(box.max_y, y.max)};
  }
  return box;
}

// Whether an edit whose box lies below a ray, or within 125 m of it, changes the ground.
bool IsEdited(const EditSet& edits, std::span<const TrackPiece> pieces) {
  constexpr int kParts = 64;
  static_assert(TrackPiece::kMaxLength / kParts == 125);
  const auto are_in = [&edits](const TrackPiece& piece) {
    return std::ranges::any_of(edits.Find(BoxAround({&piece, 1})), [&edits](std::size_t which) {
      const Edit& edit = edits.edits()[which];
      return edit.changes_heights() || edit.op == EditOp::kHole;
    });
  };
  return std::ranges::any_of(pieces, [&](const TrackPiece& piece) {
    if (!are_in(piece)) return false;
    for (int k = 0; k < kParts; ++k) {
      const double first = static_cast<double>(k) / kParts, last = static_cast<double>(k + 1) / kParts;
      TrackPiece part;
      part.longitude = piece.longitude.Part(first, last);
      part.latitude = piece.latitude.Part(first, last);
      if (are_in(part)) return true;
    }
    return false;
  });
}

}  // namespace

Result<std::vector<SightAnswer>> ElevationModel::LookAlong(std::span<const SightRay> rays, const SightOptions& options,
                                                           std::stop_token stop) const {
  GridSights sights;
  std::vector<SightAnswer> answers;
  answers.reserve(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (i % kStopPeriod == 0 && stop.stop_requested()) {
      return MakeError(ErrorCode::kCancelled, "looking along rays was stopped");
    }
    const std::vector<TrackPiece> pieces = PiecesOf(rays[i], options);
    if (impl_->edits != nullptr && IsEdited(*impl_->edits, pieces)) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "ray {}: the dataset's edits change the ground below it, which lines of sight over the sources do "
          "not see; ask for surface=served",
          i + 1);
    }
    const std::vector<std::size_t> order =
        impl_->grids.size() == 1 ? std::vector<std::size_t>{0} : impl_->GridsAt(BoxAround(pieces));
    SightSearch search;
    std::vector<RayPart> open = {{0, 1}};
    const auto look = [&](std::size_t grid, SightSurface surface) -> Result<void> {
      auto rest = sights.Of(grid, impl_->grids[grid]).Search(pieces, open, surface, search, stop);
      if (!rest) return tl::unexpected(std::move(rest).error());
      open = *std::move(rest);
      return {};
    };
    if (order.size() == 1) {
      if (const Result<void> done = look(order.front(), SightSurface::kAll); !done) return tl::unexpected(done.error());
    } else {
      for (const SightSurface surface : {SightSurface::kNotHoles, SightSurface::kAll}) {
        for (auto grid = order.begin(); grid != order.end() && !open.empty(); ++grid) {
          if (const Result<void> done = look(*grid, surface); !done) return tl::unexpected(done.error());
        }
      }
    }
    answers.push_back(search.Answer(!open.empty()));
  }
  return answers;
}

}  // namespace terrace::dem
