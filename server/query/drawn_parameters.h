// The parameters that name a surface: that of the sources, or that of the meshes that clients decode; and the datum of
// heights. Pure.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "tiler/surface/drawn_surface.h"

namespace terrace::server {

// As sent; nothing: not sent.
struct DrawnTexts {
  std::optional<std::string> surface, level, error, fraction, at_least, format, compression;
};

// `datum`. kInvalidArgument: another word; the message is for the client.
Result<void> SetDatum(dem::HeightDatum& datum, std::string_view text);

// Nothing: the surface of the sources. kInvalidArgument, with a message for the client: a wrong value, a parameter of
// surface=served without it, or two that exclude each other.
Result<std::optional<tiler::DrawnSurface>> ParseDrawn(const DrawnTexts& texts);

}  // namespace terrace::server
