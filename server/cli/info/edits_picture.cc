#include "server/cli/info/edits_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/color.h"
#include "engine/dem/tile_edits.h"
#include "engine/geo/ellipsoid.h"
#include "proto/documents/height_png.h"

namespace terrace::cli {
namespace {

constexpr int kSide = 1024;

Rgb ColorOf(std::string_view op) {
  static const std::map<std::string_view, Rgb> colors = {
      {"flatten", {220, 40, 40}},   {"slope", {230, 120, 20}},    {"offset", {200, 60, 200}},
      {"replace", {120, 70, 200}},  {"carve", {30, 90, 220}},     {"raise", {140, 80, 30}},
      {"precision", {20, 150, 60}}, {"breakline", {0, 150, 170}}, {"hole", {255, 220, 0}}};
  return colors.at(op);
}

// The part of the Earth that the picture shows: square in metres.
struct Frame {
  double west, north, step_x, step_y;  // degrees, of pixels
};

Frame FrameOf(const std::vector<dem::EditOutline>& edits) {
  double west = 180, east = -180, south = 90, north = -90;
  for (const dem::EditOutline& edit : edits) {
    for (const auto& line : edit.lines) {
      for (const dem::GeoPosition at : line) {
        west = std::min(west, at.longitude), east = std::max(east, at.longitude);
        south = std::min(south, at.latitude), north = std::max(north, at.latitude);
      }
    }
  }
  const double latitude = (south + north) / 2;
  const double per_east = std::max(geo::MetresPerDegreeEast(latitude), 1.0);
  const double per_north = geo::MetresPerDegreeNorth(latitude);
  const double side_m = 1.5 * std::max({(east - west) * per_east, (north - south) * per_north, 100.0});
  return {(west + east) / 2 - side_m / per_east / 2, latitude + side_m / per_north / 2, side_m / per_east / kSide,
          side_m / per_north / kSide};
}

class Picture {
 public:
  Picture() : pixels_(static_cast<std::size_t>(kSide) * kSide) {}

  void Put(int x, int y, Rgb color) {
    if (x >= 0 && y >= 0 && x < kSide && y < kSide)
      pixels_[static_cast<std::size_t>(y) * kSide + static_cast<std::size_t>(x)] = color;
  }
  void Line(double x0, double y0, double x1, double y1, Rgb color) {
    const int steps = static_cast<int>(std::max(std::abs(x1 - x0), std::abs(y1 - y0))) + 1;
    for (int k = 0; k <= steps; ++k) {
      const double t = static_cast<double>(k) / steps;
      const int x = static_cast<int>(x0 + t * (x1 - x0)), y = static_cast<int>(y0 + t * (y1 - y0));
      for (const auto& [dx, dy] : {std::pair{0, 0}, {1, 0}, {0, 1}}) Put(x + dx, y + dy, color);
    }
  }
  // Terrarium's codes are the 24 bits of a colour.
  std::string Encode() const {
    std::vector<float> codes;
    for (const auto& [red, green, blue] : pixels_) {
      codes.push_back(static_cast<float>(
          proto::DecodeHeight(static_cast<std::uint32_t>(red) << 16 | static_cast<std::uint32_t>(green) << 8 | blue,
                              proto::HeightEncoding::kTerrarium)));
    }
    return proto::EncodeHeightPng(codes, kSide, proto::HeightEncoding::kTerrarium);
  }

 private:
  std::vector<Rgb> pixels_;
};

}  // namespace

Result<std::string> DrawEdits(const dem::ElevationModel& model) {
  const std::vector<dem::EditOutline> edits = dem::TileEdits(model).Outlines();
  const Frame frame = FrameOf(edits);
  std::vector<dem::GeoPosition> positions;
  for (int y = 0; y <= kSide; ++y) {
    const double latitude = std::clamp(frame.north - (y + 0.5) * frame.step_y, -90.0, 90.0);
    for (int x = 0; x <= kSide; ++x) positions.push_back({frame.west + (x + 0.5) * frame.step_x, latitude});
  }
  const auto heights = model.ReadPoints(positions);
  if (!heights) return tl::unexpected(heights.error());
  const double metres = frame.step_y * geo::MetresPerDegreeNorth(frame.north);
  Picture picture;
  const auto at = [&](int x, int y) {
    return static_cast<double>((*heights)[static_cast<std::size_t>(y) * (kSide + 1) + static_cast<std::size_t>(x)]);
  };
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      // Light from the north-west, 45 degrees high.
      const double gx = (at(x + 1, y) - at(x, y)) / metres, gy = (at(x, y) - at(x, y + 1)) / metres;
      const double light = (1 + (gx - gy) / std::sqrt(2.0)) / std::sqrt(2.0) / std::sqrt(1 + gx * gx + gy * gy);
      const auto grey =
          std::isnan(light) ? std::uint8_t{0} : static_cast<std::uint8_t>(40 + 200 * std::clamp(light, 0.0, 1.0));
      picture.Put(x, y, {grey, grey, grey});
    }
  }
  for (const dem::EditOutline& edit : edits) {
    for (const auto& line : edit.lines) {
      for (std::size_t k = 0; k + 1 < line.size(); ++k) {
        const auto x = [&](std::size_t i) { return (line[i].longitude - frame.west) / frame.step_x; };
        const auto y = [&](std::size_t i) { return (frame.north - line[i].latitude) / frame.step_y; };
        picture.Line(x(k), y(k), x(k + 1), y(k + 1), ColorOf(edit.op));
      }
    }
  }
  return picture.Encode();
}

std::string CountEdits(const dem::ElevationModel& model) {
  std::map<std::string, std::size_t> counts;
  for (const dem::EditOutline& edit : dem::TileEdits(model).Outlines()) ++counts[edit.op];
  std::string text;
  for (const auto& [op, count] : counts) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, op);
  if (text.empty()) return "none: no feature has \"terrain\" in its properties";
  return fmt::format("{}: {}", model.info().edits, text);
}

}  // namespace terrace::cli
