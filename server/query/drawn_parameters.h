// The parameters that name a surface: that of the sources, or that of the meshes that clients decode; and the datum of
// heights. Pure.
#pragma once

#include <array>
#include <optional>
#include <string_view>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "server/query/streamed_parameters.h"
#include "tiler/surface/drawn_surface.h"

namespace terrace::server {

// The parameters that need surface=served.
inline constexpr std::array<std::string_view, 6> kDrawnNames = {"level",   "error",  "fraction",
                                                                "atleast", "format", "compression"};

// `datum`. kInvalidArgument: another word; the message is for the client.
Result<void> SetDatum(dem::HeightDatum& datum, std::string_view text);

// Reads `surface` and kDrawnNames. Nothing: the surface of the sources. kInvalidArgument, with a message for the
// client: a wrong value, a parameter of surface=served without it, or two that exclude each other.
Result<std::optional<tiler::DrawnSurface>> ParseDrawn(const SentTexts& texts);

}  // namespace terrace::server
