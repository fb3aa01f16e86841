// Vertical datums: the height of a geoid or national height system above the WGS 84 ellipsoid, by one pinned PROJ
// operation.
//
// A height above a geoid becomes ellipsoidal by adding the undulation, which depends on the position alone. As for
// positions (projector.h), the operation is chosen once, for the source's own area. PROJ's network access is off, so
// the choice depends on the installed grids.
#pragma once

#include <memory>
#include <string>

#include "engine/core/result.h"
#include "engine/dem/crs/projector.h"
#include "engine/dem/crs/undulation_grid.h"
#include "engine/dem/gdal/file_content.h"
#include "engine/dem/gdal/operation_pool.h"

namespace terrace::dem {

// Degrees; west > east: across the antimeridian. As it begins: the whole Earth.
struct AreaOfUse {
  double west = -180, south = -90, east = 180, north = 90;

  // Longitudes a full turn apart are one place.
  bool Covers(Position degrees) const;
};

// Thread-safe: every call borrows a PROJ context of its own.
class Geoid {
 public:
  // `vertical_crs`: what PROJ reads as a vertical or compound reference system, such as "EPSG:5773" or WKT; of a
  // compound one the vertical part counts. `centre`: degrees (WGS 84), where the operation must be at its best.
  // kInvalidArgument names the grid that is missing and where to get it, or says that PROJ knows no way.
  static Result<std::shared_ptr<const Geoid>> OfCrs(const std::string& vertical_crs, Position centre);

  // A file of undulations above the WGS 84 ellipsoid that PROJ reads: .gtx, or GeoTIFF as on cdn.proj.org.
  static Result<std::shared_ptr<const Geoid>> OfGrid(const std::string& path, Position centre);

  // Metres above the ellipsoid at positions in degrees, longitude first; NaN where the geoid is not known. A value is a
  // function of its position alone, the same at longitudes a full turn apart.
  double Undulation(Position degrees) const { return Reader(*this).At(degrees); }

  // Evaluates for one thread; holds a context of PROJ meanwhile.
  class Reader {
   public:
    explicit Reader(const Geoid& geoid);
    double At(Position degrees) const;

   private:
    IdlePool<ProjOperation>::Handle operation_;
  };

  const std::string& name() const { return name_; }                       // "EGM96 height"
  const std::string& unit() const { return unit_; }                       // of its heights; empty: that is not stated
  const std::string& description() const { return description_; }         // of the operation, for people
  const std::string& pipeline() const { return operations_.pipeline(); }  // as PROJ runs it
  // What the operation reads, as it was when it was set up.
  const StampedFiles& files() const { return files_; }
  // Adds the operation and its grids' bytes; where a grid lies makes no difference. Errors: those of HashFiles.
  Result<void> AddTo(ContentHasher& hasher, const FileContentOptions& options) const;
  // Where the operation is bilinear interpolation in one grid and nothing else: that grid. Else null.
  const UndulationGrid* grid() const { return grid_.get(); }
  // Degrees, the smaller side of a cell of the finest grid that the operation reads; 0 where that is not known.
  double finest_cell() const { return finest_cell_; }

 private:
  Geoid() = default;
  static Result<std::shared_ptr<const Geoid>> Checked(std::shared_ptr<const Geoid> geoid, Position centre);
  void FindGrid();
  static std::shared_ptr<const Geoid> FindShared(const std::string& vertical_crs, std::shared_ptr<const Geoid> made);

  AreaOfUse area_;
  std::string name_, unit_, description_;
  bool is_of_file_ = false;  // OfGrid: the pipeline names a file by its path
  StampedFiles files_;
  std::shared_ptr<const UndulationGrid> grid_;
  double finest_cell_ = 0;
  OperationPool operations_;
};

}  // namespace terrace::dem
