// Features that edit the sample of Jacksboro, one of each kind.
#pragma once

#include <fmt/format.h>

#include <map>
#include <string>

#include "tests/support/source_dir.h"

namespace terrace::tiler {

// In the middle of config/samples/jacksboro.tif, on the corner of four tiles of level 11.
inline constexpr double kLongitude = -84.1985, kLatitude = 36.2992;

inline std::string Jacksboro() { return (test_support::SourceDir() / "config/samples/jacksboro.tif").string(); }

inline std::string Position(double east, double north, double height = 0) {
  return fmt::format("[{:.8f},{:.8f},{}]", kLongitude + east, kLatitude + north, height);
}

// A slanted rectangle of about 1.8 x 0.7 km.
inline std::string Polygon() {
  return fmt::format(R"({{"type":"Polygon","coordinates":[[{},{},{},{},{}]]}})", Position(-0.011, -0.004, 300),
                     Position(0.010, -0.002, 320), Position(0.009, 0.005, 330), Position(-0.012, 0.003, 310),
                     Position(-0.011, -0.004, 300));
}
inline std::string Line() {
  return fmt::format(R"({{"type":"LineString","coordinates":[{},{},{}]}})", Position(-0.015, -0.003, 280),
                     Position(0.001, 0.002, 300), Position(0.014, 0.0005, 320));
}
// 0.3 cells of levels 11 and 12 beside the edges that meet in the middle: the nearest nodes are those of the edges, and
// the tiles on the other side contain no part of the line.
inline std::string BesideEdges() {
  constexpr double kEast = 1090 * 180.0 / 2048 - 180 + 0.0001, kNorth = 1437 * 180.0 / 2048 - 90 + 0.00005;
  return fmt::format(R"({{"type":"LineString","coordinates":[[{0:.8f},{1:.8f}],[{0:.8f},{2:.8f}],[{3:.8f},{2:.8f}]]}})",
                     kEast, kNorth - 0.03, kNorth, kEast + 0.03);
}
inline std::string Feature(const std::string& terrain, const std::string& geometry) {
  return fmt::format(R"({{"type":"Feature","properties":{{"terrain":{}}},"geometry":{}}})", terrain, geometry);
}

// Flat ground around the middle, and precision across the edge to the east of it, 0.2 km from the corner there: the
// edge needs no vertex between, so the height of the corner counts.
inline std::string BesideCorner() {
  const std::string flat =
      fmt::format(R"({{"type":"Polygon","coordinates":[[{0},{1},{2},{3},{0}]]}})", Position(-0.02, -0.01),
                  Position(0.02, -0.01), Position(0.02, 0.01), Position(-0.02, 0.01));
  const std::string line =
      fmt::format(R"({{"type":"LineString","coordinates":[{},{}]}})", Position(0.004, -0.004), Position(0.004, 0.004));
  return Feature(R"({"op":"flatten","height":306})", flat) + "," +
         Feature(R"({"op":"precision","error_m":0.2,"width_m":300})", line);
}

inline const std::map<std::string, std::string>& Kinds() {
  static const std::map<std::string, std::string> kinds = {
      {"flatten", Feature(R"({"op":"flatten","height":"mean","blend_m":150})", Polygon())},
      {"slope", Feature(R"({"op":"slope","blend_m":150})", Polygon())},
      {"offset", Feature(R"({"op":"offset","metres":60,"blend_m":150})", Polygon())},
      {"replace", Feature(R"({"op":"replace","source":"etopo5.tif","blend_m":150})", Polygon())},
      {"carve", Feature(R"({"op":"carve","width_m":60,"blend_m":100})", Line())},
      {"raise", Feature(R"({"op":"raise","height":500,"width_m":60,"blend_m":100})", Line())},
      {"precision", Feature(R"({"op":"precision","error_m":1,"blend_m":300})", Polygon())},
      {"factor", Feature(R"({"op":"precision","factor":0.1,"width_m":200,"blend_m":300})", Line())},
      {"precision beside a corner", BesideCorner()},
      {"breakline", Feature(R"({"op":"breakline"})", Line())},
      {"line beside edges", Feature(R"({"op":"breakline"})", BesideEdges())},
      {"hole", Feature(R"({"op":"hole"})", Polygon())}};
  return kinds;
}

}  // namespace terrace::tiler
