#include "engine/crs/level_plan.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/geo/ellipsoid.h"
#include "engine/geo/error_ladder.h"
#include "engine/geo/mercator_grid.h"
#include "engine/geo/octave.h"

namespace terrace::dem {
namespace {

struct Step {
  double east = 0, north = 0;  // metres
};

// Differences are computed in ECEF, because near a pole the longitudes of neighbouring pixels can differ by half a
// turn.
Step GroundStep(Position from, Position to, Position centre) {
  const geo::Vec3 chord = geo::ToEcef(to.x, to.y, 0) - geo::ToEcef(from.x, from.y, 0);
  const geo::Vec3 up = geo::SurfaceNormal(centre.x, centre.y);
  const geo::SinCos longitude = geo::RoundedSinCos(centre.x);
  const geo::Vec3 east{-longitude.sin, longitude.cos, 0};
  return {geo::Dot(chord, east), geo::Dot(chord, geo::Cross(up, east))};
}

// std::hypot differs in the last bit between platforms; metres do not overflow.
double LengthOf(double east, double north) { return std::sqrt(east * east + north * north); }

// The coarsest lattice with at least `nodes` nodes a sample of the source on both axes, or the finest there is.
int CellsOf(int level, const SourceSpacing& spacing, int nodes) {
  constexpr int kCoarsest = 32, kFinest = 256;
  // A lattice that equals what is wanted is fine enough, whatever the last bits of the pixel size.
  constexpr double kSlack = 1 + 1e-9;
  for (int cells = kCoarsest; cells < kFinest; cells *= 2) {
    const double step = geo::Lattice{level, cells}.StepDegrees() * nodes;
    if (step * geo::MetresPerDegreeEast(spacing.latitude) <= spacing.east * kSlack &&
        step * geo::MetresPerDegreeNorth(spacing.latitude) <= spacing.north * kSlack) {
      return cells;
    }
  }
  return kFinest;
}

// Meridians meet at a pole: the centre of a polar map does not represent cells elsewhere. In a geographic source its
// columns meet as well.
double RepresentativeLatitude(const SourceSpacing& spacing) {
  constexpr double kMaxPolar = 75;
  return spacing.geographic ? spacing.latitude : std::clamp(spacing.latitude, -kMaxPolar, kMaxPolar);
}

// Metres on the ground between Web Mercator pixels, equal on both axes except for the Earth's flattening.
double MercatorStep(int depth, const SourceSpacing& spacing) {
  constexpr double kMaxPolar = geo::kMercatorLatitude;
  const double latitude = std::clamp(RepresentativeLatitude(spacing), -kMaxPolar, kMaxPolar);
  return geo::MercatorGrid{depth}.StepDegrees() * geo::MetresPerDegreeEast(latitude);
}

}  // namespace

Result<SourceSpacing> SourceSpacing::Of(const Georeference& georeference, const std::string& path) {
  const double x = georeference.width() / 2.0, y = georeference.height() / 2.0;
  std::array<Position, 5> cross = {{{x, y}, {x - .5, y}, {x + .5, y}, {x, y - .5}, {x, y + .5}}};
  georeference.ToDegrees(cross);
  for (const Position& point : cross) {
    if (!std::isfinite(point.x) || std::abs(point.y) > 90) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "{}: its centre has no place on Earth in {}; check the georeference with `gdalinfo {}` and correct it "
          "with `gdal_translate -a_srs EPSG:XXXX -a_ullr west north east south in out`",
          path, georeference.crs(), path);
    }
  }
  const Step column = GroundStep(cross[1], cross[2], cross[0]), row = GroundStep(cross[3], cross[4], cross[0]);
  const double area = column.east * row.north - column.north * row.east;
  SourceSpacing spacing;
  spacing.latitude = cross[0].y;
  spacing.geographic = georeference.is_geographic_grid();
  spacing.finer = std::min(LengthOf(column.east, column.north), LengthOf(row.east, row.north));
  // Rows of the inverse matrix: pixels per metre east, per metre north.
  spacing.east = std::abs(area) / LengthOf(row.north, column.north);
  spacing.north = std::abs(area) / LengthOf(row.east, column.east);
  if (!(spacing.finer > 0) || !std::isfinite(spacing.east) || !std::isfinite(spacing.north) || area == 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: its pixels have no extent on the ground in {}; check the georeference "
                     "with `gdalinfo {}`",
                     path, georeference.crs(), path);
  }
  return spacing;
}

double SamplesPerCell(const geo::Lattice& lattice, const SourceSpacing& spacing) {
  const double latitude = RepresentativeLatitude(spacing), step = lattice.StepDegrees();
  const double east = step * geo::MetresPerDegreeEast(latitude) / spacing.east;
  const double north = step * geo::MetresPerDegreeNorth(latitude) / spacing.north;
  return std::sqrt(east * north);
}

int AveragingFactor(double samples_per_cell) {
  constexpr int kMaxOctave = 22;  // one block then contains the largest raster (raster_file.cc, kMaxSide)
  return 1 << std::clamp(geo::NearestOctave(samples_per_cell), 0, kMaxOctave);
}

std::vector<geo::Lattice> PlanLattices(const SourceSpacing& finest, int max_level) {
  // Nodes fall between samples and cut their peaks, the less the finer the lattice. The deepest levels have a finer
  // one, because no further level follows. There are two of them, because sources whose spacings differ by less than a
  // factor of two end at most a level apart.
  constexpr int kDeepest = 2, kNodesThere = 2;
  std::vector<geo::Lattice> lattices;
  for (int level = 0; level <= geo::kMaxLevel; ++level) {
    const bool is_deep = level > max_level - kDeepest;
    lattices.push_back({level, CellsOf(level, finest, is_deep ? kNodesThere : 1)});
  }
  return lattices;
}

int DeepestMercator(const SourceSpacing& spacing) {
  constexpr double kSlack = 1 + 1e-9;  // pixels that equal the source's are fine enough
  int depth = 1;
  while (depth < geo::kMaxLevel && MercatorStep(depth, spacing) > spacing.finer * kSlack) ++depth;
  return depth;
}

int MercatorFactor(int depth, const SourceSpacing& spacing) {
  const double step = MercatorStep(depth, spacing);
  return AveragingFactor(std::sqrt(step / spacing.east * (step / spacing.north)));
}

int DeepestLevel(const SourceSpacing& spacing, double error_fraction, std::optional<double> finest_error) {
  const double goal = finest_error.value_or(spacing.finer / 10);
  int level = 0;
  while (level < geo::kMaxLevel && geo::DefaultError(level, error_fraction) > goal) ++level;
  return level;
}

}  // namespace terrace::dem
