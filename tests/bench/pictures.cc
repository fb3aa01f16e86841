#include "tests/bench/pictures.h"

#include <gdal_priv.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <utility>

#include "engine/core/check.h"
#include "tests/bench/triangle_samples.h"

namespace terrace::bench {
namespace {

using tin::SamplePosition;

std::size_t IndexOf(int x, int y, int width) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
}

// Bresenham's line.
void DrawLine(int x, int y, int x_end, int y_end, Picture& picture) {
  const int dx = std::abs(x_end - x), dy = -std::abs(y_end - y);
  const int step_x = x < x_end ? 1 : -1, step_y = y < y_end ? 1 : -1;
  for (int error = dx + dy;;) {
    picture.grey[IndexOf(x, y, picture.width)] = 0;
    if (x == x_end && y == y_end) return;
    const int doubled = 2 * error;
    if (doubled >= dy) {
      error += dy;
      x += step_x;
    }
    if (doubled <= dx) {
      error += dx;
      y += step_y;
    }
  }
}

}  // namespace

tin::HeightField SampledMesh(const tin::HeightField& field, const tin::TinMesh& mesh) {
  std::vector<float> heights(IndexOf(0, field.height(), field.width()), 0.0f);
  for (const auto& triangle : mesh.triangles) {
    ForEachSample(field, {mesh.vertices[triangle[0]], mesh.vertices[triangle[1]], mesh.vertices[triangle[2]]},
                  [&](SamplePosition p, double height) {
                    heights[IndexOf(p.x, p.y, field.width())] = static_cast<float>(height);
                  });
  }
  Result<tin::HeightField> sampled = tin::HeightField::Make(field.width(), field.height(), std::move(heights));
  TERRACE_CHECK(sampled.has_value());
  return *std::move(sampled);
}

Picture Hillshade(const tin::HeightField& field, double spacing_m) {
  const int width = field.width(), height = field.height();
  Picture picture{width, height, std::vector<std::uint8_t>(IndexOf(0, height, width))};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int x0 = std::max(x - 1, 0), x1 = std::min(x + 1, width - 1);
      const int y0 = std::max(y - 1, 0), y1 = std::min(y + 1, height - 1);
      const double to_east = static_cast<double>(field.At(x1, y) - field.At(x0, y)) / ((x1 - x0) * spacing_m);
      const double to_south = static_cast<double>(field.At(x, y1) - field.At(x, y0)) / ((y1 - y0) * spacing_m);
      // The direction to the light is (-1/2, 1/2 north, 1/sqrt 2), the surface's normal (-to_east, to_south north, 1).
      const double light =
          (to_east / 2 + to_south / 2 + std::sqrt(0.5)) / std::sqrt(to_east * to_east + to_south * to_south + 1);
      const double step = std::clamp(std::round(light * 64), 0.0, 63.0);
      picture.grey[IndexOf(x, y, width)] = static_cast<std::uint8_t>(step * 4);
    }
  }
  return picture;
}

Picture Wireframe(const tin::HeightField& field, const tin::TinMesh& mesh, int scale) {
  Picture picture{(field.width() - 1) * scale + 1, (field.height() - 1) * scale + 1, {}};
  picture.grey.assign(IndexOf(0, picture.height, picture.width), 255);
  for (const auto& triangle : mesh.triangles) {
    for (unsigned i = 0; i < 3; ++i) {
      const SamplePosition a = mesh.vertices[triangle[i]], b = mesh.vertices[triangle[(i + 1) % 3]];
      DrawLine(a.x * scale, a.y * scale, b.x * scale, b.y * scale, picture);
    }
  }
  return picture;
}

Result<void> WritePng(const Picture& picture, const std::string& path) {
  GDALAllRegister();
  GDALDriver* memory = GetGDALDriverManager()->GetDriverByName("MEM");
  GDALDriver* png = GetGDALDriverManager()->GetDriverByName("PNG");
  if (memory == nullptr || png == nullptr) return MakeError(ErrorCode::kUnavailable, "GDAL has no PNG driver");
  const std::unique_ptr<GDALDataset> pixels(memory->Create("", picture.width, picture.height, 1, GDT_Byte, nullptr));
  std::vector<std::uint8_t> grey = picture.grey;
  if (!pixels || pixels->GetRasterBand(1)->RasterIO(GF_Write, 0, 0, picture.width, picture.height, grey.data(),
                                                    picture.width, picture.height, GDT_Byte, 0, 0) != CE_None) {
    return MakeError(ErrorCode::kInternal, "{}: GDAL cannot hold the picture", path);
  }
  const bool two_colours = std::all_of(grey.begin(), grey.end(), [](auto value) { return value == 0 || value == 255; });
  CPLStringList options;
  options.AddNameValue("ZLEVEL", "9");
  if (two_colours) options.AddNameValue("NBITS", "1");
  CPLConfigOptionSetter no_side_files("GDAL_PAM_ENABLED", "NO", false);
  const std::unique_ptr<GDALDataset> file(
      png->CreateCopy(path.c_str(), pixels.get(), 0, options.List(), nullptr, nullptr));
  if (!file) return MakeError(ErrorCode::kUnavailable, "{}: cannot be written", path);
  return {};
}

}  // namespace terrace::bench
