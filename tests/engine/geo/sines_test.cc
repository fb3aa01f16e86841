// Sines of many angles are those of single ones, bit for bit, on every set of instructions.
#include "engine/geo/sines.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "engine/geo/lattice.h"
#include "tests/engine/tin/instruction_sets.h"

namespace terrace::geo {
namespace {

// Also the sign of zero.
bool HasSameBits(const SinCos& a, const SinCos& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

TEST(RoundedSinCosOf, IsThatOfSingleAngles) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> turns(-720, 720);
  std::vector<double> degrees;
  for (int i = 0; i < 20'000; ++i) degrees.push_back(turns(random));
  for (int level = 0; level <= 24; ++level) {
    const Lattice lattice{level, 256};
    const std::int64_t first = static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(lattice.columns()));
    for (int k = 0; k <= 256; ++k) degrees.push_back(lattice.Longitude(first + k));
    for (int k = 0; k <= 256; ++k) degrees.push_back(lattice.Latitude(first / 2 + k));
  }
  // In these, double precision does not decide (sine_test.cc); and where signs change and sine and cosine are
  // exchanged.
  for (const std::int64_t column : {799525173LL, 1284289178LL, 2161848957LL, 6039625261LL}) {
    degrees.push_back(Lattice{24, 256}.Longitude(column));
  }
  for (double octant = -360; octant <= 360; octant += 45) {
    for (const double offset : {-1e-9, 0.0, 1e-14, 1e-3}) degrees.push_back(octant + offset);
  }
  tin::ForEachInstructionSet([&] {
    const std::vector<SinCos> all = RoundedSinCosOf(degrees);
    ASSERT_EQ(all.size(), degrees.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
      ASSERT_TRUE(HasSameBits(all[i], RoundedSinCos(degrees[i]))) << std::hexfloat << degrees[i];
    }
    for (std::size_t count = 0; count < 20; ++count) {
      const std::vector<SinCos> few = RoundedSinCosOf(std::span(degrees).first(count));
      for (std::size_t i = 0; i < count; ++i) EXPECT_TRUE(HasSameBits(few[i], all[i])) << count;
    }
  });
}

}  // namespace
}  // namespace terrace::geo
