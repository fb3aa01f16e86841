// All edits of a dataset, and their effect on heights.
//
// The edited height of a node depends on the node's position and on its unedited height alone, so neighbours that share
// a node share its edited height. Edits apply in their order: later ones see what earlier ones have left.
//
// Immutable; thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <stop_token>
#include <unordered_map>
#include <vector>

#include "engine/common/box_index.h"
#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/edits/edit.h"
#include "engine/edits/edit_effects.h"
#include "engine/edits/edit_shape.h"
#include "engine/geo/lattice.h"
#include "engine/geo/node_grid.h"

namespace terrace::dem {

struct ReplacementHeights;
// The heights that an edit takes from its source. The result stays valid until Apply returns.
using ReadReplacement = std::function<Result<const ReplacementHeights*>(const Edit&)>;

// The row that each edit computed last, by the edit's number. Points on one parallel share it.
using EditRows = std::unordered_map<std::size_t, EditRow>;

// The datum of heights that are edited.
struct EditedDatum {
  HeightDatum datum = HeightDatum::kEllipsoid;
  // The height of the datum's zero above the ellipsoid, metres, by node. Empty if no edit needs them
  // (Edit::TargetDatum).
  std::span<const double> undulations = {};
};

class EditSet {
 public:
  // `edits`: ResolveEdit has completed them (engine/dem/dem_impl.h).
  explicit EditSet(std::vector<Edit> edits);

  const std::vector<Edit>& edits() const { return edits_; }

  // The edits whose reach meets a box of degrees, whose longitudes lie in -540 .. 540; in order. Each thread remembers
  // the last box without edits, so calls for boxes within it return at once.
  std::vector<std::size_t> Find(const Box& degrees) const;
  // Whether Find would find any; faster if it would find many.
  bool Any(const Box& degrees) const;

  // Edits heights of nodes. NaN stays NaN except where an edit sets the height itself, with a weight of 1. With
  // that weight, an edit that is stated in the heights' datum makes the height exactly the stated one.
  // `replacement`: heights in the datum if the edit is stated in it, else above the ellipsoid. `error_m`, unless null:
  // of heights above the ellipsoid, an upper bound of the distance between the surface through the tile's nodes, all
  // finite, and the samples of the sources. It is replaced by the bound for the edited surface and the edited samples.
  // The window then has a halo of one, which does not count. Errors: kCancelled.
  Result<void> Apply(const geo::NodeGrid& grid, const NodeWindow& window, std::span<const std::size_t> which,
                     const EditedDatum& datum, std::span<float> heights, const ReadReplacement& replacement,
                     const std::stop_token& stop, double* error_m = nullptr) const;

  // The same for one position; `datum` has one undulation or none. `height` and the result: NaN if there is none, as in
  // holes. `replacement`: the height of a replacement at this position. `rows`: kept from one position to the next,
  // empty at first.
  double ApplyAt(const GeoPosition& position, std::span<const std::size_t> which, const EditedDatum& datum,
                 double height, const std::function<double(const Edit&)>& replacement, EditRows& rows) const;

  // A range of heights after the edits. `replacement`: the range of a replacement.
  HeightRange Extended(HeightRange range, std::span<const std::size_t> which,
                       const std::function<HeightRange(const Edit&)>& replacement) const;

  // What the edits ask of the mesh of a window of nodes without a halo; empty members: nothing.
  MeshDemands DemandsOf(const geo::Lattice& lattice, const NodeWindow& window,
                        std::span<const std::size_t> which) const;

 private:
  std::vector<Edit> edits_;
  BoxIndex index_;
  std::uint64_t number_;  // no other set of this process has it
};

// Calls visit(column, row) for the nodes of the window along the line from `a` to `b`: the nearest node in each column,
// or in each row if the line is steeper than a diagonal. Also calls it for a few nodes beside the window. Columns count
// on beyond a turn around the Earth.
void ForNodesAlong(const geo::Lattice& lattice, const NodeWindow& window, const EditPlane& plane, PlanPoint a,
                   PlanPoint b, const std::function<void(std::int64_t, std::int64_t)>& visit);

}  // namespace terrace::dem
