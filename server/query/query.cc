#include "server/query/query.h"

#include <utility>

#include "server/http/text.h"
#include "server/query/parameters.h"

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

Result<void> SetCompression(std::optional<proto::GlbCompression>& to, std::string_view text) {
  constexpr std::pair<std::string_view, proto::GlbCompression> kNames[] = {
      {"draco", proto::GlbCompression::kDraco},
      {"none", proto::GlbCompression::kNone},
      {"quantized", proto::GlbCompression::kQuantized},
      {"meshopt", proto::GlbCompression::kMeshopt}};
  for (const auto& [name, compression] : kNames) {
    if (text == name) return SetOnce(to, compression, "compression", /*repeatable=*/true);
  }
  return MakeError(ErrorCode::kInvalidArgument, "compression must be draco, none, quantized or meshopt");
}

Result<void> SetTexture(std::optional<proto::TextureFormat>& to, std::string_view text) {
  constexpr std::pair<std::string_view, proto::TextureFormat> kNames[] = {{"none", proto::TextureFormat::kNone},
                                                                          {"jpeg", proto::TextureFormat::kJpeg},
                                                                          {"webp", proto::TextureFormat::kWebp}};
  for (const auto& [name, texture] : kNames) {
    if (text == name) return SetOnce(to, texture, "texture", /*repeatable=*/true);
  }
  return MakeError(ErrorCode::kInvalidArgument, "texture must be jpeg, webp or none");
}

Result<void> CheckTogether(const RequestedError& requested) {
  if (requested.error_m && requested.fraction) {
    return MakeError(ErrorCode::kInvalidArgument, "error and fraction exclude each other");
  }
  if (requested.at_least && !requested.error_m) return MakeError(ErrorCode::kInvalidArgument, "atleast needs error");
  return {};
}

class Collector final : public ParameterSink {
 public:
  Result<void> AddToName(std::string_view part) override {
    name_ += part;
    return {};
  }
  Result<void> EndName() override {
    parameters_.emplace_back(std::exchange(name_, {}), "");
    return {};
  }
  Result<void> AddToValue(std::string_view part) override {
    parameters_.back().second += part;
    return {};
  }
  Result<void> EndValue() override { return {}; }

  QueryParameters Take() && { return std::move(parameters_); }

 private:
  QueryParameters parameters_;
  std::string name_;
};

}  // namespace

std::optional<std::string> PercentDecode(std::string_view text) {
  std::string decoded;
  decoded.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      decoded += text[i];
      continue;
    }
    if (text.size() - i < 3) return std::nullopt;
    const int high = HexDigit(text[i + 1]), low = HexDigit(text[i + 2]);
    if (high < 0 || low < 0) return std::nullopt;
    const int byte = high * 16 + low;
    if (byte < 0x20 || byte == 0x7f) return std::nullopt;
    decoded += static_cast<char>(byte);
    i += 2;
  }
  return decoded;
}

Result<QueryParameters> ParseQuery(std::string_view query) {
  Collector collector;
  std::size_t at = 0;
  if (const Result<void> read = ReadForm(PartsOf(query, {}), PlusSign::kIsPlus, collector, at); !read) {
    return tl::unexpected(read.error());
  }
  return std::move(collector).Take();
}

Result<TileParameters> ParseTileParameters(std::string_view query, bool allow_at_least, bool allow_compression) {
  const Result<QueryParameters> sent = ParseQuery(query);
  if (!sent) return tl::unexpected(sent.error());
  TileParameters parameters;
  RequestedError& requested = parameters.requested;
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
      if (value != "0" && value != "1") return MakeError(ErrorCode::kInvalidArgument, "atleast must be 0 or 1");
      at_least_given = true;
      requested.at_least = value == "1";
    } else if (name == "compression" && allow_compression) {
      set = SetCompression(parameters.compression, value);
    } else if (name == "texture" && allow_compression) {
      set = SetTexture(parameters.texture, value);
    } else {
      set = MakeError(ErrorCode::kInvalidArgument, "unknown parameter; known are error, fraction{}{}",
                      allow_at_least ? ", atleast, extensions" : "", allow_compression ? ", compression, texture" : "");
    }
    if (!set) return tl::unexpected(set.error());
  }
  if (const Result<void> fits = CheckTogether(requested); !fits) return tl::unexpected(fits.error());
  return parameters;
}

Result<HeightTileParameters> ParseHeightTileParameters(std::string_view query) {
  const Result<QueryParameters> sent = ParseQuery(query);
  if (!sent) return tl::unexpected(sent.error());
  std::optional<proto::HeightEncoding> encoding;
  std::optional<int> size;
  for (const auto& [name, value] : *sent) {
    if (name == "v") continue;
    if (name == "encoding") {
      if (encoding) return MakeError(ErrorCode::kInvalidArgument, "encoding is given more than once");
      if (value == "mapbox") encoding = proto::HeightEncoding::kMapbox;
      if (value == "terrarium") encoding = proto::HeightEncoding::kTerrarium;
      if (!encoding) return MakeError(ErrorCode::kInvalidArgument, "encoding must be mapbox or terrarium");
    } else if (name == "size") {
      if (size) return MakeError(ErrorCode::kInvalidArgument, "size is given more than once");
      if (value == "256") size = 256;
      if (value == "512") size = 512;
      if (!size) return MakeError(ErrorCode::kInvalidArgument, "size must be 256 or 512");
    } else {
      return MakeError(ErrorCode::kInvalidArgument, "unknown parameter; known are encoding, size");
    }
  }
  HeightTileParameters parameters;
  parameters.encoding = encoding.value_or(parameters.encoding);
  parameters.size = size.value_or(parameters.size);
  return parameters;
}

Result<void> RefuseParameters(std::string_view query) {
  const Result<QueryParameters> sent = ParseQuery(query);
  if (!sent) return tl::unexpected(sent.error());
  for (const auto& [name, value] : *sent) {
    if (name != "v") return MakeError(ErrorCode::kInvalidArgument, "this URL takes no parameters");
  }
  return {};
}

}  // namespace terrace::server
