#include "bake/place.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/scratch_directory.h"

namespace terrace::bake {
namespace {

namespace fs = std::filesystem;

const BakeIdentity kIdentity{{{"dataset", "alps"}}};

void Write(const fs::path& file) {
  fs::create_directories(file.parent_path());
  std::ofstream(file) << "x";
}

TEST(Place, AFolderNamedExportIsTheBakesOnlyIfTheBakeIsExportedLater) {
  const test_support::ScratchDirectory scratch;
  const fs::path file = scratch.path() / kExportFolder / "thesis.txt";
  Write(file);
  const std::string place = scratch.path().string();
  const auto claimed = ClaimPlace(place, kIdentity, 1, /*is_exported_later=*/false);
  ASSERT_FALSE(claimed);
  EXPECT_EQ(claimed.error().code, ErrorCode::kInvalidArgument);
  EXPECT_TRUE(ClaimPlace(place, kIdentity, 1, /*is_exported_later=*/true));
  TidyPlace(place, {});
  EXPECT_TRUE(fs::exists(file));
}

TEST(Place, WhatAnNfsClientKeepsOfRemovedFilesIsNothing) {
  const test_support::ScratchDirectory scratch;
  Write(scratch.path() / ".nfs000000000000a1b200000001");
  EXPECT_TRUE(ClaimPlace(scratch.path().string(), kIdentity, 1, /*is_exported_later=*/false));
}

}  // namespace
}  // namespace terrace::bake
