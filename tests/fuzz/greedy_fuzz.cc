// Greedy insertion on a small field of arbitrary floats keeps the bound and covers the field.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "engine/tin/decimate/drop_pass.h"
#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/refinement.h"
#include "tests/engine/tin/rasterizer.h"
#include "tests/fuzz/fuzz_input.h"

namespace terrace::fuzz {
namespace {

using tin::Criterion;
using tin::FitMeasure;
using tin::HeightField;
using tin::TinMesh;

constexpr int kMaxSide = 20;

enum class Sort { kAnyBits, kPalette, kWholeMetres };

// One byte a sample makes fields with ties and plateaus, four bytes fields of arbitrary floats.
HeightField FieldOf(Sort sort, FuzzInput& input) {
  const int width = 2 + input.Below(kMaxSide - 1), height = 2 + input.Below(kMaxSide - 1);
  std::array<float, 8> palette{};
  if (sort == Sort::kPalette) {
    for (float& value : palette) value = input.Take<float>();
  }
  std::vector<float> heights;
  for (int i = 0; i < width * height; ++i) {
    switch (sort) {
      case Sort::kAnyBits:
        heights.push_back(input.Take<float>());
        break;
      case Sort::kPalette:
        heights.push_back(palette[static_cast<std::size_t>(input.Below(8))]);
        break;
      case Sort::kWholeMetres:
        heights.push_back(static_cast<float>(input.Take<std::int8_t>()));
        break;
    }
  }
  std::size_t valid = 0;
  for (const float value : heights) valid += std::isfinite(value) ? 1 : 0;
  Result<HeightField> field = HeightField::Make(width, height, heights);
  TERRACE_CHECK(field.has_value() == (valid > 0));  // the only reason to reject these
  if (field) return *std::move(field);
  heights[0] = 0;
  return HeightField::Make(width, height, std::move(heights)).value();
}

void Expect(const HeightField& field, const TinMesh& mesh, double bound) {
  const testing::AssertionResult keeps = Keeps(tin::Rasterize(field, mesh), bound);
  if (keeps) return;
  std::fprintf(stderr, "%d x %d samples, bound %g: %s\n", field.width(), field.height(), bound, keeps.message());
  std::abort();
}

void Run(FuzzInput& input) {
  tin::GreedyOptions options;
  options.record = true;
  options.criterion = static_cast<Criterion>(input.Below(2));
  options.data_dependent = {static_cast<FitMeasure>(input.Below(4)), input.Below(5) / 4.0};
  const auto sort = static_cast<Sort>(input.Below(3));
  const float given = sort == Sort::kWholeMetres ? static_cast<float>(input.Take<std::uint16_t>()) / 1024
                                                 : std::abs(input.Take<float>());
  const double bound = std::isfinite(given) ? static_cast<double>(given) : 0;
  const HeightField field = FieldOf(sort, input);

  tin::GreedyTriangulation greedy(field, options);
  TERRACE_CHECK(greedy.Run({bound}));
  const TinMesh mesh = greedy.Mesh();
  Expect(field, mesh, bound);
  Expect(field, greedy.MakeRefinement()->MeshAt(bound), bound);
  Expect(field, tin::DropVertices(field, mesh, {.max_error = bound}).value(), bound);
}

}  // namespace
}  // namespace terrace::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  terrace::fuzz::FuzzInput input(data, size);
  terrace::fuzz::Run(input);
  return 0;
}
