#include "bake/place.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

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

// Its content, with the number of a process that has ended.
std::string StaleLock(const std::string& place) {
  std::string host, pid, rest;
  {
    const auto lock = PlaceLock::Take(place, "");
    std::ifstream text(place + "/bake.lock");
    text >> host >> pid;
    std::getline(text, rest);
  }
  const pid_t ended = ::fork();
  if (ended == 0) ::_exit(0);
  ::waitpid(ended, nullptr, 0);
  return host + " " + std::to_string(ended) + rest + "\n";
}

TEST(Place, OneOfManyTakesOverALock) {
  const test_support::ScratchDirectory scratch;
  const std::string place = scratch.path().string(), stale = StaleLock(place);
  // Without what /proc states of processes, the lock stays with its owner.
  const bool is_known = stale.find("unknown") == std::string::npos;
  constexpr int kRounds = 20, kProcesses = 8;
  for (int round = 0; round < kRounds; ++round) {
    std::ofstream(place + "/bake.lock") << stale;
    std::array<int, 2> taken{}, end{};
    ASSERT_EQ(::pipe(taken.data()) + ::pipe(end.data()), 0);
    std::vector<pid_t> processes;
    for (int i = 0; i < kProcesses; ++i) {
      processes.push_back(::fork());
      if (processes.back() != 0) continue;
      ::close(end[1]);
      const auto lock = PlaceLock::Take(place, "");
      char byte = lock ? 'y' : 'n';
      // All of them hold what they have until the pipe ends.
      ::_exit(::write(taken[1], &byte, 1) == 1 && ::read(end[0], &byte, 1) == 0 ? 0 : 1);
    }
    int count = 0;
    for (int i = 0; i < kProcesses; ++i) {
      char byte = 0;
      ASSERT_EQ(::read(taken[0], &byte, 1), 1);
      count += byte == 'y' ? 1 : 0;
    }
    for (const int descriptor : {end[0], end[1], taken[0], taken[1]}) ::close(descriptor);
    for (const pid_t process : processes) ::waitpid(process, nullptr, 0);
    EXPECT_LE(count, 1);
    EXPECT_TRUE(count == 1 || !is_known);
    fs::remove(place + "/bake.lock");
  }
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
