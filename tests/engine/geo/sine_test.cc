#include "engine/geo/sine.h"

#include <gtest/gtest.h>

#include <boost/math/constants/constants.hpp>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <random>

#include "engine/geo/lattice.h"

namespace terrace::geo {
namespace {

using Float50 = boost::multiprecision::cpp_bin_float_50;

double RoundedToGrid(const Float50& value) {
  return static_cast<double>(ldexp(floor(ldexp(value, 44) + Float50(0.5)), -44));
}

void ExpectNearestOfGrid(double degrees) {
  const Float50 radians = Float50(degrees) * boost::math::constants::pi<Float50>() / 180;
  const SinCos found = RoundedSinCos(degrees);
  EXPECT_EQ(found.sin, RoundedToGrid(sin(radians))) << std::hexfloat << degrees;
  EXPECT_EQ(found.cos, RoundedToGrid(cos(radians))) << std::hexfloat << degrees;
}

TEST(RoundedSinCos, IsTheNearestOfItsGridAnywhere) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> turn(-180, 180), turns(-720, 720);
  for (int i = 0; i < 10'000; ++i) ExpectNearestOfGrid(turn(random));
  for (int i = 0; i < 1'000; ++i) ExpectNearestOfGrid(turns(random));
  for (int level = 0; level <= 24; ++level) {
    const Lattice lattice{level, 256};
    std::uniform_int_distribution<std::int64_t> column(0, lattice.columns() - 1), row(0, lattice.rows());
    for (int i = 0; i < 200; ++i) {
      ExpectNearestOfGrid(lattice.Longitude(column(random)));
      ExpectNearestOfGrid(lattice.Latitude(row(random)));
    }
  }
}

// Columns of level 24 whose sine is within 10^-6 of the middle between two numbers of the grid, found by testing 24
// million.
TEST(RoundedSinCos, IsTheNearestOfItsGridInHardCases) {
  for (const std::int64_t column :
       {799525173LL, 1284289178LL, 2161848957LL, 2708475579LL, 2987351176LL, 3012090043LL, 5135248501LL, 5458321717LL,
        5477287632LL, 5607577043LL, 6010508668LL, 6039625261LL}) {
    const double degrees = Lattice{24, 256}.Longitude(column);
    ExpectNearestOfGrid(degrees);
    ExpectNearestOfGrid(-degrees);
    ExpectNearestOfGrid(90 - degrees);
  }
}

// Around the octants, where signs change and sine and cosine are exchanged.
TEST(RoundedSinCos, IsTheNearestOfItsGridAroundOctants) {
  for (double octant = -360; octant <= 360; octant += 45) {
    for (const double offset : {1e-14, 1e-9, 1e-3}) {
      ExpectNearestOfGrid(octant + offset);
      ExpectNearestOfGrid(octant - offset);
    }
  }
}

TEST(RoundedSinCos, IsExactWhereItCanBe) {
  const auto expect = [](double degrees, double sine, double cosine) {
    const SinCos found = RoundedSinCos(degrees);
    EXPECT_EQ(found.sin, sine) << degrees;
    EXPECT_EQ(found.cos, cosine) << degrees;
    EXPECT_FALSE(found.sin == 0 && std::signbit(found.sin)) << degrees;
    EXPECT_FALSE(found.cos == 0 && std::signbit(found.cos)) << degrees;
  };
  expect(0, 0, 1);
  expect(-0.0, 0, 1);
  expect(90, 1, 0);
  expect(-90, -1, 0);
  expect(180, 0, -1);
  expect(-180, 0, -1);
  expect(360, 0, 1);
  EXPECT_EQ(RoundedSinCos(30).sin, 0.5);
  EXPECT_EQ(RoundedSinCos(-150).sin, -0.5);
  EXPECT_EQ(RoundedSinCos(60).cos, 0.5);
  EXPECT_EQ(RoundedSinCos(-120).cos, -0.5);
}

}  // namespace
}  // namespace terrace::geo
