// Writes synthetic grids of undulations.
#pragma once

#include <functional>
#include <string>

#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {

struct GtxSpec {
  double west = 7, south = 45;  // of the first node, degrees
  double step = 0.1;
  int columns = 31, rows = 21;
  std::function<float(int column, int row)> value = [](int, int) { return 0.0f; };  // rows count northwards
};

// A .gtx file: a header of the south-western node, steps, rows and columns, then floats, all big-endian.
std::string WriteGtx(const TempDir& dir, const std::string& name, const GtxSpec& spec);

}  // namespace terrace::dem
