#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/elapsed_time.h"
#include "engine/core/plain_number.h"
#include "server/api/caching.h"
#include "server/api/tile_formats.h"
#include "server/handlers/handlers.h"
#include "server/handlers/point_reply.h"
#include "server/http/http_error.h"
#include "server/query/grid_query.h"
#include "tiler/tile/strong_etag.h"

namespace terrace::server {
namespace {

// Nodes that are read at once.
constexpr std::int64_t kBatch = 65536;
constexpr int kLargest = 65535;  // of 16 bits
constexpr int kBoxDigits = 9;    // in messages: centimetres, or 10^-6 degrees

struct MadeGrid {
  MadeReply reply;
  std::string description;
};

// The code of heights as integers of 16 bits: height = offset + scale * integer.
struct Steps {
  double offset = 0, scale = 0;
  std::size_t voids = 0;

  static Steps Of(const std::vector<float>& heights, const std::optional<dem::HeightRange>& range) {
    double min = std::numeric_limits<double>::infinity(), max = -min;
    Steps steps;
    for (const float height : heights) {
      if (std::isnan(height)) ++steps.voids;
      if (height < min) min = height;
      if (height > max) max = height;
    }
    if (range) min = range->min, max = range->max;
    if (min > max) return steps;
    steps.offset = min;
    steps.scale = (max - min) / kLargest;
    return steps;
  }
  // Voids become the lowest height. Heights outside the range are clamped.
  std::uint16_t Encode(float height) const {
    if (std::isnan(height) || scale == 0) return 0;
    return static_cast<std::uint16_t>(std::clamp(std::floor((height - offset) / scale + 0.5), 0.0, double{kLargest}));
  }
};

Result<std::vector<float>> ReadNodes(const tiler::TilePipeline& pipeline, std::uint32_t dataset, const GridQuery& query,
                                     const dem::OutputGrid& grid, const std::stop_token& stop) {
  const Result<dem::GridPositions> positions = dem::GridPositions::Make(grid);
  if (!positions) return tl::unexpected(positions.error());
  std::vector<float> heights;
  heights.reserve(dem::Area(grid.columns, grid.rows));
  const std::int64_t strip = std::max<std::int64_t>(1, kBatch / grid.columns);
  for (std::int64_t row = 0; row < grid.rows; row += strip) {
    const auto points = positions->OfRows(row, std::min(strip, grid.rows - row), stop);
    if (!points) return tl::unexpected(points.error());
    const Result<tiler::PointHeights> read =
        query.drawn ? pipeline.ReadDrawnPoints(dataset, *query.drawn, *points, /*normals=*/false, stop)
                    : pipeline.ReadPoints(dataset, *points, query.datum, stop);
    if (!read) return tl::unexpected(read.error());
    heights.insert(heights.end(), read->heights.begin(), read->heights.end());
  }
  return heights;
}

// Where the data is, in words for `bbox`.
std::string DataBox(const dem::OutputGrid& grid, const DatasetView& view) {
  const std::optional<dem::GeoBounds> there = dem::BoundsInCrs(grid, view.bounds);
  const dem::GeoBounds& box = there ? *there : view.bounds;
  return fmt::format("{},{},{},{}{}", PlainNumber(box.west, kBoxDigits), PlainNumber(box.south, kBoxDigits),
                     PlainNumber(box.east, kBoxDigits), PlainNumber(box.north, kBoxDigits),
                     there ? "" : " in degrees of EPSG:4326");
}

// Integers have no value for a void. Beside the data all of them would be 0, which looks like the sea.
Result<void> CheckHasHeights(const GridQuery& query, const dem::OutputGrid& grid, const Steps& steps,
                             const DatasetView& view) {
  if (!HasIntegers(query.format) || query.range || steps.voids < dem::Area(grid.columns, grid.rows)) return {};
  return MakeError(ErrorCode::kInvalidArgument,
                   "bbox: no node of the grid has a height, and 16-bit integers have no value for a void; bbox is "
                   "west,south,east,north in units of the crs, EPSG:{}: {}; the data is in {}: choose a bbox there, "
                   "format=f32 or geotiff, where voids are NaN, or a range",
                   grid.epsg, grid.unit, DataBox(grid, view));
}

// As `bbox` takes it: west > east across the antimeridian.
double RequestedEast(const dem::OutputGrid& grid) {
  return grid.is_geographic && grid.east > 180 ? grid.east - 360 : grid.east;
}

// The Terrain-Grid header.
std::string Describe(const dem::OutputGrid& grid, const Steps& steps) {
  return fmt::format(
      "width={}, height={}, crs=\"EPSG:{}\", west={}, south={}, east={}, north={}, offset={}, scale={}, voids={}",
      grid.columns, grid.rows, grid.epsg, grid.west, grid.south, RequestedEast(grid), grid.north, steps.offset,
      steps.scale, steps.voids);
}

// Unreal Engine's landscapes: an integer is 1/128 cm at a scale of 1, and 32768 is height 0.
std::string GridJson(const dem::OutputGrid& grid, const Steps& steps) {
  constexpr double kUnrealSteps = 100 * 128;
  return fmt::format(
      "{{\"width\":{},\"height\":{},\"crs\":\"EPSG:{}\",\"bbox\":[{},{},{},{}],\"spacing\":[{},{}],\"offset\":{},"
      "\"scale\":{},\"voids\":{},\"unreal\":{{\"scale_z\":{},\"zero_m\":{}}}}}",
      grid.columns, grid.rows, grid.epsg, grid.west, grid.south, RequestedEast(grid), grid.north, grid.step_x(),
      grid.step_y(), steps.offset, steps.scale, steps.voids, steps.scale * kUnrealSteps,
      steps.offset + 32768 * steps.scale);
}

Result<std::string> Encode(const GridQuery& query, const dem::OutputGrid& grid, const std::vector<float>& heights,
                           const Steps& steps) {
  if (query.format == GridFormat::kJson) return GridJson(grid, steps);
  if (query.format == GridFormat::kGeoTiff) return dem::WriteGeoTiff(grid, heights);
  if (query.format == GridFormat::kF32) {
    return std::string(reinterpret_cast<const char*>(heights.data()), heights.size() * sizeof(float));
  }
  std::vector<std::uint16_t> values;
  values.reserve(heights.size());
  for (const float height : heights) values.push_back(steps.Encode(height));
  if (query.format == GridFormat::kPng16) return dem::WritePng16(grid, values);
  return std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(std::uint16_t));
}

std::string_view ContentTypeOf(GridFormat format) {
  switch (format) {
    case GridFormat::kGeoTiff:
      return "image/tiff; application=geotiff";
    case GridFormat::kPng16:
      return "image/png";
    case GridFormat::kJson:
      return "application/json";
    case GridFormat::kF32:
    case GridFormat::kR16:
      break;
  }
  return "application/octet-stream";
}

asio::awaitable<Response> MakeGrid(const HandlerState& state, const RequestContext& context, std::uint32_t dataset,
                                   std::shared_ptr<const GridQuery> query, tiler::Coding coding, Response response) {
  const DatasetView& view = state.catalog->datasets[dataset];
  Work<MadeGrid> work = [catalog = state.catalog, dataset, query, coding, most = state.max_mesh_samples,
                         requested_at = JobClock::now()](const std::stop_token& stop) -> Result<MadeGrid> {
    MadeGrid made;
    made.reply.times.queue = MicrosecondsSince(requested_at);
    auto begun = JobClock::now();
    const Result<dem::OutputGrid> grid = dem::PlanOutputGrid(query->grid, most);
    if (!grid) return tl::unexpected(grid.error());
    if (query->format == GridFormat::kGeoTiff) {  // before heights are read in vain
      if (const Result<void> written = dem::CheckGeoTiff(*grid); !written) return tl::unexpected(written.error());
    }
    const Result<std::vector<float>> heights = ReadNodes(*catalog->pipeline, dataset, *query, *grid, stop);
    if (!heights) return tl::unexpected(heights.error());
    made.reply.times.read = MicrosecondsSince(begun);
    begun = JobClock::now();
    const Steps steps = Steps::Of(*heights, query->range);
    const auto checked = CheckHasHeights(*query, *grid, steps, catalog->datasets[dataset]);
    if (!checked) return tl::unexpected(checked.error());
    Result<std::string> bytes = Encode(*query, *grid, *heights, steps);
    if (!bytes) return tl::unexpected(std::move(bytes).error());
    made.reply.times.encode = MicrosecondsSince(begun);
    made.reply.bytes = tiler::Compress(*std::move(bytes), coding, stop);
    made.description = Describe(*grid, steps);
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the grid any more");
    return made;
  };
  const auto deadline = context.request->deadline;
  Result<MadeGrid> made = co_await state.workers.Run(std::move(work), LongTerms(deadline, context.request->client));
  if (!made) co_return co_await FailedPointReply(made.error(), view, context.request->id);
  response.headers.emplace_back("Terrain-Grid", std::move(made->description));
  Response reply = co_await FinishPointReply(std::move(response), std::move(made->reply), view, context.request->id);
  co_return Conditional(std::move(reply), *context.request);
}

}  // namespace

