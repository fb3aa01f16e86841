// A fuzz target without a fuzzer: the same random inputs in every run.
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "tests/fuzz/fuzz_input.h"

namespace terrace::fuzz {
namespace {

TEST(FuzzTarget, KeepsItsPromisesOnRandomInputs) {
  std::mt19937 random;
  for (int run = 0; run < 20000; ++run) {
    // Mostly short: a few edits, a small field.
    std::vector<std::uint8_t> input(random() % (run % 4 == 0 ? 2000 : 40));
    for (std::uint8_t& byte : input) byte = static_cast<std::uint8_t>(random());
    LLVMFuzzerTestOneInput(input.data(), input.size());
  }
}

}  // namespace
}  // namespace terrace::fuzz
