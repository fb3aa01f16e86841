#include "server/reload/reloader.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <string_view>
#include <utility>

#include "config/options/options.h"

namespace terrace::server {
namespace {

constexpr std::chrono::milliseconds kPeriod{1'000};
// Interval while datasets are being opened.
constexpr std::chrono::milliseconds kBusyPeriod{100};
// A configuration is used if it is unchanged after this time: the file may have been read half written.
constexpr std::chrono::milliseconds kConfigSettleTime{300};
// Minimum interval between checks, however often they are requested.
constexpr std::chrono::milliseconds kMinPause{50};
// Limit of datasets opened at a time: each needs a processor and some handles.
constexpr std::ptrdiff_t kMaxOpenings = 2;

// `started`: the configuration at the start.
void WarnAboutRestart(const config::Config& started, const config::Config& now, const config::Config& next) {
  const std::vector<std::string> differ = config::ChangedServerOptions(started, next);
  for (const std::string& key : config::ChangedServerOptions(now, next)) {
    if (!config::NeedsRestart(key)) continue;
    if (std::ranges::find(differ, key) == differ.end()) continue;  // back to what it was at the start
    spdlog::warn("configuration: {} has changed; the change takes effect after a restart", key);
  }
}

// Whether each dataset is public.
std::map<std::string_view, bool> PublicByName(const config::Config& config) {
  std::map<std::string_view, bool> by_name;
  for (const config::DatasetConfig& dataset : config.datasets) by_name.emplace(dataset.name, dataset.is_public);
  return by_name;
}

// Access to a dataset is determined at the start by its name: a new dataset with a name that was public then is public.
void WarnAboutAccess(const config::Config& started, const config::Config& now, const config::Config& next) {
  if (started.tokens.empty()) return;
  const auto at_start = PublicByName(started), until_now = PublicByName(now);
  for (const config::DatasetConfig& dataset : next.datasets) {
    const auto first = at_start.find(dataset.name), before = until_now.find(dataset.name);
    const bool is_seen = first != at_start.end() && first->second;
    if (dataset.is_public == is_seen) continue;
    if (before != until_now.end() && before->second == dataset.is_public) continue;  // reported already
    spdlog::warn("configuration: \"public\" of dataset {} has changed; restart the server to apply it; until then {}",
                 dataset.name, is_seen ? "everybody sees it" : "a token is needed to see it");
  }
}

// Without the files that folders and globs stand for.
config::Config AsWritten(config::Config config) {
  for (config::DatasetConfig& dataset : config.datasets) {
    for (config::SourceConfig& source : dataset.sources) source.files.clear();
  }
  return config;
}

std::string TextOf(const std::vector<config::ConfigError>& errors) {
  std::string text;
  for (const config::ConfigError& error : errors) text += (text.empty() ? "" : "; ") + error.Text();
  return text;
}

}  // namespace

Reloader::Reloader(config::Config config, std::vector<DatasetSlot> slots, Hooks hooks)
    : hooks_(std::move(hooks)),
      config_(std::move(config)),
      started_(config_),
      slots_(std::move(slots)),
      seen_(config_) {}

Reloader::~Reloader() { Stop(); }

void Reloader::Start(bool watch) {
  watch_ = watch;
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

void Reloader::Stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void Reloader::CheckNow() {
  const std::lock_guard lock(mutex_);
  check_now_ = true;
  wake_.notify_all();
}

void Reloader::Reload() {
  const std::lock_guard lock(mutex_);
  reload_ = true;
  wake_.notify_all();
}

void Reloader::Run(const std::stop_token& stop) {
  next_check_ = next_config_ = Clock::now() + kPeriod;
  std::unique_lock lock(mutex_);
  for (;;) {
    wake_.wait_for(lock, stop, kMinPause, [] { return false; });
    const auto is_due = [this] { return check_now_ || reload_; };
    if (IsBusy() || watch_ || LacksDatasets()) {
      wake_.wait_for(lock, stop, IsBusy() ? kBusyPeriod : kPeriod, is_due);
    } else {
      wake_.wait(lock, stop, is_due);
    }
    if (stop.stop_requested() || hooks_.stop.stop_requested()) return;
    const bool reload = std::exchange(reload_, false), check_now = std::exchange(check_now_, false) || reload;
    lock.unlock();
    try {
      Step(reload, check_now);
      lock.lock();
    } catch (const std::exception& exception) {
      spdlog::error("configuration and files cannot be checked now: {}; the server tries again", exception.what());
      lock.lock();
      // Which changes this step saw and did not take over is not known: the next one loads the configuration anew.
      reload_ = reload_ || reload || watch_;
      wake_.wait_for(lock, stop, kPeriod, [] { return false; });
    }
  }
}

void Reloader::Step(bool reload, bool check_now) {
  const Clock::time_point now = Clock::now();
  if (reload || (watch_ && now >= next_config_)) {
    CheckConfigFile(reload);
    next_config_ = now + (config_settles_ ? kConfigSettleTime : kPeriod);
  }
  if (check_now || (watch_ && now >= next_check_)) {
    CheckFiles();
    next_check_ = now + kPeriod;
  }
  StepOpenings();
  if (!is_published_) Publish();
  ReportProblems();
  if (reload && hooks_.reloaded) hooks_.reloaded();
}

bool Reloader::IsBusy() const {
  return config_settles_ || !is_published_ || !leaving_.empty() ||
         std::any_of(slots_.begin(), slots_.end(),
                     [](const DatasetSlot& slot) { return slot.is_opening() || !slot.is_current(); });
}

// Such datasets are tried again, also if nothing is watched.
bool Reloader::LacksDatasets() const {
  return std::any_of(slots_.begin(), slots_.end(), [](const DatasetSlot& slot) { return slot.lacks_wanted(); });
}

// An exception says nothing about the configuration. Nothing has changed yet, so the next check tries again.
config::ConfigResult Reloader::Load() const {
  try {
    return hooks_.load();
  } catch (const std::exception& exception) {
    return tl::unexpected(std::vector<config::ConfigError>{{"", exception.what()}});
  }
}

void Reloader::CheckConfigFile(bool is_requested) {
  const bool may_differ = is_requested || config_settles_ || !hooks_.may_have_changed || hooks_.may_have_changed();
  if (!may_differ) return;
  config::ConfigResult next = Load();
  config_settles_ = !is_requested && next != seen_;
  seen_ = next;
  if (config_settles_) return;
  if (!next) {
    std::string problem = TextOf(next.error());
    if (!is_requested && problem == config_problem_) return;
    spdlog::error("{}{}the new configuration is wrong, the old one stays: {}", hooks_.file,
                  hooks_.file.empty() ? "" : ": ", problem);
    config_problem_ = std::move(problem);
    return;
  }
  config_problem_.clear();
  if (*next != config_) {
    Apply(*std::move(next));
  } else if (is_requested) {
    spdlog::info("the configuration is as it was");
  }
}

// Datasets with an unchanged configuration are kept. The others serve their old data until the new is open.
void Reloader::Apply(config::Config next) {
  WarnAboutRestart(started_, config_, next);
  const bool is_rewritten = AsWritten(config_) != AsWritten(next);
  WarnAboutAccess(started_, config_, next);
  std::map<std::string, DatasetSlot> left;
  for (DatasetSlot& slot : slots_) left.emplace(slot.wanted().name, std::move(slot));
  std::vector<DatasetSlot> slots;
  for (const config::DatasetConfig& wanted : next.datasets) {
    const auto known = left.find(wanted.name);
    if (known == left.end()) {
      slots.emplace_back(wanted);
      continue;
    }
    if (known->second.wanted() != wanted) known->second.Want(wanted);
    slots.push_back(std::move(known->second));
    left.erase(known);
  }
  for (auto& [name, slot] : left) {
    spdlog::info("dataset {}: is not served any more", slot.wanted().name);
    slot.StopOpening();
    if (slot.is_opening()) leaving_.push_back(std::move(slot));
  }
  slots_ = std::move(slots);
  next_slot_ = 0;
  config_ = std::move(next);
  spdlog::info(is_rewritten ? "the new configuration is in force"
                            : "folders or globs of the configuration hold other files than before");
  is_published_ = false;
}

void Reloader::CheckFiles() {
  std::size_t left = kMaxFileChecks;
  for (std::size_t i = 0; i < slots_.size() && left > 0; ++i) {
    next_slot_ %= slots_.size();
    left -= slots_[next_slot_++].CheckFiles(left);
  }
}

void Reloader::StepOpenings() {
  std::erase_if(leaving_, [](DatasetSlot& slot) { return slot.TakeOpened() || !slot.is_opening(); });
  for (DatasetSlot& slot : slots_) {
    if (slot.TakeOpened()) is_published_ = false;
  }
  auto openings = std::count_if(slots_.begin(), slots_.end(), [](const auto& slot) { return slot.is_opening(); });
  for (DatasetSlot& slot : slots_) {
    if (openings >= kMaxOpenings) break;
    if (slot.is_opening()) continue;
    slot.OpenIfDue(hooks_.open);
    if (slot.is_opening()) ++openings;
  }
}

void Reloader::Publish() {
  std::vector<tiler::Dataset> datasets;
  for (const DatasetSlot& slot : slots_) {
    if (slot.serving()) datasets.push_back(*slot.serving());
  }
  hooks_.publish(datasets, config_);
  is_published_ = true;
}

void Reloader::ReportProblems() {
  std::map<std::string, std::string> problems;
  if (!config_problem_.empty()) problems.emplace("", config_problem_);
  for (const DatasetSlot& slot : slots_) {
    if (std::string problem = slot.Problem(Clock::now()); !problem.empty())
      problems.emplace(slot.wanted().name, std::move(problem));
  }
  if (problems == reported_) return;
  hooks_.report(problems);
  reported_ = std::move(problems);
}

}  // namespace terrace::server
