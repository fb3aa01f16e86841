// Keeps what is served in step with the configuration and with the files that it names.
//
// A thread looks at them every second: at the configuration, globs and folders in it included, and at the files of each
// dataset, kMaxLooks of them a time. What has changed is opened anew beside what is served, at low priority, and
// published when it is complete; a configuration that is wrong changes nothing. Everything is told in the log.
#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "config/config.h"
#include "config/parse.h"
#include "server/reload/dataset_slot.h"

namespace terrace::server {

class Reloader {
 public:
  // Files looked at in one second. Of more, each is looked at every few seconds.
  static constexpr std::size_t kMaxLooks = 10'000;

  struct Hooks {
    // The configuration as it would be if the server started now.
    std::function<config::ConfigResult()> load;
    // False: `load` would give what it gave last. May be empty: it may always give another.
    std::function<bool()> may_have_changed = {};
    DatasetOpener open;
    // Serve these from now on, under these options. On the reloader's thread.
    std::function<void(const std::vector<tiler::Dataset>&, const config::Config&)> publish;
    // A Reload was looked after; what has to be opened is not open yet. On the reloader's thread; may be empty.
    std::function<void()> reloaded = {};
    // What is wrong, by dataset; "" is the configuration. Called when it changes, on the reloader's thread.
    std::function<void(const std::map<std::string, std::string>&)> tell;
  };

  // `datasets` are what is served, opened from `config.datasets` in the same order.
  Reloader(config::Config config, std::vector<tiler::Dataset> datasets, Hooks hooks);
  ~Reloader();  // Stop

  // Begins to look; `watch` false: only when it is asked to.
  void Start(bool watch);
  // Waits for the thread. May be called twice.
  void Stop();

  // At once instead of at the next second. From any thread.
  void Look();
  // Look, and load the configuration even where it is not known to have settled.
  void Reload();

 private:
  void Run();
  void LookAtFiles();
  config::ConfigResult Load() const;
  void LookAtConfig(bool asked);
  void Apply(config::Config next);
  bool StepOpenings();
  void Publish();
  void TellTroubles();
  bool IsBusy() const;

  const Hooks hooks_;
  bool watch_ = false;
  config::Config config_;
  const config::Config started_;      // what takes a restart is still as it says
  std::vector<DatasetSlot> slots_;    // one a dataset, in the configuration's order
  std::vector<DatasetSlot> leaving_;  // not wanted any more, but still opening
  std::size_t next_slot_ = 0;         // whose files to look at
  std::string config_problem_;
  config::ConfigResult seen_;    // at the last look, good or bad
  bool config_settles_ = false;  // it was another one at the look before
  std::map<std::string, std::string> told_;

  std::mutex mutex_;
  std::condition_variable wake_;
  bool look_ = false, reload_ = false, stop_ = false;  // guarded by mutex_
  std::thread thread_;
};

}  // namespace terrace::server
