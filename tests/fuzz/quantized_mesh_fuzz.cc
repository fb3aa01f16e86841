// The tests' decoder of quantized-mesh either rejects arbitrary bytes, or returns a mesh with valid indices. Tests
// depend on it, so it must neither read past the end nor accept invalid tiles.
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "engine/core/check.h"
#include "tests/fuzz/fuzz_input.h"
#include "tests/proto/grid_tile.h"
#include "tests/proto/quantized_mesh_decoder.h"

namespace terrace::fuzz {
namespace {

const std::string& SoundTile() {
  static const auto* const tile =
      new std::string(proto::EncodeQuantizedMesh(proto::GridTile({3, 5, 4}, 3, 2, -20, 900, proto::Rugged()), {}));
  return *tile;
}

// The input itself, or a valid tile with edits, because random bytes alone never get past the header.
std::string BytesOf(FuzzInput& input) {
  if (input.Below(2) == 0) return std::string(input.rest());
  std::string bytes = SoundTile();
  bytes.resize(bytes.size() - input.Below(2) * (input.Take<std::uint16_t>() % bytes.size()));
  while (!input.empty()) {
    const std::size_t at = input.Take<std::uint16_t>() % bytes.size();
    bytes[at] = input.Take<char>();
  }
  return bytes;
}

void Run(FuzzInput& input) {
  const std::string bytes = BytesOf(input);
  const auto tile = proto::DecodeQuantizedMesh(bytes);
  if (!tile) return;
  const std::size_t vertices = tile->u.size();
  TERRACE_CHECK(tile->v.size() == vertices && tile->h.size() == vertices);
  for (const auto* values : {&tile->u, &tile->v, &tile->h}) {
    for (const int value : *values) TERRACE_CHECK(value >= 0 && value <= 32767);
  }
  for (const auto& triangle : tile->triangles) {
    for (const std::uint32_t corner : triangle) TERRACE_CHECK(corner < vertices);
  }
  for (const auto* edge : {&tile->west, &tile->south, &tile->east, &tile->north}) {
    for (const std::uint32_t index : *edge) TERRACE_CHECK(index < vertices);
  }
  std::size_t extensions = 0;
  for (const auto& extension : tile->extensions) extensions += 5 + extension.bytes.size();
  // The sizes of all parts add up, with 92 bytes of the header and its count, except for the padding of the indices.
  const std::size_t width = vertices > 65536 ? 4 : 2;
  const std::size_t indices =
      3 * tile->triangles.size() + tile->west.size() + tile->south.size() + tile->east.size() + tile->north.size();
  const std::size_t known = 92 + 6 * vertices + 5 * 4 + width * indices + extensions;
  TERRACE_CHECK(known <= bytes.size() && bytes.size() < known + width);
}

}  // namespace
}  // namespace terrace::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  terrace::fuzz::FuzzInput input(data, size);
  terrace::fuzz::Run(input);
  return 0;
}
