// A decoder of quantized-mesh-1.0 for tests, written from the format's description (CesiumGS/quantized-mesh README). It
// shares no code with the encoder, and is safe for any input.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace terrace::proto {

struct DecodedExtension {
  std::uint8_t id = 0;
  std::string bytes;
};

struct DecodedTile {
  std::array<double, 3> center{}, sphere_center{}, horizon_point{};
  double sphere_radius = 0;
  float min_height = 0, max_height = 0;
  std::vector<int> u, v, h;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<std::uint32_t> west, south, east, north;
  std::vector<DecodedExtension> extensions;
};

// Returns nothing if the bytes end early, an index has no vertex, or bytes are left over that are not an extension.
std::optional<DecodedTile> DecodeQuantizedMesh(std::string_view bytes);

// The inverse of the octvertexnormals encoding, like CesiumJS's AttributeCompression.octDecode.
std::array<double, 3> DecodeOctNormal(std::uint8_t x, std::uint8_t y);

}  // namespace terrace::proto
