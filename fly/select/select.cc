#include "fly/select/select.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace terrace::fly {

Verdict PreviousVerdict(const Tile& tile, std::uint64_t frame) {
  for (const Visit& visit : tile.visits) {
    if (visit.frame != 0 && visit.frame + 1 == frame) return visit.verdict;
  }
  return Verdict::kNone;
}

bool Selection::IsRefined() const {
  const bool has_mesh =
      std::any_of(drawn.begin(), drawn.end(), [](const DrawnTile& drawn_tile) { return drawn_tile.tile->HasMesh(); });
  if (any_kicked || !has_mesh) return false;
  return std::all_of(drawn.begin(), drawn.end(),
                     [](const DrawnTile& drawn_tile) { return drawn_tile.tile->state == LoadState::kReady; });
}

bool Selection::IsSettled() const {
  if (any_kicked) return false;  // nothing to draw, as beside the data, is nothing to wait for
  return std::all_of(drawn.begin(), drawn.end(),
                     [](const DrawnTile& drawn_tile) { return drawn_tile.tile->state != LoadState::kUnloaded; });
}

namespace {

// If more descendants than this are missing, a tile is loaded before them.
constexpr std::uint32_t kDescendantLimit = 20;

// What a subtree reports to its root.
struct Subtree {
  bool all_renderable = true;
  bool any_rendered_before = false;  // in the last frame
  std::uint32_t missing = 0;         // selected tiles that are not renderable
};

bool WasVisited(const Tile& tile, std::uint64_t frame) {
  return frame != 0 && (tile.visits[0].frame == frame || tile.visits[1].frame == frame);
}

class Selector {
 public:
  Selector(const SelectOptions& options, const View& view, const std::function<void(Tile&)>& update,
           std::uint64_t frame, Selection& selection)
      : options_(options),
        view_(view),
        update_(update),
        frame_(frame),
        selection_(selection),
        fog_density_(FogDensity(view.geodetic().height_m)) {}

  // `ancestor_suffices`: the error of an ancestor is small enough, but the ancestor is not loaded.
  Subtree VisitIfNeeded(Tile& tile, bool ancestor_suffices);

 private:
  struct Measures {
    double distance_m = 0, priority = 0, error_px = 0;
  };

  Measures Measure(const Tile& tile) const;
  bool IsVisible(const Volume& volume) const;
  bool IsOutOfSight(const Tile& tile) const;
  Subtree Cull(Tile& tile, const Measures& measures);
  Subtree VisitVisible(Tile& tile, const Measures& measures, bool suffices, bool ancestor_suffices);
  Subtree VisitChildren(Tile& tile, bool ancestor_suffices);
  bool DrawInsteadOfDescendants(Tile& tile, const Measures& measures, std::size_t first_drawn, std::size_t first_load,
                                bool is_queued, Subtree& subtree);
  Subtree Single(const Tile& tile) const;
  bool AnyDescendantRenderedBefore(const Tile& tile) const;
  void Kick(Tile& tile);
  void Judge(Tile& tile, Verdict verdict) { tile.visits[0].verdict = verdict; }
  void Draw(Tile& tile, const Measures& measures) {
    selection_.drawn.push_back({&tile, measures.error_px, measures.distance_m});
  }
  void Load(Tile& tile, LoadGroup group, const Measures& measures) {
    if (tile.NeedsLoad()) {
      selection_.loads.push_back({&tile, group, measures.priority});
    } else if (tile.IsPending()) {
      ++selection_.pending;
    }
  }

