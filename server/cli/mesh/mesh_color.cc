#include "server/cli/mesh/mesh_color.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "engine/core/elapsed_time.h"
#include "engine/core/plain_number.h"
#include "engine/image/raster_colors.h"
#include "engine/sources/read_raster.h"
#include "engine/tin/extended/extended_error.h"
#include "engine/tin/extended/extended_field.h"
#include "server/cli/common/command.h"
#include "server/cli/common/option_checks.h"
#include "server/cli/common/progress.h"
#include "server/cli/mesh/mesh_input.h"
#include "server/cli/mesh/mesh_output.h"
#include "server/cli/mesh/mesh_placement.h"

namespace terrace::cli {
namespace {

using Clock = std::chrono::steady_clock;

struct Source {
  tin::ExtendedField field;
  bool georeferenced = false;
  std::array<double, 6> geo_transform{};
};

Result<Source> MakeSource(const std::string& path, tin::HeightField heights, std::vector<Rgba> colors, double weight,
                          bool georeferenced, const std::array<double, 6>& geo_transform) {
  auto field = tin::ExtendedField::Make(std::move(heights), std::move(colors), weight);
  if (!field) return MakeError(field.error().code, "{}: {}", path, field.error().message);
  return Source{*std::move(field), georeferenced, geo_transform};
}

Result<Source> ReadDem(const ColoredMeshArguments& arguments) {
  std::optional<Progress> progress(std::in_place, "reading " + arguments.raster + " and " + arguments.color.image);
  auto raster = dem::ReadRaster(arguments.raster,
                                ReadOptionsOf(arguments.nodata, [&](double share) { progress->Update(share / 2); }));
  if (!raster) return tl::unexpected(raster.error());
  auto colors = dem::ReadColors(arguments.color.image, arguments.raster, *raster,
                                [&](double share) { progress->Update(0.5 + share / 2); });
  if (!colors) return tl::unexpected(colors.error());
  auto heights = tin::HeightField::Make(raster->width, raster->height, std::move(raster->heights));
  if (!heights) return MakeError(heights.error().code, "{}: {}", arguments.raster, heights.error().message);
  progress.reset();
  WarnAbout(arguments.raster, *raster, arguments.coordinates, arguments.out);
  return MakeSource(arguments.color.image, *std::move(heights), *std::move(colors), arguments.color.weight,
                    raster->georeferenced, raster->geo_transform);
}

// A flat field.
Result<Source> ReadPicture(const ColoredMeshArguments& arguments) {
  Progress progress("reading " + arguments.raster);
  auto image = dem::ReadImage(arguments.raster, progress.Callback());
  if (!image) return tl::unexpected(image.error());
  auto heights = tin::HeightField::Make(image->width, image->height, std::vector<float>(image->colors.size(), 0.0F));
  if (!heights) return MakeError(heights.error().code, "{}: {}", arguments.raster, heights.error().message);
  return MakeSource(arguments.raster, *std::move(heights), std::move(image->colors), 1, image->georeferenced,
                    image->geo_transform);
}

// An image without a georeference is shown upright: y counts from the lowest row of pixels.
Result<Placement> PlacementFor(const ColoredMeshArguments& arguments, const Source& source) {
  auto placement = PlacementOf(arguments.raster, source.georeferenced, source.geo_transform, arguments.coordinates);
  if (!placement || source.georeferenced || !arguments.color.is_image || !arguments.coordinates.empty())
    return placement;
  return Placement{0.5, {-0.5, 1, 0, source.field.heights().height() - 0.5, 0, -1}};
}

nlohmann::ordered_json Statistics(const ColoredMeshArguments& arguments, const tin::ExtendedField& field,
                                  const tin::ColoredMesh& mesh, const tin::ExtendedError& error,
                                  const MeshSeconds& seconds) {
  const bool is_image = arguments.color.is_image;
  return {{"input",
           {{"path", arguments.raster},
            {"width", field.width()},
            {"height", field.height()},
            {"voids", VoidsOf(field.heights(), error.height.samples)}}},
          {"criterion", "delaunay"},
          {"points", mesh.tin.vertices.size()},
          {"triangles", mesh.tin.triangles.size()},
          {"max_error", error.height.max},
          {"rms_error", error.height.rms},
          {"color",
           {{"path", is_image ? arguments.raster : arguments.color.image},
            {"weight", field.color_weight()},
            {"max_combined_error", error.max_combined},
            {"rms_error", error.color_rms},
            {"samples", error.color_samples}}},
          {"seconds", {{"read", seconds.read}, {"triangulate", seconds.triangulate}, {"write", seconds.write}}},
          {"peak_rss_bytes", PeakRssBytes()}};
}

void Print(const ColoredMeshArguments& arguments, const tin::ExtendedField& field, const tin::ColoredMesh& mesh,
           const tin::ExtendedError& error, const MeshSeconds& seconds) {
  if (arguments.json) {
    fmt::print("{}\n", Statistics(arguments, field, mesh, error, seconds)
                           .dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
    return;
  }
  fmt::print("{}: {} vertices, {} triangles of {} samples{}; ", arguments.out, mesh.tin.vertices.size(),
             mesh.tin.triangles.size(), error.height.samples,
             TextOfVoids(VoidsOf(field.heights(), error.height.samples)));
  if (arguments.color.is_image) {
    fmt::print("largest error {} of the range of colours, RMS {}", PlainNumber(error.max_combined, 4),
               PlainNumber(error.color_rms, 4));
  } else {
    fmt::print("largest error {} m with colours, {} m of heights alone; RMS {} m, colours {}",
               PlainNumber(error.max_combined, 4), PlainNumber(error.height.max, 4), PlainNumber(error.height.rms, 4),
               PlainNumber(error.color_rms, 4));
  }
  fmt::print("; read {:.2f} s, mesh {:.2f} s, write {:.2f} s\n", seconds.read, seconds.triangulate, seconds.write);
}

}  // namespace

int MeshColored(const ColoredMeshArguments& arguments) {
  std::vector<std::string> inputs = {arguments.raster};
  if (!arguments.color.is_image) inputs.push_back(arguments.color.image);
  Result<MeshOutput> output = MeshOutput::Open(arguments.out, inputs);
  if (!output) return Fail(output.error());

  MeshSeconds seconds;
  Clock::time_point start = Clock::now();
  const Result<Source> source = arguments.color.is_image ? ReadPicture(arguments) : ReadDem(arguments);
  if (!source) return Fail(source.error().message, kExitFailure);
  const Result<Placement> placement = PlacementFor(arguments, *source);
  if (!placement) return Fail(placement.error().message, kExitUsage);
  seconds.read = SecondsSince(start);

  start = Clock::now();
  const tin::ColoredMesh mesh = [&] {
    tin::ExtendedGreedy greedy(source->field);
    RunInSteps(arguments.goal, 10'000, greedy);
    return greedy.Mesh();
  }();
  seconds.triangulate = SecondsSince(start);

  start = Clock::now();
  const Result<void> written = output->Write(VerticesOf(mesh.tin, source->field.heights(), *placement),
                                             TrianglesOf(mesh.tin, *placement), placement->grid, mesh.colors);
  if (!written) return Fail(written.error().message, kExitFailure);
  seconds.write = SecondsSince(start);
  Print(arguments, source->field, mesh, tin::MeasureExtendedError(source->field, mesh), seconds);
  if (arguments.goal.max_points != tin::ExtendedGoal{}.max_points) {
    ReportUnused(arguments.raster, arguments.goal.max_points, mesh.tin.vertices.size());
  }
  return kExitOk;
}

void AddColorOptions(CLI::App& command, ColorArguments& arguments) {
  constexpr const char* kGroup = "Colours";
  CLI::Option* const image =
      command
          .add_option(
              "--color", arguments.image,
              "Image that covers the DEM: grey, RGB, RGBA or a palette, placed by its georeference, else pixel by "
              "sample. Vertices get its colours, and triangles follow them")
          ->type_name("IMAGE")
          ->group(kGroup);
  command
      .add_option("--color-weight", arguments.weight,
                  "Weight of colours against heights, 0 to 1. The error of a sample is (1 - W) dz + W M/3 (dr + dg + "
                  "db): dz metres of height, dr, dg, db shares of the range of colours, M the range of the heights. So "
                  "--max-error E keeps heights within E / (1 - W); with W = 0 triangles follow heights alone")
      ->check(NumberFrom<double>(0, 1, "a number from 0 to 1"))
      ->type_name("W")
      ->capture_default_str()
      ->needs(image)
      ->group(kGroup);
  command
      .add_flag(
          "--image", arguments.is_image,
          "DEM is an image: its colours are meshed on flat ground, z = 0, y upwards, and --max-error is a share of "
          "the range of colours, 0 to 1")
      ->excludes(image)
      ->group(kGroup);
}

}  // namespace terrace::cli
