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

// bake.json is empty for a moment where a file system has neither links nor exclusive renames.
TEST(Place, AnEmptyIdentityDoesNotCostTheUnits) {
  const test_support::ScratchDirectory scratch;
  Write(scratch.path() / "units" / "7-1-2.pmtiles");
  std::ofstream(scratch.path() / "bake.json").flush();
  const auto claimed = ClaimPlace(scratch.path().string(), kIdentity, 1, /*is_exported_later=*/false);
  ASSERT_FALSE(claimed);
  EXPECT_EQ(claimed.error().message.find("remove"), std::string::npos) << claimed.error().message;
}

TEST(Place, ANewFolderAndItsParentsAreCreated) {
  const test_support::ScratchDirectory scratch;
  const fs::path place = scratch.path() / "a/b/c";
  {
    const auto lock = PlaceLock::Take(place.string(), "");
    ASSERT_TRUE(lock) << lock.error().message;
    EXPECT_TRUE(fs::exists(place / "bake.lock"));
    EXPECT_FALSE(PlaceLock::Take(place.string(), ""));
  }
  EXPECT_TRUE(fs::is_empty(place));
}

}  // namespace
}  // namespace terrace::bake
