// A source of known heights, and features that edit it.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <memory>
#include <string>

#include "engine/dem/elevation_model.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {

// A slope of 1 m a pixel to the east from 100 m, 0.4 degrees wide and high, from 50 N.
inline std::string WriteSlope(const TempDir& dir, double west = 10, const std::string& name = "dem.tif") {
  RasterSpec spec;
  spec.width = spec.height = 400;
  spec.geo_transform = {west, 0.001, 0, 50.4, 0, -0.001};
  spec.value = [](int column, int) { return 100.0 + column; };
  return WriteRaster(dir, spec, name);
}

inline std::string WriteEdits(const TempDir& dir, const std::string& features,
                              const std::string& name = "edits.geojson") {
  std::ofstream(dir.File(name)) << R"({"type":"FeatureCollection","features":[)" << features << "]}";
  return dir.File(name);
}

inline std::string Rectangle(const std::string& terrain, double west, double south, double east, double north) {
  return fmt::format(R"({{"type":"Feature","properties":{{"terrain":{0}}},"geometry":{{"type":"Polygon","coordinates":)"
                     R"([[[{1},{2}],[{3},{2}],[{3},{4}],[{1},{4}],[{1},{2}]]]}}}})",
                     terrain, west, south, east, north);
}
inline std::string Middle(const std::string& terrain) { return Rectangle(terrain, 10.15, 50.15, 10.25, 50.25); }

class TerrainEdits : public testing::Test {
 protected:
  std::unique_ptr<ElevationModel> Open(const std::string& features) {
    DemOptions options;
    options.edits = {WriteEdits(dir_, features)};
    return OpenOrFail(slope_, options);
  }
  std::string MessageOf(const std::string& features) {
    DemOptions options;
    options.edits = {WriteEdits(dir_, features)};
    const auto opened = ElevationModel::Open(slope_, options);
    EXPECT_FALSE(opened.has_value());
    return opened ? "" : opened.error().message;
  }
  static double At(const ElevationModel& model, double longitude, double latitude) {
    const auto heights = model.ReadPoints(std::array{GeoPosition{longitude, latitude}});
    EXPECT_TRUE(heights.has_value());
    return heights ? static_cast<double>(heights->front()) : 0;
  }

  const TempDir dir_;
  const std::string slope_ = WriteSlope(dir_);
};

}  // namespace terrace::dem
