#include "tests/engine/dem/geoid_grids.h"

#include <cstdint>
#include <fstream>

namespace terrace::dem {

std::string WriteGtx(const TempDir& dir, const std::string& name, const GtxSpec& spec) {
  std::string bytes;
  const auto put = [&bytes](const auto number) {
    const char* raw = reinterpret_cast<const char*>(&number);
    for (std::size_t i = sizeof number; i > 0; --i) bytes += raw[i - 1];
  };
  put(spec.south);
  put(spec.west);
  put(spec.step);
  put(spec.step);
  put(std::int32_t{spec.rows});
  put(std::int32_t{spec.columns});
  for (int row = 0; row < spec.rows; ++row) {
    for (int column = 0; column < spec.columns; ++column) put(spec.value(column, row));
  }
  std::ofstream(dir.File(name), std::ios::binary) << bytes;
  return dir.File(name);
}

}  // namespace terrace::dem
