#include "server/query/drawn_parameters.h"

#include <utility>

#include "engine/geo/tile_key.h"
#include "proto/gltf/gltf_names.h"
#include "server/http/text.h"

namespace terrace::server {
namespace {

Result<void> SetLevel(const SentTexts& texts, tiler::DrawnSurface& drawn) {
  const std::string* const text = TextOf(texts, "level");
  if (text == nullptr) return {};
  const auto level = PlainDecimal(*text, /*max_digits=*/2);
  if (!level || *level > geo::kMaxLevel) {
    return MakeError(ErrorCode::kInvalidArgument, "level must be a whole number from 0 to {}", geo::kMaxLevel);
  }
  drawn.level = static_cast<int>(*level);
  return {};
}

Result<void> SetRequested(const SentTexts& texts, geo::RequestedError& requested) {
  for (const auto& [name, of] : {std::pair("error", &requested.error_m), std::pair("fraction", &requested.fraction)}) {
    const std::string* const text = TextOf(texts, name);
    if (text == nullptr) continue;
    *of = PositiveNumber(*text);
    if (!*of) return MakeError(ErrorCode::kInvalidArgument, "{} must be a finite number above 0", name);
  }
  if (requested.error_m && requested.fraction) {
    return MakeError(ErrorCode::kInvalidArgument, "error and fraction exclude each other");
  }
  const std::string* const at_least = TextOf(texts, "atleast");
  if (at_least == nullptr) return {};
  const Result<void> set = SetOneOf(requested.at_least, "atleast", *at_least, {{"0", false}, {"1", true}});
  if (!set) return set;
  if (requested.at_least && !requested.error_m) {
    return MakeError(ErrorCode::kInvalidArgument, "atleast needs error");
  }
  return {};
}

Result<void> SetFormat(const SentTexts& texts, tiler::DrawnSurface& drawn) {
  if (const std::string* const format = TextOf(texts, "format")) {
    using tiler::TileFormat;
    const Result<void> set =
        SetOneOf(drawn.format, "format", *format, {{"terrain", TileFormat::kQuantizedMesh}, {"glb", TileFormat::kGlb}});
    if (!set) return set;
  }
  const std::string* const compression = TextOf(texts, "compression");
  if (compression == nullptr) return {};
  if (drawn.format != tiler::TileFormat::kGlb) {
    return MakeError(ErrorCode::kInvalidArgument, "compression needs format=glb");
  }
  return SetOneOf(drawn.compression.emplace(), "compression", *compression, proto::kGlbCompressionNames);
}

}  // namespace

Result<void> SetDatum(dem::HeightDatum& datum, std::string_view text) {
  using dem::HeightDatum;
  return SetOneOf(datum, "datum", text,
                  {{"ellipsoid", HeightDatum::kEllipsoid}, {"orthometric", HeightDatum::kOrthometric}});
}

Result<std::optional<tiler::DrawnSurface>> ParseDrawn(const SentTexts& texts) {
  bool is_served = false;
  if (const std::string* const surface = TextOf(texts, "surface")) {
    const Result<void> set = SetOneOf(is_served, "surface", *surface, {{"source", false}, {"served", true}});
    if (!set) return tl::unexpected(set.error());
  }
  if (!is_served) {
    for (const std::string_view name : kDrawnNames) {
      if (texts.contains(name)) return MakeError(ErrorCode::kInvalidArgument, "{} needs surface=served", name);
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
