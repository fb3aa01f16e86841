// Vertical datums: the height of a geoid or national height system above the WGS 84 ellipsoid, by one pinned PROJ
// operation.
//
// A height above a geoid becomes ellipsoidal by adding the undulation, which depends on the position alone. As for
// positions (projector.h), the operation is chosen once, for the source's own area. PROJ's network access is off, so
// the choice depends on the installed grids.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "engine/core/result.h"
#include "engine/crs/operation_pool.h"
#include "engine/crs/projector.h"
#include "engine/crs/undulation_grid.h"
#include "engine/gdal/file_content.h"
#include "engine/gdal/stamped_files.h"
#include "engine/geo/geo_bounds.h"

namespace terrace::dem {

// Whether an area contains a position. Longitudes count modulo 360 degrees.
bool Covers(const geo::GeoBounds& area, Position degrees);

// `vertical_crs`: as for Geoid::OfCrs. Returns its name if it counts downwards, as depths do. Nothing: it has heights,
// or PROJ does not know it.
std::optional<std::string> NameOfDepths(const std::string& vertical_crs);

// Thread-safe: every call borrows a PROJ context of its own.
class Geoid {
 public:
  // `vertical_crs`: a vertical or compound reference system in a form that PROJ reads, such as "EPSG:5773" or WKT; of a
  // compound system the vertical part is used. `centre`: the position in WGS 84 degrees for which PROJ selects the best
  // operation. kInvalidArgument: a grid is missing, and the message says where to get it; or PROJ has no operation.
  static Result<std::shared_ptr<const Geoid>> OfCrs(const std::string& vertical_crs, Position centre);

  // Opens a file of undulations above the WGS 84 ellipsoid, in metres: .gtx, or GeoTIFF as on cdn.proj.org.
  // kNotFound: there is no such file. kInvalidArgument: PROJ cannot read it, or its value at `centre` is larger than
  // any undulation of the Earth.
  static Result<std::shared_ptr<const Geoid>> OfGrid(const std::string& path, Position centre);

  // Returns the geoid's height above the ellipsoid in metres; NaN where the geoid is not known. The result depends only
  // on the position, longitudes modulo 360 degrees.
  double Undulation(Position degrees) const { return Reader(*this).At(degrees); }

  // Evaluates the geoid on one thread. Holds a PROJ context.
  class Reader {
   public:
    explicit Reader(const Geoid& geoid);
    double At(Position degrees) const;

   private:
    IdlePool<ProjOperation>::Handle operation_;
  };

  const std::string& name() const { return name_; }                       // "EGM96 height"
  const std::string& unit() const { return unit_; }                       // of its heights; empty: not stated
  const std::string& description() const { return description_; }         // of the operation, for people
  const std::string& pipeline() const { return operations_.pipeline(); }  // as PROJ runs it
  // The files that the operation reads, as they were when it was set up.
  const StampedFiles& files() const { return files_; }
  // Adds the operation and the bytes of its grids to a hash, but not the paths of grids. Errors: those of HashFiles.
  Result<void> AddTo(ContentHasher& hasher, const FileContentOptions& options) const;
  // The grid, if the operation is only bilinear interpolation in one grid; else null.
  const UndulationGrid* grid() const { return grid_.get(); }
  // Degrees: the smaller side of a cell of the finest grid that the operation reads; 0: not known;
  // infinite: it reads no grid.
  double finest_cell() const { return finest_cell_; }

 private:
  Geoid() = default;
  static Result<std::shared_ptr<const Geoid>> Checked(std::shared_ptr<const Geoid> geoid, Position centre);
  void FindGrid();
  static std::shared_ptr<const Geoid> FindOrShare(const std::string& vertical_crs, std::shared_ptr<const Geoid> made);

  geo::GeoBounds area_;  // of use
  std::string name_, unit_, description_;
  bool is_of_file_ = false;  // made by OfGrid: the pipeline contains a path
  StampedFiles files_;
  std::shared_ptr<const UndulationGrid> grid_;
  double finest_cell_ = 0;
  OperationPool operations_;
};

}  // namespace terrace::dem
