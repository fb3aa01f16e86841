// terrace mesh: one TIN of a whole raster, to a file.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "engine/common/parallel_for.h"
#include "engine/core/elapsed_time.h"
#include "engine/core/plain_number.h"
#include "engine/gdal/source_policy.h"
#include "engine/sources/read_raster.h"
#include "engine/tin/decimate/drop_pass.h"
#include "engine/tin/extended/block_joiner.h"
#include "engine/tin/extended/field_partition.h"
#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "engine/tin/mesh_error.h"
#include "server/cli/common/command.h"
#include "server/cli/common/option_checks.h"
#include "server/cli/common/progress.h"
#include "server/cli/mesh/mesh_area.h"
#include "server/cli/mesh/mesh_color.h"
#include "server/cli/mesh/mesh_input.h"
#include "server/cli/mesh/mesh_output.h"
#include "server/cli/mesh/mesh_placement.h"

namespace terrace::cli {
namespace {

// Returns the joined mesh of all blocks. It does not depend on `threads`, which is at least 1. Shows the number of
// finished blocks.
tin::TinMesh MeshBlocks(const tin::HeightField& field, const tin::FieldPartition& cut, double max_error_m,
                        const tin::GreedyOptions& options, int threads) {
  std::mutex mutex;  // guards everything below
  Progress progress("meshing");
  tin::BlockJoiner joiner(cut);
  std::vector<std::optional<tin::TinMesh>> waiting(cut.size());  // for an earlier block
  std::size_t done = 0;
  std::stop_source failed;  // stops the other threads in the middle of their blocks
  const auto mesh_block = [&](std::size_t i) {
    std::optional<tin::TinMesh> mesh = MeshBlock(field, cut.block(i), max_error_m, options, failed.get_token());
    if (!mesh) return false;
    const std::lock_guard lock(mutex);
    waiting[i] = std::move(mesh);
    while (joiner.added() < cut.size() && waiting[joiner.added()]) {
      joiner.Add(*std::exchange(waiting[joiner.added()], std::nullopt));
    }
    progress.Update(static_cast<double>(++done) / static_cast<double>(cut.size()));
    return true;
  };
  const auto mesh_or_stop = [&](std::size_t i) {
    try {
      return mesh_block(i);
    } catch (...) {
      failed.request_stop();
      throw;
    }
  };
  dem::ParallelFor(cut.size(), mesh_or_stop, static_cast<std::size_t>(threads));
  return std::move(joiner).Take();
}

using Clock = std::chrono::steady_clock;

constexpr const char* kDataDependent = "data-dependent";

// Names of --measure, in the order of tin::FitMeasure.
const std::vector<std::string> kMeasures = {"sum-max", "sum-squares", "max-max", "normals"};

struct MeshArguments {
  std::string dem, nodata = "auto", out, criterion = "delaunay", measure, coordinates;
  double max_error = -1, rms = -1, qthresh = -1;
  std::size_t points = 0;
  int threads = 1;
  bool compact = false, json = false;
  ColorArguments color;
  AreaOptions area;
};

// Returns what is wrong with the arguments about areas; nothing if they are valid.
std::string ComplainAboutArea(const MeshArguments& arguments) {
  if (!arguments.area.IsUsed()) {
    return IsOfAreas(arguments.coordinates)
               ? "--coordinates " + arguments.coordinates + " belongs to --edits, --bbox and --vertical"
               : "";
  }
  const bool is_plain = arguments.max_error > 0 && arguments.criterion != kDataDependent && !arguments.compact &&
                        arguments.threads == 1 && !arguments.color.IsUsed();
  if (!is_plain) {
    return "with --edits, --vertical or --bbox the only goal is --max-error, and it must be above 0; "
           "leave out --points, --rms, --criterion, --compact, --threads and colours";
  }
  if (!arguments.coordinates.empty() && !IsOfAreas(arguments.coordinates))
    return "--coordinates must be enu, ecef or geographic with --edits, --vertical or --bbox";
  return {};
}

// Returns what is wrong with the arguments; nothing if they are valid.
std::string Complain(const MeshArguments& arguments) {
  if (std::string about_area = ComplainAboutArea(arguments); !about_area.empty()) return about_area;
  const int goals = (arguments.max_error >= 0) + (arguments.points > 0) + (arguments.rms >= 0);
  if (goals != 1) return "mesh needs exactly one goal: --max-error METRES, --points N or --rms METRES";
  if (arguments.criterion != kDataDependent && (!arguments.measure.empty() || arguments.qthresh >= 0))
    return "--measure and --qthresh belong to --criterion data-dependent";
  if (arguments.compact && arguments.max_error < 0)
    return "--compact drops what an error bound does not need; give that bound with --max-error METRES";
  if (arguments.color.is_image && arguments.nodata != "auto")
    return "--nodata is about heights; leave it out with --image";
  if (arguments.color.IsUsed() && arguments.rms >= 0)
    return "--rms is a goal for heights alone; with colours use --max-error or --points";
  if (arguments.color.IsUsed() && arguments.compact)
    return "--compact drops vertices by their heights alone; leave it out with colours";
  if (arguments.color.IsUsed() && arguments.criterion == kDataDependent)
    return "--criterion data-dependent joins triangles by their heights alone; leave it out with colours";
  return {};
}

tin::GreedyOptions OptionsOf(const MeshArguments& arguments) {
  tin::GreedyOptions options;
  if (arguments.criterion != kDataDependent) return options;
  options.criterion = tin::Criterion::kDataDependent;
  const auto measure = std::find(kMeasures.begin(), kMeasures.end(), arguments.measure);
  if (measure != kMeasures.end()) {
    options.data_dependent.measure = static_cast<tin::FitMeasure>(measure - kMeasures.begin());
  }
  if (arguments.qthresh >= 0) options.data_dependent.qthresh = arguments.qthresh;
  return options;
}

// Only an error goal applies to each block separately; the other goals apply to the whole raster.
tin::TinMesh Triangulate(const MeshArguments& arguments, const tin::HeightField& field) {
  if (arguments.max_error >= 0) {
    const tin::FieldPartition cut = tin::FieldPartition::For(field, arguments.max_error);
    if (cut.size() > 1) return MeshBlocks(field, cut, arguments.max_error, OptionsOf(arguments), arguments.threads);
  }
  tin::GreedyGoal goal;
  if (arguments.max_error >= 0) goal.max_error = arguments.max_error;
  if (arguments.points > 0) goal.max_points = arguments.points;
  if (arguments.rms >= 0) goal.rms_error = arguments.rms;
  tin::GreedyTriangulation greedy(field, OptionsOf(arguments));
  const std::size_t samples = static_cast<std::size_t>(field.width()) * static_cast<std::size_t>(field.height());
  RunInSteps(goal, std::max<std::size_t>(10'000, samples / 200), greedy);
  return greedy.Mesh();
}

void Print(const MeshArguments& arguments, const tin::HeightField& field, const tin::TinMesh& mesh,
           const tin::MeshError& error, const MeshSeconds& seconds) {
  const std::size_t voids = VoidsOf(field, error.samples);
  if (arguments.json) {
    const nlohmann::ordered_json statistics = {
        {"input", {{"path", arguments.dem}, {"width", field.width()}, {"height", field.height()}, {"voids", voids}}},
        {"criterion", arguments.criterion},
        {"compact", arguments.compact},
        {"points", mesh.vertices.size()},
        {"triangles", mesh.triangles.size()},
        {"max_error", error.max},
        {"rms_error", error.rms},
        {"seconds", {{"read", seconds.read}, {"triangulate", seconds.triangulate}, {"write", seconds.write}}},
        {"peak_rss_bytes", PeakRssBytes()}};
    fmt::print("{}\n", statistics.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
    return;
  }
  fmt::print(
      "{}: {} vertices, {} triangles of {} samples{}; largest error {} m, RMS {} m; read {:.2f} s, mesh {:.2f} "
      "s, write {:.2f} s\n",
      arguments.out, mesh.vertices.size(), mesh.triangles.size(), error.samples, TextOfVoids(voids),
      PlainNumber(error.max, 4), PlainNumber(error.rms, 4), seconds.read, seconds.triangulate, seconds.write);
}

OptionCheck Metres() { return NumberFrom<double>(0, 1e6, "a number of metres from 0 to 1000000"); }

int Mesh(const MeshArguments& arguments) {
  spdlog::set_level(spdlog::level::err);
  if (const std::string complaint = Complain(arguments); !complaint.empty()) return Fail(complaint, kExitUsage);
  if (const auto allowed = dem::AllowVrts(); !allowed) return Fail(allowed.error().message, kExitFailure);
  if (arguments.area.IsUsed()) {
    return MeshArea({arguments.dem, arguments.nodata, arguments.out, arguments.coordinates, arguments.max_error,
                     arguments.area, arguments.json});
  }
  if (arguments.color.IsUsed()) {
    tin::ExtendedGoal goal;
    if (arguments.max_error >= 0) goal.max_error = arguments.max_error;
    if (arguments.points > 0) goal.max_points = arguments.points;
    return MeshColored(
        {arguments.dem, arguments.nodata, arguments.out, arguments.coordinates, goal, arguments.color, arguments.json});
  }
  Result<MeshOutput> output = MeshOutput::Open(arguments.out, {arguments.dem});
  if (!output) return Fail(output.error());

  MeshSeconds seconds;
  Clock::time_point start = Clock::now();
  Result<dem::RasterHeights> raster = [&] {
    Progress progress("reading " + arguments.dem);
    return dem::ReadRaster(arguments.dem, ReadOptionsOf(arguments.nodata, progress.Callback()));
  }();
  if (!raster) return Fail(raster.error().message, kExitFailure);
  WarnAbout(arguments.dem, *raster, arguments.coordinates, arguments.out);
  const auto placement =
      PlacementOf(arguments.dem, raster->georeferenced, raster->geo_transform, arguments.coordinates);
  if (!placement) return Fail(placement.error().message, kExitUsage);
  const auto field = tin::HeightField::Make(raster->width, raster->height, std::move(raster->heights));
  if (!field) return Fail(arguments.dem + ": " + field.error().message, kExitFailure);
  seconds.read = SecondsSince(start);

  start = Clock::now();
  tin::TinMesh mesh = Triangulate(arguments, *field);
  // The run cannot be stopped.
  if (arguments.compact) mesh = *tin::DropVertices(*field, mesh, {.max_error = arguments.max_error});
  seconds.triangulate = SecondsSince(start);

  start = Clock::now();
  const Result<void> written =
      output->Write(VerticesOf(mesh, *field, *placement), TrianglesOf(mesh, *placement), placement->grid);
  if (!written) return Fail(written.error().message, kExitFailure);
  seconds.write = SecondsSince(start);
  Print(arguments, *field, mesh, tin::MeasureError(*field, mesh), seconds);
  ReportUnused(arguments.dem, arguments.points, mesh.vertices.size());
  return kExitOk;
}

// Options of how triangles are connected.
void AddCriterionOptions(CLI::App& command, MeshArguments& arguments) {
  command
      .add_option("--criterion", arguments.criterion,
                  "How triangles are connected: delaunay, or data-dependent (fewer vertices for the same error, "
                  "thinner triangles, about twice the time to mesh)")
      ->check(OneOf({"delaunay", kDataDependent}))
      ->type_name("NAME")
      ->capture_default_str();
  command
      .add_option(
          "--measure", arguments.measure,
          "With data-dependent: the misfit of two triangles that is compared: sum-max (sum of their largest errors), "
          "sum-squares (sum of all squared errors), max-max (the larger of their largest errors), normals (angle "
          "between their normals); by default sum-max")
      ->check(OneOf(kMeasures))
      ->type_name("NAME");
  command
      .add_option(
          "--qthresh", arguments.qthresh,
          "With data-dependent: when the shape of triangles decides instead of their fit: 0 never, 1 whenever the "
          "shapes differ; by default 0.5")
      ->check(NumberFrom<double>(0, 1, "a number from 0 to 1"))
      ->type_name("SHARE");
}

}  // namespace

void AddMesh(CLI::App& app, int& exit_code) {
  constexpr const char* kGoal = "Goal, exactly one of";
  auto arguments = std::make_shared<MeshArguments>();
  CLI::App* command =
      app.add_subcommand("mesh", "Meshes a whole raster into one .obj, .ply or .glb file")->group(kCommands);
  command->footer(
      "Examples:\n"
      "  terrace mesh alps.tif --out alps.obj --max-error 5\n"
      "  terrace mesh alps.tif --out alps.glb --points 50000 --json\n"
      "  terrace mesh alps.tif --out alps.glb --max-error 10 --color photo.tif\n"
      "  terrace mesh alps.tif --out alps.glb --max-error 1 --edits runway.geojson --bbox 8.2,46.2,8.3,46.3\n"
      "  terrace mesh photo.png --image --out photo.glb --points 4000\n\n"
      "The printed errors are measured at every valid sample of the finished mesh. Voids do not count;\n"
      "triangles span them, and their number is printed. Triangles are counter-clockwise in the x and y\n"
      "of the file.");
  command->add_option("DEM", arguments->dem, "A raster that GDAL can read; a georeference is not needed")->required();
  command->add_option("-o,--out", arguments->out, "The file to write; its extension, .obj, .ply or .glb, is the format")
      ->type_name("FILE")
      ->required();
  command->add_option("--max-error", arguments->max_error, "No sample is farther from the mesh than this")
      ->type_name("METRES")
      ->check(Metres())
      ->group(kGoal);
  command->add_option("--points", arguments->points, "Number of vertices, the four corners included")
      ->type_name("N")
      ->check(NumberFrom<unsigned>(4, 1'000'000'000, "a whole number from 4 (the corners of the raster) to 1000000000"))
      ->group(kGoal);
  command->add_option("--rms", arguments->rms, "Root mean square error over all samples")
      ->type_name("METRES")
      ->check(Metres())
      ->group(kGoal);
  AddNodataOption(*command, arguments->nodata);
  command
      ->add_option(
          "--coordinates", arguments->coordinates,
          "pixel: x = column, y = row (from the top), z = height; crs: pixel centres in the raster's CRS; "
          "by default crs if the raster has one. With --edits, --bbox or --vertical: enu, metres east, north and up of "
          "the middle; ecef; geographic, degrees and metres")
      ->check(OneOf({"pixel", "crs", "enu", "ecef", "geographic"}))
      ->type_name("NAME");
  AddCriterionOptions(*command, *arguments);
  command->add_option("--threads", arguments->threads, "Threads to use at most; the mesh is the same with any number")
      ->check(NumberFrom(1, 256, "a whole number from 1 to 256"))
      ->type_name("N")
      ->capture_default_str();
  command->add_flag("--compact", arguments->compact,
                    "Drops vertices that the error bound does not need; with --max-error only");
  AddColorOptions(*command, arguments->color);
  AddAreaOptions(*command, arguments->area);
  command->add_flag("--json", arguments->json, "Prints the statistics as JSON");
  command->callback([arguments, &exit_code] { exit_code = FinishOutput(Mesh(*arguments)); });
}

}  // namespace terrace::cli
