#include "bake/baker.h"

#include <gtest/gtest.h>

#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "archive/unit_name.h"
#include "bake/bake_request.h"
#include "tests/support/source_dir.h"

namespace terrace::bake {
namespace {

enum class Throws { kInCreate, kInAdd, kInFinish };

// Throws in the unit of one tile.
class ThrowingWriter final : public archive::UnitWriter {
 public:
  ThrowingWriter(Throws throws, const geo::TileKey& tile) : throws_(throws), tile_(tile) {}
  Result<void> Add(const geo::TileKey& key, const tiler::EncodedTile&, const dem::HeightRange&) override {
    has_tile_ = has_tile_ || key == tile_;
    if (has_tile_ && throws_ == Throws::kInAdd) throw std::runtime_error("statistics cannot be read");
    return {};
  }
  Result<archive::FileSummary> Finish() override {
    if (has_tile_ && throws_ == Throws::kInFinish) throw std::bad_alloc();
    return archive::FileSummary();
  }

 private:
  const Throws throws_;
  const geo::TileKey tile_;
  bool has_tile_ = false;
};

tiler::Dataset SampleDataset() {
  tiler::Dataset dataset;
  dataset.name = "jacksboro";
  auto source = dem::ElevationModel::Open(test_support::SourceDir() / "config/samples/jacksboro.tif");
  EXPECT_TRUE(source) << source.error().message;
  if (source) dataset.model = *std::move(source);
  return dataset;
}

// Expects that one unit fails with this message, and the others are baked.
void ExpectOneFailure(Throws throws, int levels, const std::string& message) {
  tiler::Dataset dataset = SampleDataset();
  ASSERT_TRUE(dataset.model);
  BakeRequest request;
  request.levels = {0, levels};
  const auto manifests = PlanArchives(dataset, request, "test");
  ASSERT_TRUE(manifests) << manifests.error().message;
  const geo::TileRange& deepest = manifests->front().available.back().front();
  const geo::TileKey tile{levels, deepest.start_x, deepest.start_y};
  std::vector<Target> targets = {{{}, manifests->front()}};
  targets.front().create = [&]() -> Result<std::unique_ptr<archive::UnitWriter>> {
    if (throws == Throws::kInCreate) throw ThrownError({ErrorCode::kUnavailable, "statistics cannot be read"});
    return std::make_unique<ThrowingWriter>(throws, tile);
  };
  const tiler::TilePipeline pipeline({std::move(dataset)}, 0);
  BakeOptions options;
  options.threads = 2;
  Counters counters;
  const UnitPlan plan = UnitPlan::Make(targets, {});
  const std::vector<UnitReport> reports = Bake(pipeline, targets, plan, options, counters);
  EXPECT_EQ(reports.size(), plan.units.size());
  for (const UnitReport& report : reports) {
    const bool fails = report.entry.name == archive::UnitNameOf(tile);
    EXPECT_EQ(report.outcome, fails ? UnitOutcome::kFailed : UnitOutcome::kBaked) << report.entry.name;
    EXPECT_EQ(report.message, fails ? message : "");
  }
}

TEST(Baker, WhatIsThrownIsAnErrorOfTheUnit) {
  ExpectOneFailure(Throws::kInAdd, archive::kTopLevels, "statistics cannot be read");
  ExpectOneFailure(Throws::kInFinish, archive::kTopLevels, "no memory");
  ExpectOneFailure(Throws::kInCreate, 0, "statistics cannot be read");
}

// Hands out unit 0 again after it was done, as a queue that was filled anew, after another worker had it and was lost.
class ForgetfulQueue final : public UnitQueue {
 public:
  Taken Take() override { return done_ < 2 ? Taken{Taken::State::kUnit, 0, done_} : Taken{}; }
  void Done(std::size_t) override { ++done_; }
  void Return(std::size_t) override {}
  bool Fail(std::size_t, const Error&) override { return false; }

 private:
  int done_ = 0;
};

TEST(Baker, AUnitThatIsHandedOutAfterItWasDoneIsDoneAgain) {
  tiler::Dataset dataset = SampleDataset();
  ASSERT_TRUE(dataset.model);
  BakeRequest request;
  request.levels = {0, 0};
  const auto manifests = PlanArchives(dataset, request, "test");
  ASSERT_TRUE(manifests) << manifests.error().message;
  std::vector<Target> targets = {{{}, manifests->front()}};
  int writers = 0;
  targets.front().create = [&]() -> Result<std::unique_ptr<archive::UnitWriter>> {
    ++writers;
    return std::make_unique<ThrowingWriter>(Throws::kInAdd, geo::TileKey{30, 0, 0});
  };
  const tiler::TilePipeline pipeline({std::move(dataset)}, 0);
  ForgetfulQueue queue;
  Counters counters;
  const std::vector<UnitReport> reports = Bake(pipeline, targets, UnitPlan::Make(targets, {}), queue, {}, counters);
  EXPECT_EQ(writers, 2);
  EXPECT_EQ(reports.size(), 1U);
}

}  // namespace
}  // namespace terrace::bake
