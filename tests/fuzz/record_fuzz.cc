// Records of the disk cache: bytes that were not written under a key are rejected, and accepted bytes are valid or
// rejected by their parser.
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "engine/core/check.h"
#include "engine/tin/greedy.h"
#include "tests/engine/tin/test_fields.h"
#include "tests/fuzz/fuzz_input.h"
#include "tiler/store/tile_record.h"

namespace terrace::fuzz {
namespace {

using namespace tiler;

const std::string& Key() {
  static const auto* const key = new std::string(RecordKey(RefinedTileKey{7, {4, 9, 11}}));
  return *key;
}

std::string SoundTile() {
  EncodedTile tile;
  tile.bytes = std::string(100, 'x');
  tile.etag = "\"0123456789abcdef\"";
  return SerializeTile(tile);
}

// 8 x 8 cells and the ring around them that normals need.
std::string SoundRefinement() {
  constexpr int kCells = 8;
  const tin::HeightField field = tin::HillField(kCells + 1, kCells + 1, 1);
  tin::GreedyOptions options;
  options.record = true;
  tin::GreedyTriangulation greedy(field, options);
  TERRACE_CHECK(greedy.Run({20}));
  dem::TileHeights heights;
  heights.lattice = {5, kCells};
  heights.stride = kCells + 3;
  heights.heights.assign(heights.stride * heights.stride, 12.5F);
  return SerializeRefinedTile({heights, greedy.MakeRefinement(), 20});
}

void TryRecord(std::string_view bytes) {
  if (const auto tile = ParseTile(bytes)) TERRACE_CHECK(SerializeTile(*tile) == bytes);
  const auto refined = ParseRefinedTile(bytes);
  if (!refined) return;
  TERRACE_CHECK(SerializeRefinedTile(*refined) == bytes);
  const int cells = refined->heights.lattice.cells;
  TERRACE_CHECK(refined->heights.stride == cells + 3 && refined->refinement->width() == cells + 1);
  for (int j = -1; j <= cells + 1; ++j) {
    for (int i = -1; i <= cells + 1; ++i) (void)refined->heights.At(i, j);
  }
}

void Run(FuzzInput& input) {
  static const std::string sound[] = {SoundTile(), SoundRefinement()};
  const int sort = input.Below(3);
  if (sort == 2) {
    TryRecord(input.rest());
    TERRACE_CHECK(!StripChecksum(Key(), input.rest()));  // except for one case in 2^64
    return;
  }
  const std::string written = AddChecksum(Key(), sound[sort]);
  std::string found = written;
  while (!input.empty()) {
    const std::size_t at = input.Take<std::uint16_t>() % found.size();
    if (at < 8 && input.Below(8) == 0) found.resize(1 + input.Take<std::uint16_t>() % found.size());
    found[at % found.size()] = input.Take<char>();
  }
  TERRACE_CHECK(StripChecksum(Key(), found).has_value() == (found == written));
  TERRACE_CHECK(!StripChecksum(Key() + "x", found));
  TryRecord(std::string_view(found).substr(0, found.size() < 8 ? 0 : found.size() - 8));
}

}  // namespace
}  // namespace terrace::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  terrace::fuzz::FuzzInput input(data, size);
  terrace::fuzz::Run(input);
  return 0;
}
