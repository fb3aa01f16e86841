// Reads GLB tiles as a client does: container, JSON, plain arrays, Draco or meshopt, node matrix, y-up to z-up. Shares
// no code with the encoder.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/geo/ellipsoid.h"

namespace terrace::proto {

struct DecodedGlb {
  nlohmann::json json;
  std::vector<std::array<double, 3>> stored;  // as in the accessor, before the node matrix
  std::vector<geo::Vec3> positions;           // ECEF metres
  std::vector<geo::Vec3> normals;             // ECEF
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<std::array<double, 2>> uv;  // texture coordinates; empty: none
  std::string image;                      // bytes of the only image; empty: none
};

// Returns nothing if anything is missing, left over or out of range: counts and lengths that disagree, an index without
// a vertex, a view outside its buffer.
std::optional<DecodedGlb> DecodeGlb(std::string_view bytes);

// The corners of the triangles as positions, each triangle starting at its smallest corner, sorted: equal for two tiles
// with the same surface, whatever the order of their triangles.
using Corner = std::array<double, 3>;
std::vector<std::array<Corner, 3>> Surface(const DecodedGlb& glb);

// Sides of triangles that no other triangle has in the opposite direction: the open border. `doubled` counts sides that
// two triangles have in the same direction.
struct OpenSides {
  std::vector<std::array<Corner, 2>> sides;
  int doubled = 0;
};
OpenSides OpenSidesOf(const DecodedGlb& glb);

}  // namespace terrace::proto
