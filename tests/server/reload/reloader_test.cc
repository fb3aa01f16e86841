// The reloader with a configuration and an opener that tests replace. Sources are copies of a sample.
#include "server/reload/reloader.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <stdexcept>
#include <stop_token>
#include <thread>
#include <utility>

#include "engine/gdal/stamped_files.h"
#include "server/tiles/catalog.h"
#include "tests/support/source_dir.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

bool Eventually(const std::function<bool()>& done) {
  for (int i = 0; i < 2000; ++i) {
    if (done()) return true;
    std::this_thread::sleep_for(5ms);
  }
  return false;
}

class ReloaderTest : public testing::Test {
 protected:
  ReloaderTest() {
    folder_ = fs::path(testing::TempDir()) / ("reloader_" + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    config_.datasets = {MakeConfig("a")};
  }
  ~ReloaderTest() override {
    reloader_.reset();
    fs::remove_all(folder_);
  }

  config::DatasetConfig MakeConfig(const std::string& name) {
    config::DatasetConfig dataset;
    dataset.name = name;
    dataset.sources = {(folder_ / (name + ".tif")).string()};
    Put(name);
    return dataset;
  }

  // Puts a new file with an old time under the source's name.
  void Put(const std::string& name) {
    const fs::path beside = folder_ / "new";
    fs::copy_file(test_support::SourceDir() / "config/samples/jacksboro.tif", beside);
    fs::last_write_time(beside, fs::file_time_type::clock::now() - 1h);
    fs::rename(beside, folder_ / (name + ".tif"));
  }

  Result<tiler::Dataset> Open(const config::DatasetConfig& wanted, const std::stop_token& stop) {
    ++openings_;
    if (blocks_) {
      while (blocks_ && !stop.stop_requested()) std::this_thread::sleep_for(1ms);
      return MakeError(ErrorCode::kCancelled, "stopped");
    }
    if (fails_) return MakeError(ErrorCode::kInvalidArgument, "no raster");
    auto source = dem::ElevationModel::Open(wanted.sources.front().files.front(), {});
    if (!source) return tl::unexpected(source.error());
    tiler::Dataset dataset;
    dataset.name = wanted.name;
    dataset.model = *std::move(source);
    dataset.generation =
        dataset.model->files().fingerprint();  // depends on the files and their opening, not on their content
    return dataset;
  }

  void Start(bool watch = true) {
    std::vector<DatasetSlot> slots;
    for (const config::DatasetConfig& wanted : config_.datasets) {
      tiler::Dataset dataset = *Open(wanted, {});
      served_.emplace_back(dataset.name, dataset.generation);
      slots.emplace_back(wanted, std::move(dataset));
    }
    openings_ = 0;
    next_ = config_;
    reloader_ = std::make_unique<Reloader>(config_, std::move(slots), MakeHooks());
    reloader_->Start(watch);
  }

  Reloader::Hooks MakeHooks() {
    Reloader::Hooks hooks;
    hooks.stop = stop_;
    hooks.may_have_changed = [this] {
      ++looks_;
      if (look_throws_.exchange(false)) throw std::bad_alloc();
      return changes_.load();
    };
    hooks.load = [this] {
      ++loads_;
      if (throws_) throw std::runtime_error("no memory");
      const std::lock_guard lock(mutex_);
      return next_;
    };
    hooks.open = [this](const config::DatasetConfig& wanted, const std::stop_token& stop) {
      return Open(wanted, stop);
    };
    hooks.publish = [this](const std::vector<tiler::Dataset>& served, const config::Config&) {
      if (publish_throws_.exchange(false)) throw std::bad_alloc();
      const std::lock_guard lock(mutex_);
      served_.clear();
      for (const tiler::Dataset& dataset : served) served_.emplace_back(dataset.name, dataset.generation);
    };
    hooks.report = [this](const std::map<std::string, std::string>& problems) {
      if (report_throws_.exchange(false)) throw std::bad_alloc();
      const std::lock_guard lock(mutex_);
      problems_ = problems;
    };
    return hooks;
  }

  void Load(config::ConfigResult next) {
    {
      const std::lock_guard lock(mutex_);
      next_ = std::move(next);
    }
    reloader_->Reload();
  }
  std::vector<std::pair<std::string, std::uint64_t>> Served() {
    const std::lock_guard lock(mutex_);
    return served_;
  }
  std::map<std::string, std::string> Problems() {
    const std::lock_guard lock(mutex_);
    return problems_;
  }

  fs::path folder_;
  config::Config config_;
  std::stop_token stop_;
  std::atomic<int> openings_{0}, looks_{0}, loads_{0};
  std::atomic<bool> changes_{true};
  std::atomic<bool> blocks_{false}, fails_{false}, throws_{false};
  std::atomic<bool> look_throws_{false}, publish_throws_{false}, report_throws_{false};  // once
  std::mutex mutex_;
  config::ConfigResult next_;                                  // mutex_ guards this and the following
  std::vector<std::pair<std::string, std::uint64_t>> served_;  // name and generation
  std::map<std::string, std::string> problems_;
  std::unique_ptr<Reloader> reloader_;
};

TEST_F(ReloaderTest, OpensWhatChangedAndNothingElse) {
  config_.datasets.push_back(MakeConfig("b"));
  Start();
  const auto before = Served();
  Put("b");
  reloader_->CheckNow();
  ASSERT_TRUE(Eventually([&] { return Served() != before; }));
  EXPECT_EQ(Served()[0], before[0]);
  EXPECT_NE(Served()[1].second, before[1].second);
  EXPECT_EQ(openings_, 1);
}

TEST_F(ReloaderTest, SurvivesAnExceptionOfLoading) {
  Start();
  throws_ = true;
  ASSERT_TRUE(Eventually([&] { return Problems()[""] == "no memory"; }));
  reloader_->Reload();
  throws_ = false;
  ASSERT_TRUE(Eventually([&] { return Problems().empty(); }));
  EXPECT_EQ(Served().size(), 1u);
  EXPECT_EQ(openings_, 0);
}

TEST_F(ReloaderTest, SurvivesExceptionsOfItsHooks) {
  Start();
  const auto before = Served();
  for (std::atomic<bool>* fault : {&look_throws_, &publish_throws_, &report_throws_}) {
    *fault = true;
    fails_ = fault == &report_throws_;
    const auto served = Served();
    Put("a");
    ASSERT_TRUE(Eventually([&] { return !*fault; })) << "the hook was called";
    ASSERT_TRUE(Eventually([&] { return fails_ ? Problems().contains("a") : Served() != served; }));
  }
  EXPECT_NE(Served(), before);
}

// It was replaced between its opening and the first check, or was not there when the dataset was opened.
TEST_F(ReloaderTest, SeesAnArchiveThatChangedWhileItWasOpened) {
  for (const bool is_there : {true, false}) {
    tiler::Dataset dataset = *Open(config_.datasets[0], {});
    const std::string file = (folder_ / "a.tif").string();
    dataset.baked_files = {{file, is_there ? dem::StampOf(file) : std::nullopt}};
    if (is_there) Put("a");
    dataset.model = nullptr;
    DatasetSlot slot(config_.datasets[0], dataset);
    EXPECT_EQ(slot.CheckFiles(10), 1u);
    EXPECT_FALSE(slot.is_current());
  }
}

TEST_F(ReloaderTest, AnArchiveThatStaysAbsentIsNoChange) {
  tiler::Dataset dataset = *Open(config_.datasets[0], {});
  dataset.baked_files = {{(folder_ / "b.pmtiles").string(), std::nullopt}};
  DatasetSlot slot(config_.datasets[0], dataset);
  slot.CheckFiles(10);
  EXPECT_TRUE(slot.is_current());
}

// Of an edit, say, whose raster no option names.
TEST_F(ReloaderTest, WaitsUntilTheOtherFilesOfADatasetAreComplete) {
  tiler::Dataset dataset = *Open(config_.datasets[0], {});
  const fs::path file = folder_ / "raster_of_an_edit.tif";
  std::ofstream(file) << "1";
  dataset.baked_files = {{file.string(), dem::StampOf(file.string())}};
  DatasetSlot slot(config_.datasets[0], dataset);
  const auto open = [this](const config::DatasetConfig& wanted, const std::stop_token& stop) {
    return Open(wanted, stop);
  };
  std::ofstream(file) << "two";
  EXPECT_EQ(slot.CheckFiles(10), 1u);
  const auto begun = std::chrono::steady_clock::now();
  std::ofstream(file, std::ios::app) << "3";  // it is being written to
  slot.OpenIfDue(open);
  if (std::chrono::steady_clock::now() - begun < 900ms) {
    EXPECT_FALSE(slot.is_opening());
  }
  fs::last_write_time(file, fs::file_time_type::clock::now() - std::chrono::hours(1));
  slot.OpenIfDue(open);
  EXPECT_TRUE(slot.is_opening());
}

TEST_F(ReloaderTest, KeepsUnchangedDatasetsWhateverTheirPlace) {
  config_.datasets.push_back(MakeConfig("b"));
  Start();
  const auto before = Served();
  config::Config next = config_;
  std::swap(next.datasets[0], next.datasets[1]);
  Load(next);
  ASSERT_TRUE(Eventually([&] { return Served() != before; }));
  EXPECT_EQ(Served()[0], before[1]);
  EXPECT_EQ(Served()[1], before[0]);
  EXPECT_EQ(openings_, 0);
}

TEST_F(ReloaderTest, ReportsProblemsAndMendsThem) {
  Start();
  const auto before = Served();
  fails_ = true;
  Put("a");
  reloader_->CheckNow();
  ASSERT_TRUE(Eventually([&] { return Problems().contains("a"); }));
  EXPECT_EQ(Served(), before) << "what there is stays";
  fails_ = false;
  Put("a");
  ASSERT_TRUE(Eventually([&] { return Problems().empty(); }));
  EXPECT_NE(Served(), before);
}

TEST_F(ReloaderTest, ALongReopeningIsNoFailure) {
  DatasetSlot slot(config_.datasets[0], *Open(config_.datasets[0], {}));
  slot.Want(config_.datasets[0]);
  const auto now = DatasetSlot::Clock::now();
  EXPECT_EQ(slot.Problem(now), "");
  EXPECT_EQ(slot.Problem(now + 1min), kReopening);
  fails_ = true;
  slot.OpenIfDue(
      [this](const config::DatasetConfig& wanted, const std::stop_token& stop) { return Open(wanted, stop); });
  EXPECT_TRUE(Eventually([&] {
    slot.TakeOpened();
    return !slot.is_opening();
  }));
  EXPECT_EQ(slot.Problem(now + 1min), "no raster");
}

TEST_F(ReloaderTest, AWrongConfigurationIsAProblemAndNothingElse) {
  Start();
  const auto before = Served();
  Load(tl::unexpected(std::vector<config::ConfigError>{{"/listen", "is wrong"}, {"/viewer", "too"}}));
  ASSERT_TRUE(Eventually([&] { return Problems().contains(""); }));
  EXPECT_EQ(Problems()[""], "/listen: is wrong; /viewer: too");
  EXPECT_EQ(Served(), before);
  Load(config_);
  EXPECT_TRUE(Eventually([&] { return Problems().empty(); }));
}

TEST_F(ReloaderTest, WatchesTheConfigurationWithoutBeingAsked) {
  Start();
  config::Config next = config_;
  next.datasets.push_back(MakeConfig("b"));
  {
    const std::lock_guard lock(mutex_);
    next_ = next;
  }
  EXPECT_TRUE(Eventually([&] { return Served().size() == 2; }));
}

TEST_F(ReloaderTest, LoadsNoConfigurationThatStaysAsItIs) {
  changes_ = false;
  Start();
  ASSERT_TRUE(Eventually([&] { return looks_ >= 3; }));
  EXPECT_EQ(loads_, 0);
  reloader_->Reload();  // an explicit reload does not wait
  ASSERT_TRUE(Eventually([&] { return loads_ == 1; }));
}

TEST_F(ReloaderTest, ADatasetThatGoesWhileItIsOpenedIsForgotten) {
  Start();
  blocks_ = true;
  config::Config next = config_;
  next.datasets.push_back(MakeConfig("b"));
  Load(next);
  ASSERT_TRUE(Eventually([&] { return openings_ == 1; }));
  blocks_ = false;
  next.datasets.back().name = "c";
  Load(next);
  ASSERT_TRUE(Eventually([&] { return Served().size() == 2; }));
  EXPECT_EQ(Served()[1].first, "c");
}

// As at a start: "a" is open, another thread opens "b", and nobody has begun with "c".
TEST_F(ReloaderTest, ServesWhatAStartHasNotOpened) {
  config_.datasets = {MakeConfig("a"), MakeConfig("b"), MakeConfig("c")};
  next_ = config_;
  std::promise<Result<tiler::Dataset>> of_b;
  std::stop_source stop_b;
  std::vector<DatasetSlot> slots;
  slots.emplace_back(config_.datasets[0], *Open(config_.datasets[0], {}));
  slots.emplace_back(config_.datasets[1], of_b.get_future(), stop_b);
  slots.emplace_back(config_.datasets[2]);
  openings_ = 0;
  reloader_ = std::make_unique<Reloader>(config_, std::move(slots), MakeHooks());
  reloader_->Start(/*watch=*/false);
  const auto names = [this] {
    std::string all;
    for (const auto& [name, generation] : Served()) all += name;
    return all;
  };
  ASSERT_TRUE(Eventually([&] { return names() == "ac"; }));
  of_b.set_value(MakeError(ErrorCode::kUnavailable, "no block"));
  ASSERT_TRUE(Eventually([&] { return Problems()["b"] == "no block"; }));
  EXPECT_EQ(openings_, 1);
  Put("b");
  reloader_->CheckNow();
  ASSERT_TRUE(Eventually([&] { return names() == "abc" && Problems().empty(); }));
}

TEST_F(ReloaderTest, ADatasetThatWasNeverServedIsTriedAgainWithoutWatching) {
  fails_ = true;
  std::vector<DatasetSlot> slots;
  slots.emplace_back(config_.datasets[0]);
  next_ = config_;
  reloader_ = std::make_unique<Reloader>(config_, std::move(slots), MakeHooks());
  reloader_->Start(/*watch=*/false);
  ASSERT_TRUE(Eventually([&] { return Problems()["a"] == "no raster"; }));
  blocks_ = true;
  ASSERT_TRUE(Eventually([&] { return openings_ == 2; }));
  EXPECT_TRUE(Eventually([&] { return Problems().empty(); })) << "it is being prepared again";
  blocks_ = fails_ = false;
  EXPECT_TRUE(Eventually([&] { return Served().size() == 1; }));
}

TEST_F(ReloaderTest, AReplacementThatFailedIsTriedAgainWithoutWatching) {
  Start(/*watch=*/false);
  const auto before = Served();
  fails_ = true;
  Put("a");
  reloader_->CheckNow();
  ASSERT_TRUE(Eventually([&] { return Problems().contains("a"); }));
  fails_ = false;
  Put("a");
  EXPECT_TRUE(Eventually([&] { return Served() != before && Problems().empty(); }));
}

TEST_F(ReloaderTest, OpensNothingAfterAStop) {
  std::stop_source stop;
  stop_ = stop.get_token();
  Start();
  stop.request_stop();
  Put("a");
  reloader_->CheckNow();
  std::this_thread::sleep_for(500ms);
  EXPECT_EQ(openings_, 0);
}

TEST_F(ReloaderTest, StoppingStopsTheOpeningOfAStart) {
  std::stop_source stop;
  std::vector<DatasetSlot> slots;
  blocks_ = true;
  slots.emplace_back(
      config_.datasets[0],
      std::async(std::launch::async, [this, token = stop.get_token()] { return Open(config_.datasets[0], token); }),
      stop);
  next_ = config_;
  reloader_ = std::make_unique<Reloader>(config_, std::move(slots), MakeHooks());
  reloader_->Start(/*watch=*/true);
  reloader_.reset();  // otherwise this would never return
  EXPECT_TRUE(stop.stop_requested());
}

TEST_F(ReloaderTest, StoppingStopsAnOpening) {
  Start();
  blocks_ = true;
  Put("a");
  reloader_->CheckNow();
  ASSERT_TRUE(Eventually([&] { return openings_ == 1; }));
  reloader_.reset();  // otherwise this would never return
}

TEST_F(ReloaderTest, WaitsForAFileThatIsBeingWritten) {
  Start();
  const auto before = Served();
  Put("a");
  auto last = std::chrono::steady_clock::now();
  bool is_busy = false;  // a busy machine, on which the file looks complete
  for (int i = 0; i < 30 && !is_busy; ++i) {
    fs::last_write_time(folder_ / "a.tif", fs::file_time_type::clock::now());
    reloader_->CheckNow();
    std::this_thread::sleep_for(50ms);
    const auto now = std::chrono::steady_clock::now();
    is_busy = now - std::exchange(last, now) > 500ms;
  }
  if (!is_busy) {
    EXPECT_EQ(openings_, 0);
  }
  EXPECT_TRUE(Eventually([&] { return Served() != before; }));
}

}  // namespace
}  // namespace terrace::server
