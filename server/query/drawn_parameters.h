// The parameters that name a surface: that of the sources, or that of the meshes that clients decode. Pure.
#pragma once

#include <optional>
#include <string>

#include "engine/core/result.h"
#include "tiler/surface/drawn_points.h"

namespace terrace::server {

// As sent; nothing: not sent.
struct DrawnTexts {
  std::optional<std::string> surface, level, error, fraction, at_least, format, compression;
};

// Nothing: the surface of the sources. kInvalidArgument, with a message for the client: a wrong value, a parameter of
// surface=served without it, or two that exclude each other.
Result<std::optional<tiler::DrawnSurface>> ParseDrawn(const DrawnTexts& texts);

}  // namespace terrace::server
