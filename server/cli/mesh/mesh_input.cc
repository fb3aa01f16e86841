#include "server/cli/mesh/mesh_input.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <utility>

#include "engine/sources/read_raster.h"
#include "proto/gltf/mesh_file.h"

namespace terrace::cli {
namespace {

constexpr const char* kAuto = "auto";
constexpr const char* kDeclared = "declared";

}  // namespace

void AddNodataOption(CLI::App& command, std::string& nodata) {
  const auto check = [](const std::string& text) {
    double number = 0;
    const bool is_number = CLI::detail::lexical_cast(text, number) && std::isfinite(number);
    return text == kAuto || text == kDeclared || is_number
               ? std::string()
               : fmt::format("must be auto, declared or a number, not \"{}\"", text);
  };
  command
      .add_option(
          "--nodata", nodata,
          "Which samples are voids: auto: declared and detected nodata values; declared: declared ones alone; a "
          "number: declared ones and this value")
      ->check(CLI::Validator(check, ""))
      ->type_name("VALUE")
      ->capture_default_str();
}

dem::ReadOptions ReadOptionsOf(const std::string& nodata, std::function<void(double)> progress) {
  dem::ReadOptions options;
  options.find_voids = nodata == kAuto;
  double number = 0;
  if (!options.find_voids && nodata != kDeclared && CLI::detail::lexical_cast(nodata, number)) {
    options.nodata = {number};
  }
  options.progress = std::move(progress);
  return options;
}

void WarnAbout(const std::string& path, const dem::RasterHeights& raster, const std::string& coordinates,
               const std::string& out) {
  if (raster.in_angles && coordinates != "pixel" && proto::MeshFileFormatOf(out) == proto::MeshFileFormat::kGlb) {
    fmt::print(stderr,
               "terrace: {}: x and y of the mesh are angles, heights metres, and glTF takes all of them for metres: "
               "viewers will show a needle; for metres throughout, project it first with `gdalwarp -t_srs EPSG:XXXX -r "
               "bilinear -dstnodata -9999 in out`\n",
               path);
  }
  if (!raster.coordinate_unit.empty() && coordinates != "pixel") {
    fmt::print(
        stderr,
        "terrace: {}: x and y of the mesh are in its reference system's unit ({}), heights in metres; for metres "
        "throughout, project it first with `gdalwarp -t_srs EPSG:XXXX -r bilinear -dstnodata -9999 in out`\n",
        path, raster.coordinate_unit);
  }
  if (!raster.found_voids.empty()) {
    fmt::print(stderr,
               "terrace: {}: samples taken for voids, though the file does not declare them: {}; --nodata declared "
               "takes them for heights\n",
               path, raster.found_voids);
  }
  if (!raster.heights_doubted.empty() && raster.picture_color.empty()) {
    fmt::print(stderr, "terrace: {}: {}\n", path, raster.heights_doubted);
  }
  if (!raster.picture_color.empty()) {
    fmt::print(stderr,
               "terrace: {}: band 1 says that it is the \"{}\" of a picture: its values are taken for heights; --image "
               "meshes its colours\n",
               path, raster.picture_color);
  }
}

}  // namespace terrace::cli
