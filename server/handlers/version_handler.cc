#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "engine/gdal/gdal_runtime.h"
#include "proto/codec_versions.h"
#include "server/handlers/handlers.h"
#include "server/http/http_error.h"
#include "server/http/text.h"
#include "tiler/encoder_version.h"
#include "tiler/tile/build_id.h"

namespace terrace::server {
namespace {

using Json = nlohmann::ordered_json;

// The modules write "GDAL 3.6.2, PROJ 9.1.1": a name and a version without blanks.
Json Libraries() {
  Json libraries = Json::object();
  const std::string text = dem::GdalVersions() + ", " + proto::CodecVersions();
  std::string_view rest = text;
  while (!rest.empty()) {
    const std::string_view entry = NextPiece(rest, ',');
    const std::size_t blank = std::min(entry.rfind(' '), entry.size() - 1);
    libraries[std::string(entry.substr(0, blank))] = std::string(entry.substr(blank + 1));
  }
  return libraries;
}

}  // namespace

std::string VersionJson(const Catalog& catalog) {
  static const Json libraries = Libraries();
  Json document;
  document["product"] = "terrace";
  document["version"] = TERRACE_VERSION;
  document["build"] = fmt::format("{:016x}", tiler::BuildId());
  document["encoder"] = tiler::kEncoderVersion;
  document["libraries"] = libraries;
  document["datasets"] = Json::array();
  for (const DatasetView& dataset : catalog.datasets) {
    document["datasets"].push_back({{"name", dataset.name}, {"version", dataset.version()}});
  }
  return document.dump(2) + "\n";
}

Answer AnswerVersion(const HandlerState& state, const RequestContext& context) {
  if (const Result<void> none = RefuseParameters(context.route.query); !none) {
    return ClientErrorResponse(none.error(), context.request->id);
  }
  return StateResponse(200, "application/json", std::make_shared<const std::string>(VersionJson(*state.catalog)));
}

}  // namespace terrace::server
