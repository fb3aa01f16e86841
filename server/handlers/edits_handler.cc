#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "engine/dem/tile_edits.h"
#include "server/api/caching.h"
#include "server/handlers/handlers.h"
#include "server/http/http_error.h"
#include "server/http/text.h"
#include "tiler/tile_pipeline.h"

namespace terrace::server {
namespace {

using Json = nlohmann::ordered_json;

// A tenth of a millimetre: degrees that were converted to plane coordinates and back are no more exact.
double Degrees(double value) { return std::round(value * 1e9) / 1e9; }

Json PositionsJson(const std::vector<dem::GeoPosition>& line) {
  Json positions = Json::array();
  for (const dem::GeoPosition& at : line) positions.push_back({Degrees(at.longitude), Degrees(at.latitude)});
  return positions;
}

Json FeatureJson(const dem::EditOutline& edit) {
  Json lines = Json::array();
  for (const auto& line : edit.lines) lines.push_back(PositionsJson(line));
  Json feature;
  feature["type"] = "Feature";
  Json& properties = feature["properties"];
  properties["op"] = edit.op;
  // Clients must not learn the server's folders.
  properties["file"] = std::filesystem::path(edit.file).filename().string();
  properties["feature"] = edit.feature;
  properties["area"] = edit.is_area;
  // Rings of several polygons are not told apart in the engine, so areas are their closed outlines.
  feature["geometry"] = {{"type", "MultiLineString"}, {"coordinates", std::move(lines)}};
  return feature;
}

}  // namespace

std::string EditsGeoJson(const std::vector<dem::EditOutline>& edits, const std::stop_token& stop) {
  // One feature at a time as JSON: a dataset may have a hundred thousand.
  std::string text = R"({"type":"FeatureCollection","features":[)";
  for (std::size_t i = 0; i < edits.size(); ++i) {
    if (stop.stop_requested()) return {};
    if (i > 0) text += ',';
    text += FeatureJson(edits[i]).dump(-1, ' ', false, Json::error_handler_t::replace);
  }
  return text + "]}";
}

DocumentAnswer DescribeEdits(const HandlerState& state, const RequestContext& context) {
  const Result<std::uint32_t> index = FindDataset(context.route.dataset, state.catalog->datasets);
  if (!index) return ClientErrorResponse(index.error(), context.request->id);
  if (const Result<void> none = RefuseParameters(context.route.query); !none) {
    return ClientErrorResponse(none.error(), context.request->id);
  }
  const tiler::Dataset& dataset = state.catalog->pipeline->datasets()[*index];
  const DatasetView& view = state.catalog->datasets[*index];
  if (!view.edits_hash) {
    return ProblemResponse(404, "this dataset has no edits; /datasets lists the URLs of each dataset",
                           context.request->id);
  }
  DocumentPlan plan;
  plan.key = "edits " + view.name;
  plan.generation = view.generation;
  plan.content_type = "application/geo+json";
  plan.cache_control = kRevalidate;
  plan.write = [&dataset](const std::stop_token& stop) {
    return EditsGeoJson(dem::TileEdits(*dataset.model).Outlines(), stop);
  };
  return plan;
}

}  // namespace terrace::server
