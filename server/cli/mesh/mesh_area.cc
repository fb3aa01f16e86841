#include "server/cli/mesh/mesh_area.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "config/config.h"
#include "config/file/parse.h"
#include "config/options/options.h"
#include "engine/core/elapsed_time.h"
#include "engine/core/plain_number.h"
#include "engine/dem/elevation_model.h"
#include "proto/gltf/mesh_file.h"
#include "server/cli/common/command.h"
#include "server/cli/common/open_dataset.h"
#include "server/cli/common/option_flags.h"
#include "server/cli/common/progress.h"
#include "server/cli/mesh/mesh_input.h"
#include "server/cli/mesh/mesh_output.h"
#include "server/query/mesh_query.h"
#include "tiler/area/area_mesh.h"

namespace terrace::cli {
namespace {

using Clock = std::chrono::steady_clock;

// In the order of tiler::AreaCoordinates.
constexpr std::array kCoordinates = {"enu", "ecef", "geographic"};

// The dataset that the options describe. Reports what is wrong with them, and returns nothing.
std::optional<config::DatasetConfig> DatasetOf(const AreaMeshArguments& arguments) {
  config::DatasetConfig dataset;
  std::vector<config::ConfigError> wrong;
  std::error_code unnamed;
  const std::filesystem::path directory = std::filesystem::current_path(unnamed);
  for (const auto& [key, text] : arguments.area.dataset) {
    config::SetDatasetOption(key, text, directory, dataset, wrong);
  }
  if (!wrong.empty()) {
    Fail(wrong);
    return std::nullopt;
  }
  const dem::ReadOptions read = ReadOptionsOf(arguments.nodata, {});
  dataset.nodata = {read.find_voids, read.nodata};
  return dataset;
}

Result<tiler::AreaRequest> RequestOf(const AreaMeshArguments& arguments, const dem::GeoBounds& bounds) {
  dem::GeoBounds box = bounds;
  if (!arguments.area.box.empty()) {
    const Result<dem::GeoBounds> parsed = server::ParseBox(arguments.area.box);
    if (!parsed) return MakeError(ErrorCode::kInvalidArgument, "--{}", parsed.error().message);
    box = *parsed;
  }
  tiler::AreaRequest request;
  request.west = box.west, request.south = box.south, request.north = box.north;
  request.east = box.east < box.west ? box.east + 360 : box.east;
  request.error_m = arguments.max_error_m;
  const auto coordinates = std::find(kCoordinates.begin(), kCoordinates.end(), arguments.coordinates);
  if (coordinates != kCoordinates.end()) {
    request.coordinates = static_cast<tiler::AreaCoordinates>(coordinates - kCoordinates.begin());
  }
  const Result<proto::MeshFileFormat> format = proto::MeshFileFormatOf(arguments.out);
  if (!format) return tl::unexpected(format.error());
  request.format = *format;
  return request;
}

void Print(const AreaMeshArguments& arguments, const dem::ElevationModel& model, const tiler::AreaRequest& request,
           const tiler::AreaPlan& plan, const tiler::EncodedTile& mesh, const MeshSeconds& seconds) {
  const bool is_local = request.coordinates == tiler::AreaCoordinates::kEnu;
  const double longitude = plan.centre.longitude > 180 ? plan.centre.longitude - 360 : plan.centre.longitude;
  const std::array<double, 2> origin = {plan.centre.latitude, longitude};
  if (arguments.json) {
    nlohmann::ordered_json statistics = {
        {"input", {{"path", arguments.dem}, {"width", plan.window.columns}, {"height", plan.window.rows}}},
        {"edits", model.info().edits},
        {"level", plan.level},
        {"coordinates", kCoordinates[static_cast<std::size_t>(request.coordinates)]},
        {"criterion", "delaunay"},
        {"points", mesh.vertices},
        {"triangles", mesh.triangles},
        {"max_error", mesh.max_error_m},
        {"seconds", {{"read", seconds.read}, {"triangulate", seconds.triangulate}, {"write", seconds.write}}},
        {"peak_rss_bytes", PeakRssBytes()}};
    if (is_local) statistics["origin"] = origin;
    fmt::print("{}\n", statistics.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
    return;
  }
  fmt::print(
      "{}: {} vertices, {} triangles of {} x {} samples of level {}, {} edit{}; largest error {} m{}\n", arguments.out,
      mesh.vertices, mesh.triangles, plan.window.columns, plan.window.rows, plan.level, model.info().edits,
      model.info().edits == 1 ? "" : "s", PlainNumber(mesh.max_error_m, 4),
      is_local ? fmt::format("; metres east, north and up of latitude {}, longitude {}", origin[0], origin[1]) : "");
}

}  // namespace

bool IsOfAreas(const std::string& coordinates) {
  return std::find(kCoordinates.begin(), kCoordinates.end(), coordinates) != kCoordinates.end();
}

int MeshArea(const AreaMeshArguments& arguments) {
  std::optional<config::DatasetConfig> dataset = DatasetOf(arguments);
  if (!dataset) return kExitUsage;
  Result<config::SourceConfig> file = config::SourceAt(arguments.dem);
  if (!file) return Fail(file.error().message, kExitFailure);
  dataset->sources = {*std::move(file)};
  std::vector<std::string> inputs = dataset->edits;
  inputs.push_back(arguments.dem);
  Result<MeshOutput> output = MeshOutput::Open(arguments.out, inputs);
  if (!output) return Fail(output.error());

  MeshSeconds seconds;
  Clock::time_point start = Clock::now();
  auto model = [&] {
    Progress progress("reading " + arguments.dem);
    return OpenModel(*dataset, {}, progress.Callback());
  }();
  if (!model) return Fail(model.error().message, kExitFailure);
  const Result<tiler::AreaRequest> request = RequestOf(arguments, (*model)->info().bounds);
  if (!request) return Fail(request.error());
  // Memory is the user's: only the sides of a mesh are limited.
  const Result<tiler::AreaPlan> plan = tiler::PlanArea(**model, dataset->error_fraction, *request,
                                                       std::size_t{std::numeric_limits<std::int64_t>::max()});
  if (!plan) return Fail(plan.error());
  seconds.read = SecondsSince(start);

  start = Clock::now();
  const Result<tiler::EncodedTile> mesh = tiler::BuildAreaMesh(**model, *plan, *request, {});
  if (!mesh) return Fail(mesh.error().message, kExitFailure);
  seconds.triangulate = SecondsSince(start);

  start = Clock::now();
  if (const Result<void> written = output->Write(mesh->bytes); !written) {
    return Fail(written.error().message, kExitFailure);
  }
  seconds.write = SecondsSince(start);
  Print(arguments, **model, *request, *plan, *mesh, seconds);
  return kExitOk;
}

void AddAreaOptions(CLI::App& command, AreaOptions& options) {
  constexpr const char* kGroup = "Meshes of an area, as /{dataset}/mesh of a server; need --max-error";
  std::vector<config::OptionInfo> dataset_options = config::DatasetOptionInfos();
  std::erase_if(dataset_options, [](const auto& option) { return option.key != "edits" && option.key != "vertical"; });
  AddFlags(command, dataset_options, kGroup, options.dataset);
  command.add_option("--bbox", options.box, "The area in degrees; by default all of the DEM")
      ->type_name("W,S,E,N")
      ->group(kGroup);
}

}  // namespace terrace::cli
