// A grid of undulations as PROJ's vgridshift reads it: heights at nodes on meridians and parallels, bilinear between
// them. Where the grid is known, undulations are interpolated from the very nodes that PROJ interpolates from, and
// bounds on them follow from these nodes.
#pragma once

#include <gdal_priv.h>

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/crs/projector.h"

namespace terrace::dem {

// A position along one axis of a grid: between two nodes. Outside of the grid there are none.
struct NodePlace {
  int node = -1, next = -1;
  double weight = 0;  // of `next`, 0 .. 1

  bool is_inside() const { return node >= 0; }
};

// Immutable and thread-safe: reads of its file wait for one another.
class UndulationGrid {
 public:
  // A .gtx file, or a GeoTIFF as on cdn.proj.org. Null where GDAL cannot read it, or where there is more to it than one
  // grid in degrees with north up.
  static std::shared_ptr<const UndulationGrid> Open(const std::string& path);

  // Columns count eastwards from the western one, rows southwards from the northern one.
  int columns() const { return columns_; }
  int rows() const { return rows_; }
  bool wraps() const { return wraps_; }                // its columns go all around the Earth
  double column_step() const { return column_step_; }  // degrees
  double row_step() const { return row_step_; }

  // Longitudes count modulo 360 degrees. Of a grid that wraps: 0 .. columns(); of others the column nearest to the
  // grid's middle.
  double ColumnOf(double longitude) const;
  double RowOf(double latitude) const { return (north_ - latitude) / row_step_; }
  Position DegreesOf(double column, double row) const {
    return {west_ + column * column_step_, north_ - row * row_step_};
  }
  NodePlace AtColumn(double column) const;
  NodePlace AtRow(double row) const;

  // Metres, NaN where the grid has none. Precondition: the window lies in the grid.
  Result<std::vector<float>> Read(int column, int row, int columns, int rows) const;

 private:
  UndulationGrid() = default;

  std::string path_;
  int columns_ = 0, rows_ = 0;
  double west_ = 0, north_ = 0;  // of the first node, degrees
  double column_step_ = 0, row_step_ = 0;
  bool wraps_ = false;
  int band_ = 1;
  bool is_gtx_ = false;
  double scale_ = 1, offset_ = 0;
  std::optional<double> no_data_;
  mutable std::mutex mutex_;
  GDALDatasetUniquePtr dataset_;  // guarded by mutex_
};

// Part of a grid in memory.
class UndulationPatch {
 public:
  // What places lie between; others are ignored. Of a grid that wraps, all columns where the places lie on both sides
  // of its seam.
  static Result<UndulationPatch> Read(const UndulationGrid& grid, std::span<const NodePlace> columns,
                                      std::span<const NodePlace> rows);
  // How many nodes Read would read.
  static std::int64_t CountNodes(std::span<const NodePlace> columns, std::span<const NodePlace> rows);

  // Bilinear between the nodes that have values, as PROJ interpolates; NaN where none has, or outside of the grid.
  double At(const NodePlace& column, const NodePlace& row) const;
  // All four nodes around have values.
  bool IsWhole(const NodePlace& column, const NodePlace& row) const;

 private:
  std::array<double, 4> Around(const NodePlace& column, const NodePlace& row) const;

  int first_column_ = 0, first_row_ = 0, columns_ = 0;
  std::vector<float> heights_;
};

}  // namespace terrace::dem
