#include "server/query/drawn_parameters.h"

#include <utility>

#include "engine/geo/tile_key.h"
#include "proto/gltf/gltf_names.h"
#include "server/http/text.h"

namespace terrace::server {
namespace {

Result<void> SetLevel(const DrawnTexts& texts, tiler::DrawnSurface& drawn) {
  if (!texts.level) return {};
  const auto level = PlainDecimal(*texts.level, /*max_digits=*/2);
  if (!level || *level > geo::kMaxLevel) {
    return MakeError(ErrorCode::kInvalidArgument, "level must be a whole number from 0 to {}", geo::kMaxLevel);
  }
  drawn.level = static_cast<int>(*level);
  return {};
}

Result<void> SetRequested(const DrawnTexts& texts, tiler::RequestedError& requested) {
  for (const auto& [name, text, of] : {std::tuple("error", &texts.error, &requested.error_m),
                                       std::tuple("fraction", &texts.fraction, &requested.fraction)}) {
    if (!*text) continue;
    *of = PositiveNumber(**text);
    if (!*of) return MakeError(ErrorCode::kInvalidArgument, "{} must be a finite number above 0", name);
  }
  if (requested.error_m && requested.fraction) {
    return MakeError(ErrorCode::kInvalidArgument, "error and fraction exclude each other");
  }
  if (!texts.at_least) return {};
  const Result<void> set = SetOneOf(requested.at_least, "atleast", *texts.at_least, {{"0", false}, {"1", true}});
  if (!set) return set;
  if (requested.at_least && !requested.error_m) {
    return MakeError(ErrorCode::kInvalidArgument, "atleast needs error");
  }
  return {};
}

Result<void> SetFormat(const DrawnTexts& texts, tiler::DrawnSurface& drawn) {
  if (texts.format) {
    using tiler::TileFormat;
    const Result<void> set = SetOneOf(drawn.format, "format", *texts.format,
                                      {{"terrain", TileFormat::kQuantizedMesh}, {"glb", TileFormat::kGlb}});
    if (!set) return set;
  }
  if (!texts.compression) return {};
  if (drawn.format != tiler::TileFormat::kGlb) {
    return MakeError(ErrorCode::kInvalidArgument, "compression needs format=glb");
  }
  return SetOneOf(drawn.compression.emplace(), "compression", *texts.compression, proto::kGlbCompressionNames);
}

}  // namespace

Result<void> SetDatum(dem::HeightDatum& datum, std::string_view text) {
  using dem::HeightDatum;
  return SetOneOf(datum, "datum", text,
                  {{"ellipsoid", HeightDatum::kEllipsoid}, {"orthometric", HeightDatum::kOrthometric}});
}

Result<std::optional<tiler::DrawnSurface>> ParseDrawn(const DrawnTexts& texts) {
  bool is_served = false;
  const Result<void> surface =
      SetOneOf(is_served, "surface", texts.surface.value_or("source"), {{"source", false}, {"served", true}});
  if (!surface) return tl::unexpected(surface.error());
  if (!is_served) {
    for (const auto& [name, text] :
         {std::pair("level", &texts.level), std::pair("error", &texts.error), std::pair("fraction", &texts.fraction),
          std::pair("atleast", &texts.at_least), std::pair("format", &texts.format),
          std::pair("compression", &texts.compression)}) {
      if (*text) return MakeError(ErrorCode::kInvalidArgument, "{} needs surface=served", name);
    }
    return std::optional<tiler::DrawnSurface>();
  }
  tiler::DrawnSurface drawn;
  for (const Result<void>& set :
       {SetLevel(texts, drawn), SetRequested(texts, drawn.requested), SetFormat(texts, drawn)}) {
    if (!set) return tl::unexpected(set.error());
  }
  return std::optional(drawn);
}

}  // namespace terrace::server
