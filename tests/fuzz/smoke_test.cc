// Runs a fuzz target without a fuzzer: its corpus, then random inputs, the same in every run.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

#include "tests/fuzz/fuzz_input.h"

namespace terrace::fuzz {
namespace {

using Bytes = std::vector<std::uint8_t>;

std::vector<Bytes> Corpus() {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(TERRACE_FUZZ_CORPUS)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<Bytes> corpus;
  for (const auto& file : files) {
    std::ifstream in(file, std::ios::binary);
    corpus.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  return corpus;
}

void Try(const Bytes& input) {
  // A copy of exactly this size, so that a sanitizer finds the first byte that is read past it.
  const Bytes exact(input.begin(), input.end());
  LLVMFuzzerTestOneInput(exact.data(), exact.size());
}

class Mutator {
 public:
  explicit Mutator(const std::vector<Bytes>& corpus) : corpus_(corpus) {}

  // Three in four are inputs of the corpus with a few edits, the others noise, mostly short.
  Bytes Next() {
    if (corpus_.empty() || Below(4) == 0) return Noise(Below(4) == 0 ? 2000 : 40);
    Bytes bytes = Any();
    for (std::size_t edits = 1 + Below(6); edits > 0; --edits) Edit(bytes);
    return bytes;
  }

 private:
  std::size_t Below(std::size_t bound) { return random_() % bound; }
  const Bytes& Any() { return corpus_[Below(corpus_.size())]; }

  Bytes Noise(std::size_t most) {
    Bytes bytes(Below(most));
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random_());
    return bytes;
  }

  void Edit(Bytes& bytes) {
    const auto at = static_cast<std::ptrdiff_t>(Below(bytes.size() + 1));
    const auto place = bytes.begin() + at;
    const std::size_t left = bytes.size() - static_cast<std::size_t>(at);
    switch (Below(6)) {
      case 0:
        if (left > 0) *place ^= static_cast<std::uint8_t>(1u << Below(8));
        break;
      case 1: {
        constexpr std::uint8_t kTelling[] = {0,   1,   0x7f, 0x80, 0xff, '\n', '\r', ' ',
                                             '%', '&', '/',  '"',  '9',  '-',  '.'};
        if (left > 0) *place = kTelling[Below(std::size(kTelling))];
        break;
      }
      case 2:
        bytes.insert(place, static_cast<std::uint8_t>(random_()));
        break;
      case 3:
        bytes.erase(place, place + static_cast<std::ptrdiff_t>(Below(std::min<std::size_t>(left, 8) + 1)));
        break;
      default: {  // a piece of another input
        const Bytes& other = Any();
        const std::size_t from = Below(other.size() + 1);
        const std::size_t count = Below(std::min<std::size_t>(other.size() - from, 64) + 1);
        const auto begin = other.begin() + static_cast<std::ptrdiff_t>(from);
        bytes.insert(place, begin, begin + static_cast<std::ptrdiff_t>(count));
      }
    }
  }

  const std::vector<Bytes>& corpus_;
  std::mt19937 random_;
};

TEST(FuzzTarget, KeepsItsPromisesOnItsCorpus) {
  const std::vector<Bytes> corpus = Corpus();
  EXPECT_FALSE(corpus.empty()) << "no files in " << TERRACE_FUZZ_CORPUS;
  for (const Bytes& input : corpus) Try(input);
}

TEST(FuzzTarget, KeepsItsPromisesOnRandomInputs) {
  const std::vector<Bytes> corpus = Corpus();
  Mutator mutator(corpus);
  for (int run = 0; run < TERRACE_FUZZ_RUNS; ++run) Try(mutator.Next());
  RecordProperty("runs", TERRACE_FUZZ_RUNS);
}

}  // namespace
}  // namespace terrace::fuzz
