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

// Expects that one unit fails with this message, and the others are baked.
void ExpectOneFailure(Throws throws, int levels, const std::string& message) {
  tiler::Dataset dataset;
  dataset.name = "jacksboro";
  auto source = dem::ElevationModel::Open(test_support::SourceDir() / "config/samples/jacksboro.tif");
  ASSERT_TRUE(source) << source.error().message;
  dataset.model = *std::move(source);
  BakeRequest request;
  request.levels = {0, levels};
  const auto manifests = PlanArchives(dataset, request, "test");
  ASSERT_TRUE(manifests) << manifests.error().message;
  const geo::TileRange& deepest = manifests->front().available.back().front();
  const geo::TileKey tile{levels, deepest.start_x, deepest.start_y};
  std::vector<Target> targets = {{{}, manifests->front()}};
  targets.front().create = [&]() -> Result<std::unique_ptr<archive::UnitWriter>> {
    if (throws == Throws::kInCreate) throw std::runtime_error("statistics cannot be read");
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

}  // namespace
}  // namespace terrace::bake