Answer AnswerGrid(const HandlerState& state, const RequestContext& context) {
  const Request& request = *context.request;
  const Result<std::uint32_t> dataset = FindDataset(context.route.dataset, state.catalog->datasets);
  if (!dataset) return ClientErrorResponse(dataset.error(), request.id);
  Result<GridQuery> query = ParseGrid(context.route.query);
  if (!query) return ClientErrorResponse(query.error(), request.id);
  const DatasetView& view = state.catalog->datasets[*dataset];
  if (const Result<void> datum = CheckDatum(query->datum, view); !datum) {
    return ClientErrorResponse(datum.error(), request.id);
  }
  // Archives have only the heights of their meshes.
  if (view.only_archive && query->datum == dem::HeightDatum::kEllipsoid && !query->drawn && !query->names_source) {
    query->drawn.emplace();
  }
  const bool is_image = query->format == GridFormat::kGeoTiff || query->format == GridFormat::kPng16;
  const tiler::Coding coding = is_image ? tiler::Coding::kIdentity : NegotiateCoding(request.fields->accept_encoding);
  Response response;
  response.content_type = ContentTypeOf(query->format);
  response.content_encoding = tiler::NameOf(coding);
  if (!is_image) response.vary = "Accept-Encoding";
  // The generation does not cover the files of PROJ: geoids, and grids of the shifts between reference systems.
  const bool is_versioned = query->datum == dem::HeightDatum::kEllipsoid && query->grid.epsg == dem::kWgs84;
  response.cache_control = CacheControlOf(context.route.query, view, state.cache_control, is_versioned);
  if (is_versioned) {
    response.etag = tiler::RequestETag("grid", view.name, view.generation, context.route.query, coding);
  }
  if (NamesEtag(request.fields->if_none_match, response.etag)) return Conditional(std::move(response), request);
  auto shared = std::make_shared<const GridQuery>(*std::move(query));
  return MakeGrid(state, context, *dataset, std::move(shared), coding, std::move(response));
}

}  // namespace terrace::server
