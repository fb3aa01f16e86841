#include "tiler/tile/coding.h"

#include <gtest/gtest.h>

#include <set>

namespace terrace::tiler {
namespace {

TEST(Coding, MakesBytesSmallerAndAlwaysTheSame) {
  const std::string bytes(10'000, 'x');
  std::set<std::string> compressed, names;
  for (const Coding coding : kCodings) {
    compressed.insert(Compress(bytes, coding));
    names.emplace(NameOf(coding));
    EXPECT_EQ(Compress(bytes, coding), Compress(bytes, coding));
    EXPECT_LT(Compress(bytes, coding).size(), 1000u);
  }
  EXPECT_EQ(compressed.size(), kCodings.size());
  EXPECT_EQ(names, (std::set<std::string>{"br", "gzip", "zstd"}));
}

TEST(Coding, IdentityLeavesBytesAlone) {
  EXPECT_EQ(Compress("tile", Coding::kIdentity), "tile");
  EXPECT_EQ(NameOf(Coding::kIdentity), "");
}

}  // namespace
}  // namespace terrace::tiler
