#include "server/query/tile_query.h"

#include <array>
#include <cstddef>

#include "engine/core/names.h"
#include "proto/documents/picture_names.h"
#include "proto/gltf/gltf_names.h"
#include "server/http/text.h"

namespace terrace::server {
namespace {

// If `repeatable`, a parameter may be repeated with the same value.
template <typename T>
Result<void> SetOnce(std::optional<T>& to, T value, const char* name, bool repeatable) {
  if (to && !(repeatable && *to == value)) {
    return MakeError(ErrorCode::kInvalidArgument, "{} is given more than once", name);
  }
  to = value;
  return {};
}

Result<void> SetPositive(std::optional<double>& to, const char* name, std::string_view text, bool repeatable) {
  const std::optional<double> value = PositiveNumber(text);
  if (!value) return MakeError(ErrorCode::kInvalidArgument, "{} must be a finite number above 0", name);
  return SetOnce(to, *value, name, repeatable);
}

template <typename T, std::size_t kCount>
Result<void> SetNamed(std::optional<T>& to, const char* name, std::string_view text, const Names<T, kCount>& names) {
  T value{};
  Result<void> set = SetOneOf(value, name, text, names);
  return set ? SetOnce(to, value, name, /*repeatable=*/true) : set;
}

Result<void> CheckTogether(const geo::RequestedError& requested) {
  if (requested.error_m && requested.fraction) {
    return MakeError(ErrorCode::kInvalidArgument, "error and fraction exclude each other");
  }
  if (requested.at_least && !requested.error_m) return MakeError(ErrorCode::kInvalidArgument, "atleast needs error");
  return {};
}

}  // namespace

Result<TileParameters> ParseTileParameters(std::string_view query, bool allow_at_least, bool allow_compression) {
  const Result<QueryParameters> sent = ParseQuery(query);
  if (!sent) return tl::unexpected(sent.error());
  TileParameters parameters;
  geo::RequestedError& requested = parameters.requested;
  bool at_least_given = false;
  const bool repeatable = allow_compression;
  for (const auto& [name, value] : *sent) {
    Result<void> set;
    if (name == "v") continue;
    if (name == "extensions") {
      parameters.extensions.push_back(value);
    } else if (name == "error") {
      set = SetPositive(requested.error_m, "error", value, repeatable);
    } else if (name == "fraction") {
      set = SetPositive(requested.fraction, "fraction", value, repeatable);
    } else if (name == "atleast" && allow_at_least) {
      if (at_least_given) return MakeError(ErrorCode::kInvalidArgument, "atleast is given more than once");
      at_least_given = true;
      set = SetOneOf(requested.at_least, "atleast", value, {{"0", false}, {"1", true}});
    } else if (name == "compression" && allow_compression) {
      set = SetNamed(parameters.compression, "compression", value, proto::kGlbCompressionNames);
    } else if (name == "texture" && allow_compression) {
      set = SetNamed(parameters.texture, "texture", value, proto::kTextureFormatNames);
    } else {
      set = MakeError(ErrorCode::kInvalidArgument, "unknown parameter; known are error, fraction, extensions{}{}",
                      allow_at_least ? ", atleast" : "", allow_compression ? ", compression, texture" : "");
    }
    if (!set) return tl::unexpected(set.error());
  }
  if (const Result<void> fits = CheckTogether(requested); !fits) return tl::unexpected(fits.error());
  return parameters;
}

Result<HeightTileParameters> ParseHeightTileParameters(std::string_view query) {
  constexpr std::array<const char*, 2> kNames = {"encoding", "size"};
  HeightTileParameters parameters;
  const Result<void> read = ReadParameters(query, kNames, [&](std::size_t i, const std::string& value) {
    return i == 0 ? SetOneOf(parameters.encoding, kNames[i], value, proto::kHeightEncodingNames)
                  : SetTileSize(parameters.size, value);
  });
  if (!read) return tl::unexpected(read.error());
  return parameters;
}

Result<void> SetTileSize(int& size, std::string_view text) {
  static_assert(tiler::kSidesPx == std::array{256, 512});
  return SetOneOf(size, "size", text, {{"256", 256}, {"512", 512}});
}

}  // namespace terrace::server