  const SelectOptions& options_;
  const View& view_;
  const std::function<void(Tile&)>& update_;
  const std::uint64_t frame_;
  Selection& selection_;
  const double fog_density_;
};

Selector::Measures Selector::Measure(const Tile& tile) const {
  Measures measures;
  measures.distance_m = std::sqrt(std::max(0.0, DistanceSquared(tile.volume, view_.position(), view_.geodetic())));
  const geo::Vec3 to_tile = CenterOf(tile.volume) - view_.position();
  const double length = geo::Length(to_tile);
  // Tiles in the middle of the screen come first, near ones before far ones.
  if (length >= 1e-5) {
    measures.priority = (1 - geo::Dot(to_tile, view_.direction()) / length) * measures.distance_m;
  }
  measures.error_px = view_.ErrorInPixels(tile.geometric_error_m, measures.distance_m);
  return measures;
}

// Tiles right below the camera count as visible: the camera sees them next if it turns.
bool Selector::IsVisible(const Volume& volume) const {
  return view_.Sees(volume) || MeetsVertical(volume, view_.geodetic());
}

// The children's volumes fit more tightly than the tile's own.
bool Selector::IsOutOfSight(const Tile& tile) const {
  const auto& children = tile.children;
  const bool by_children = !children.empty() && std::none_of(children.begin(), children.end(),
                                                             [](const auto& child) { return child->always_refine; });
  if (!by_children) return !IsVisible(tile.volume);
  return std::none_of(children.begin(), children.end(), [&](const auto& child) { return IsVisible(child->volume); });
}

Subtree Selector::VisitIfNeeded(Tile& tile, bool ancestor_suffices) {
  tile.visits[1] = tile.visits[0];
  tile.visits[0] = {frame_, Verdict::kNone};
  const Measures measures = Measure(tile);
  update_(tile);
  const bool culled = IsOutOfSight(tile) || IsHiddenByFog(measures.distance_m, fog_density_);
  // Tiles without content lead to those that would be loaded: the root, and all of them if holes are forbidden.
  const bool must_visit = tile.always_refine && (options_.forbid_holes || tile.parent == nullptr);
  if (culled && !must_visit) return Cull(tile, measures);
  const double limit_px = culled ? options_.culled_error_px : options_.max_error_px;
  return VisitVisible(tile, measures, measures.error_px < limit_px, ancestor_suffices);
}

Subtree Selector::Cull(Tile& tile, const Measures& measures) {
  Judge(tile, Verdict::kCulled);
  if (options_.forbid_holes) {
    Load(tile, LoadGroup::kNormal, measures);
    return Single(tile);
  }
  Load(tile, LoadGroup::kPreload, measures);
  return {};
}

bool Selector::AnyDescendantRenderedBefore(const Tile& tile) const {
  for (const auto& child : tile.children) {
    if (!WasVisited(*child, frame_ - 1)) continue;
    if (PreviousVerdict(*child, frame_) == Verdict::kRendered || AnyDescendantRenderedBefore(*child)) return true;
  }
  return false;
}

Subtree Selector::Single(const Tile& tile) const {
  const Verdict before = PreviousVerdict(tile, frame_);
  // If its descendants were drawn in the previous frame, it replaces them, and must not be kicked for being new.
  const bool was_rendered =
      before == Verdict::kRendered || (before == Verdict::kRefined && AnyDescendantRenderedBefore(tile));
  const bool renderable = tile.IsRenderable();
  return {renderable, renderable && was_rendered, renderable ? 0U : 1U};
}

void Selector::Kick(Tile& tile) {
  for (const auto& child : tile.children) {
    if (child->visits[0].frame != frame_) continue;
    Verdict& verdict = child->visits[0].verdict;
    if (verdict == Verdict::kRendered) verdict = Verdict::kKickedRendered;
    if (verdict == Verdict::kRefined) verdict = Verdict::kKickedRefined;
    Kick(*child);
  }
}

Subtree Selector::VisitChildren(Tile& tile, bool ancestor_suffices) {
  Subtree sum;
  for (const auto& child : tile.children) {
    const Subtree part = VisitIfNeeded(*child, ancestor_suffices);
    sum.all_renderable &= part.all_renderable;
    sum.any_rendered_before |= part.any_rendered_before;
    sum.missing += part.missing;
  }
  return sum;
}

// Returns whether the tile is queued for loading, or need not be.
bool Selector::DrawInsteadOfDescendants(Tile& tile, const Measures& measures, std::size_t first_drawn,
                                        std::size_t first_load, bool is_queued, Subtree& subtree) {
  selection_.any_kicked = true;
  Kick(tile);
  selection_.drawn.resize(first_drawn);
  Draw(tile, measures);
  Judge(tile, Verdict::kRendered);
  const bool renderable = tile.IsRenderable();
  const bool was_rendered = renderable && PreviousVerdict(tile, frame_) == Verdict::kRendered;
  if (!was_rendered && subtree.missing > kDescendantLimit && tile.content != Content::kStructure &&
      !tile.always_refine) {
    selection_.loads.resize(first_load);  // of the descendants; this tile shows something sooner
    if (!is_queued) Load(tile, LoadGroup::kNormal, measures);
    is_queued = true;
    subtree.missing = renderable ? 0 : 1;
  }
  subtree.all_renderable = renderable;
  subtree.any_rendered_before = was_rendered;
  return is_queued;
}

Subtree Selector::VisitVisible(Tile& tile, const Measures& measures, bool suffices, bool ancestor_suffices) {
  if (tile.children.empty()) {
    Judge(tile, Verdict::kRendered);
    Draw(tile, measures);
    Load(tile, LoadGroup::kNormal, measures);
    return Single(tile);
  }
  const Verdict before = PreviousVerdict(tile, frame_);
  bool is_queued = false;
  if (!tile.always_refine && (suffices || ancestor_suffices)) {
    // Deeper tiles that are on the screen stay until this one is loaded.
    const bool was_refined = before == Verdict::kRefined || before == Verdict::kKickedRefined;
    const bool keeps_deeper = was_refined && !tile.IsRenderable();
    if (!ancestor_suffices) {
      Load(tile, keeps_deeper ? LoadGroup::kUrgent : LoadGroup::kNormal, measures);
      is_queued = true;
    }
    if (!keeps_deeper) {
      Judge(tile, Verdict::kRendered);
      Draw(tile, measures);
      return Single(tile);
    }
    ancestor_suffices = true;
  }
  const std::size_t first_drawn = selection_.drawn.size(), first_load = selection_.loads.size();
  Subtree subtree = VisitChildren(tile, ancestor_suffices);
  const bool wants_kick = !subtree.all_renderable && !subtree.any_rendered_before;
  // Drawing a tile that is not loaded instead of its descendants would make a larger hole.
  if (wants_kick && (subtree.missing > kDescendantLimit || tile.IsRenderable())) {
    is_queued = DrawInsteadOfDescendants(tile, measures, first_drawn, first_load, is_queued, subtree);
  } else {
    Judge(tile, Verdict::kRefined);
  }
  if (!is_queued) Load(tile, LoadGroup::kPreload, measures);
  return subtree;
}

}  // namespace

void SelectTiles(const SelectOptions& options, const View& view, const std::function<void(Tile&)>& update,
                 std::uint64_t frame, Tile& root, Selection& selection) {
  selection = {};
  Selector(options, view, update, frame, selection).VisitIfNeeded(root, false);
  std::stable_sort(selection.loads.begin(), selection.loads.end(), [](const LoadTask& a, const LoadTask& b) {
    return a.group != b.group ? a.group > b.group : a.priority < b.priority;
  });
}

}  // namespace terrace::fly
