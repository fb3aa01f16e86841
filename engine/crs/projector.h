// Transforms positions on the globe to a CRS and back, through one pinned PROJ operation.
// If several operations exist, GDAL chooses one by the mean of the points of a call: the same node could get different
// positions in different calls. Here the operation is chosen once, for the source's area.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "engine/core/result.h"
#include "engine/crs/operation_pool.h"
#include "engine/gdal/stamped_files.h"

namespace terrace::dem {

struct Position {
  double x = 0, y = 0;  // degrees east and north, or the CRS's easting and northing, or pixel column and row
};

// Thread-safe: every call borrows a PROJ context of its own.
class Projector {
 public:
  // From longitude and latitude (WGS 84, degrees) to the horizontal CRS `wkt`, in the order easting, northing.
  // `centre`: the position in that CRS for which PROJ selects the best operation.
  static Result<std::shared_ptr<const Projector>> Make(const std::string& wkt, Position centre);

  // Transforms in place. Positions outside the operation's domain become NaN.
  void Forward(std::span<Position> positions) const;  // degrees -> CRS
  void Inverse(std::span<Position> positions) const;  // CRS -> degrees

  bool is_identity() const { return pipeline() == "proj=noop"; }
  const std::string& pipeline() const { return operations_.pipeline(); }  // as PROJ runs it
  const StampedFiles& grids() const { return grids_; }                    // the files that it reads
  const std::string& description() const { return description_; }         // for people

 private:
  Projector() = default;
  void Transform(std::span<Position> positions, bool forward) const;

  std::string description_;
  StampedFiles grids_;
  OperationPool operations_;
};

// Returns the reference system of an EPSG code as WKT 2:2019, from PROJ's database. Every thread gets the same text.
// kInvalidArgument: there is none. kUnavailable: the database cannot be read now.
Result<std::string> EpsgWkt(const std::string& code);

}  // namespace terrace::dem
