// A grid of undulations as PROJ's vgridshift reads it: heights at nodes on meridians and parallels, bilinear in
// between. Undulations are interpolated from the same nodes that PROJ uses, and bounds on them follow from these nodes.
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
#include "engine/crs/projector.h"

namespace terrace::dem {

// A position along one axis of a grid, between two nodes; outside the grid both are -1.
struct AxisPosition {
  int node = -1, next = -1;
  double weight = 0;  // of `next`, 0 .. 1

  bool is_inside() const { return node >= 0; }
};

// Immutable and thread-safe. Reads of its file are serialized.
class UndulationGrid {
 public:
  // Opens a .gtx file, or a GeoTIFF as on cdn.proj.org. Null if GDAL cannot read it, or if it is not a single grid in
  // degrees with north up.
  static std::shared_ptr<const UndulationGrid> Open(const std::string& path);

  // Columns are counted from the west, rows from the north.
  int columns() const { return columns_; }
  int rows() const { return rows_; }
  bool wraps() const { return wraps_; }                // its columns span the whole Earth
  double column_step() const { return column_step_; }  // degrees
  double row_step() const { return row_step_; }

  // Longitudes count modulo 360 degrees. For a grid that wraps: 0 .. columns(); for others the equivalent column
  // nearest to the grid's middle.
  double ColumnOf(double longitude) const;
  double RowOf(double latitude) const { return (north_ - latitude) / row_step_; }
  Position DegreesOf(double column, double row) const {
    return {west_ + column * column_step_, north_ - row * row_step_};
  }
  AxisPosition AtColumn(double column) const;
  AxisPosition AtRow(double row) const;

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
  // Reads the nodes around the given places; places outside the grid are ignored. Reads all columns if the grid wraps
  // and the places lie on both sides of its seam.
  static Result<UndulationPatch> Read(const UndulationGrid& grid, std::span<const AxisPosition> columns,
                                      std::span<const AxisPosition> rows);
  // Returns the number of nodes that Read would read.
  static std::int64_t CountNodes(std::span<const AxisPosition> columns, std::span<const AxisPosition> rows);

  // Interpolates bilinearly between the nodes that have values, as PROJ does; NaN if none has, or outside the grid.
  double At(const AxisPosition& column, const AxisPosition& row) const;
  // Interpolates along one row, for each column.
  void At(std::span<const AxisPosition> columns, const AxisPosition& row, std::span<double> out) const;
  // Whether all nodes of the patch have values.
  bool is_whole() const { return is_whole_; }
  // Whether all four nodes around the place have values.
  bool IsWhole(const AxisPosition& column, const AxisPosition& row) const;

 private:
  std::array<double, 4> Around(const AxisPosition& column, const AxisPosition& row) const;

  int first_column_ = 0, first_row_ = 0, columns_ = 0;
  std::vector<float> heights_;
  bool is_whole_ = true;
};

}  // namespace terrace::dem
