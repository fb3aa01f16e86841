// Colours of pixels, samples and vertices.
#pragma once

#include <array>
#include <cstdint>

namespace terrace {

// Red, green, blue.
using Rgb = std::array<std::uint8_t, 3>;

// Red, green, blue, alpha. Of samples: alpha 0 where the colour is not known, anything else where it is.
using Rgba = std::array<std::uint8_t, 4>;

}  // namespace terrace
