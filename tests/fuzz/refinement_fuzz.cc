// Refinement::Parse on arbitrary bytes with a correct checksum: it rejects them, or the meshes of the result are valid.
#include <xxhash.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "engine/core/check.h"
#include "engine/tin/greedy.h"
#include "engine/tin/refinement.h"
#include "tests/engine/tin/test_fields.h"
#include "tests/fuzz/fuzz_input.h"

namespace terrace::fuzz {
namespace {

using tin::Refinement;
using tin::TinMesh;

// A refinement of 9 x 9 samples, without the checksum.
const std::string& SerializedSeed() {
  static const auto* const seed = [] {
    const tin::HeightField field = tin::HillField(9, 9, 1);
    tin::GreedyOptions options;
    options.record = true;
    tin::GreedyTriangulation greedy(field, options);
    TERRACE_CHECK(greedy.Run({20}));
    std::string bytes = greedy.MakeRefinement()->Serialize();
    bytes.resize(bytes.size() - sizeof(std::uint64_t));
    return new std::string(std::move(bytes));
  }();
  return *seed;
}

// The input after a valid beginning, or a valid refinement with edits, because random bytes alone never get past the
// start.
std::string ContentOf(FuzzInput& input) {
  std::string content = SerializedSeed();
  if (input.Below(4) == 0) {
    content.resize(input.Take<std::uint16_t>() % content.size());
    return content.append(input.rest());
  }
  while (!input.empty()) {
    const std::size_t at = input.Take<std::uint16_t>() % content.size();
    content[at] = input.Take<char>();
  }
  return content;
}

void ExpectSound(const TinMesh& mesh, std::size_t points) {
  TERRACE_CHECK(mesh.vertices.size() == points);
  TERRACE_CHECK(mesh.triangles.size() <= 2 * points);
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t corner : triangle) TERRACE_CHECK(corner < points);
  }
}

void Run(FuzzInput& input) {
  std::string bytes = ContentOf(input);
  const std::uint64_t hash = XXH3_64bits(bytes.data(), bytes.size());
  bytes.append(reinterpret_cast<const char*>(&hash), sizeof(hash));
  const Result<Refinement> parsed = Refinement::Parse(bytes);
  if (!parsed) {
    TERRACE_CHECK(parsed.error().code == ErrorCode::kInvalidArgument);
    return;
  }
  TERRACE_CHECK(parsed->Serialize() == bytes);
  for (std::size_t points = 4; points <= parsed->vertex_count(); ++points) ExpectSound(parsed->MeshOf(points), points);
  for (const double error : {0.0, 20.0, std::numeric_limits<double>::infinity()}) {
    const std::size_t points = parsed->PointsAt(error);
    TERRACE_CHECK(points >= 4 && points <= parsed->vertex_count());
  }
}

}  // namespace
}  // namespace terrace::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  terrace::fuzz::FuzzInput input(data, size);
  terrace::fuzz::Run(input);
  return 0;
}
