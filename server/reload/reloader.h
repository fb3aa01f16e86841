// Reopens datasets when the configuration or their files change.
// Every second, a thread checks the configuration, including its globs and folders, and up to kMaxFileChecks files of
// datasets. It reopens changed datasets at low priority while the old ones are served, and publishes them when they are
// complete. An invalid configuration changes nothing. All changes are logged.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "config/config.h"
#include "config/file/parse.h"
#include "server/reload/dataset_slot.h"

namespace terrace::server {

class Reloader {
 public:
  using Clock = std::chrono::steady_clock;

  // Files checked per second. If there are more, each is checked every few seconds.
  static constexpr std::size_t kMaxFileChecks = 10'000;

  struct Hooks {
    // Loads the configuration as at a start of the server.
    std::function<config::ConfigResult()> load;
    std::string file = {};  // that it is loaded from, for the log; empty: none
    // Returns false if `load` would return the same as last time. Empty: always true.
    std::function<bool()> may_have_changed = {};
    DatasetOpener open;
    // Serves these datasets with these options from now on. Called on the reloader's thread.
    std::function<void(const std::vector<tiler::Dataset>&, const config::Config&)> publish;
    // Called on the reloader's thread after a Reload was processed; changed datasets may not be open yet. May be empty.
    std::function<void()> reloaded = {};
    // Receives the problems by dataset; "" is the configuration. Called on the reloader's thread when they change.
    std::function<void(const std::map<std::string, std::string>&)> report;
    std::stop_token stop = {};  // requested: opens and publishes nothing any more
  };

  // `slots`: one for each of `config.datasets`, in the same order. Opens those that serve nothing.
  Reloader(config::Config config, std::vector<DatasetSlot> slots, Hooks hooks);
  ~Reloader();  // Stop

  // Starts the thread. `watch` false: checks only on request.
  void Start(bool watch);
  // Waits for the thread. May be called twice.
  void Stop();

  // Checks the files of datasets at once instead of at the next second, but not the configuration. Thread-safe.
  void CheckNow();
  // Like CheckNow, and also loads the configuration even if its file may still be changing.
  void Reload();

 private:
  void Run(const std::stop_token& stop);
  void Step(bool reload, bool check_now);
  void CheckFiles();
  config::ConfigResult Load() const;
  void CheckConfigFile(bool is_requested);
  void Apply(config::Config next);
  void StepOpenings();
  void Publish();
  void ReportProblems();
  bool IsBusy() const;
  bool LacksDatasets() const;

  const Hooks hooks_;
  bool watch_ = false;
  config::Config config_;
  const config::Config started_;  // the configuration at the start; options that need a restart still have these values
  std::vector<DatasetSlot> slots_;    // one per dataset, in the configuration's order
  std::vector<DatasetSlot> leaving_;  // no longer wanted, but still opening
  std::size_t next_slot_ = 0;         // whose files are checked next
  std::string config_problem_;
  config::ConfigResult seen_;    // at the last check, valid or not
  bool config_settles_ = false;  // it changed at the last check; it is applied once two checks in a row agree
  bool is_published_ = true;     // what the slots serve, with config_
  std::map<std::string, std::string> reported_;
  Clock::time_point next_check_, next_config_;

  std::mutex mutex_;
  std::condition_variable_any wake_;
  bool check_now_ = false, reload_ = false;  // guarded by mutex_
  std::jthread thread_;
};

}  // namespace terrace::server
