// The deepest level of a source, and the lattice and averaging factor of each level. All are functions of the arguments
// alone.
#pragma once

#include <optional>
#include <vector>

#include "engine/core/result.h"
#include "engine/crs/georeference.h"
#include "engine/geo/lattice.h"

namespace terrace::dem {

// Distances between samples at the source's centre, in metres on the ground.
struct SourceSpacing {
  double east = 0, north = 0;  // to the next sample to the east; to the north
  double finer = 0;            // the shorter of a column step and a row step
  double latitude = 0;         // of the centre, degrees
  bool geographic = false;     // columns follow meridians

  static Result<SourceSpacing> Of(const Georeference& georeference, const std::string& path);
};

// Returns the number of source samples along the edge of a lattice cell (geometric mean of both axes).
double SamplesPerCell(const geo::Lattice& lattice, const SourceSpacing& spacing);

// Returns the number of samples per axis that are averaged into one: the nearest power of two, at least 1.
int AveragingFactor(double samples_per_cell);

// Returns the lattices of levels 0 .. geo::kMaxLevel for a dataset whose finest source has this spacing. As far as 257
// nodes per side allow, they are at least as fine as the source, and from level max_level - 1 on at least twice as
// fine. `max_level`: the deepest level served.
std::vector<geo::Lattice> PlanLattices(const SourceSpacing& finest, int max_level);

// Returns the first depth of Web Mercator whose pixels are at least as fine as the source at its centre, 1 ..
// geo::kMaxLevel.
int DeepestMercator(const SourceSpacing& spacing);

// Returns the averaging factor for a depth of Web Mercator.
int MercatorFactor(int depth, const SourceSpacing& spacing);

// Returns the first level whose default error is at most `finest_error`; without it, at most a tenth of the finer
// spacing.
int DeepestLevel(const SourceSpacing& spacing, double error_fraction, std::optional<double> finest_error);

}  // namespace terrace::dem
