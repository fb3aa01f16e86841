// Positions on the globe to positions in a CRS and back, through one pinned PROJ operation.
//
// GDAL's own transformation picks, where several operations exist, the one that suits the mean of the points it is
// handed: the same node could land elsewhere in another batch. Here the operation is chosen once, for the source's own
// area.
#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"

struct pj_ctx;
struct PJconsts;

namespace terrace::dem {

struct Position {
  double x = 0, y = 0;  // degrees east and north, or the CRS's easting and northing, or pixel column and row
};

// Thread-safe: every call borrows a PROJ context of its own.
class Projector {
 public:
  // Longitude and latitude (WGS 84, degrees) to the horizontal CRS `wkt`, in the order easting, northing.
  // `centre` is a position in that CRS where the chosen operation must be at its best.
  static Result<std::shared_ptr<const Projector>> Make(const std::string& wkt, Position centre);
  ~Projector();

  // Transforms in place. Positions outside the operation's domain become NaN.
  void Forward(std::span<Position> positions) const;  // degrees -> CRS
  void Inverse(std::span<Position> positions) const;  // CRS -> degrees

  bool is_identity() const { return pipeline_ == "proj=noop"; }
  const std::string& pipeline() const { return pipeline_; }        // as PROJ runs it
  const std::string& description() const { return description_; }  // for people

 private:
  struct Operation;
  Projector() = default;
  std::unique_ptr<Operation> Borrow() const;
  void Return(std::unique_ptr<Operation> operation) const;
  void Transform(std::span<Position> positions, bool forward) const;

  std::string pipeline_, description_;
  mutable std::mutex mutex_;
  mutable std::vector<std::unique_ptr<Operation>> idle_;  // guarded by mutex_
};

}  // namespace terrace::dem
