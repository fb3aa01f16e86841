#include "proto/media_type.h"

#include <algorithm>

#include "engine/core/ascii.h"

namespace terrace::proto {
namespace {

std::string_view Trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

// Removes from `rest` the text before the first `separator` outside of double quotes, and returns it.
std::string_view TakePart(std::string_view& rest, char separator) {
  bool quoted = false;
  std::size_t at = 0;
  for (; at < rest.size(); ++at) {
    if (rest[at] == '"') quoted = !quoted;
    if (rest[at] == separator && !quoted) break;
  }
  const std::string_view part = rest.substr(0, at);
  rest.remove_prefix(std::min(at + 1, rest.size()));
  return Trimmed(part);
}

struct Parameter {
  std::string_view name, value;
};

Parameter ParseParameter(std::string_view text) {
  const std::string_view name = TakePart(text, '=');
  std::string_view value = Trimmed(text);
  if (value.size() >= 2 && value.front() == '"' && value.back() == '"') value = value.substr(1, value.size() - 2);
  return {name, value};
}

}  // namespace

TileExtensions ParseExtensions(std::string_view names) {
  TileExtensions extensions;
  while (!names.empty()) {
    const std::string_view name = TakePart(names, '-');
    if (EqualsIgnoringCase(name, "octvertexnormals")) extensions.normals = true;
    if (EqualsIgnoringCase(name, "watermask")) extensions.water_mask = true;
    if (EqualsIgnoringCase(name, "metadata")) extensions.metadata = true;
  }
  return extensions;
}

TileExtensions ExtensionsInAccept(std::string_view accept) {
  TileExtensions extensions;
  while (!accept.empty()) {
    std::string_view range = TakePart(accept, ',');
    TakePart(range, ';');  // the media type itself
    while (!range.empty()) {
      const Parameter parameter = ParseParameter(TakePart(range, ';'));
      if (EqualsIgnoringCase(parameter.name, "extensions")) extensions = extensions | ParseExtensions(parameter.value);
    }
  }
  return extensions;
}

std::string_view QuantizedMeshContentType(TileExtensions extensions) {
  // By bits: normals 1, water mask 2, metadata 4.
  static constexpr std::string_view kTypes[] = {
      "application/vnd.quantized-mesh",
      "application/vnd.quantized-mesh;extensions=octvertexnormals",
      "application/vnd.quantized-mesh;extensions=watermask",
      "application/vnd.quantized-mesh;extensions=octvertexnormals-watermask",
      "application/vnd.quantized-mesh;extensions=metadata",
      "application/vnd.quantized-mesh;extensions=octvertexnormals-metadata",
      "application/vnd.quantized-mesh;extensions=watermask-metadata",
      "application/vnd.quantized-mesh;extensions=octvertexnormals-watermask-metadata",
  };
  return kTypes[(extensions.normals ? 1 : 0) + (extensions.water_mask ? 2 : 0) + (extensions.metadata ? 4 : 0)];
}

}  // namespace terrace::proto
