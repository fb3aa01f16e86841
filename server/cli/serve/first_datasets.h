// The datasets of a start. All sources are checked first. Statistics that the cache lacks are computed after that, and
// the server need not wait for them.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "config/config.h"
#include "engine/common/dem_types.h"
#include "server/reload/dataset_slot.h"
#include "tiler/tile_pipeline.h"

namespace terrace::cli {

// How far the preparation of each dataset is. Thread-safe.
class PreparationProgress {
 public:
  // The share done of a dataset, 0 .. 1; never decreases during a preparation. 0 if nothing is known.
  double Of(const std::string& dataset) const;
  void Begin(const std::string& dataset);
  void Raise(const std::string& dataset, double share);

  // Call when the server answers requests. From then on preparations run at low priority, and print lines instead of a
  // line that is rewritten, because the log prints too.
  void GoToBackground();
  bool is_in_background() const;

 private:
  mutable std::mutex mutex_;
  std::map<std::string, double> shares_;  // guarded by mutex_, as is the next
  bool is_in_background_ = false;
};

struct FirstDatasets {
  std::vector<server::DatasetSlot> slots;  // one for each configured dataset, in order
  std::vector<tiler::Dataset> open;        // those that are open, in order
  std::vector<std::string> pending;        // names of the others
};

// "terrace: dataset alps: ..." on stderr.
void PrintFault(const std::string& dataset, const std::string& message);

// Opens every dataset whose statistics are in `cache`, and checks the sources of the others. Then prepares these,
// beginning with the smallest files, and returns when all are open or after two seconds. What has begun by then
// continues in its slot, on its own thread. Returns nothing if a dataset cannot be opened, after the errors of all were
// printed, or after a stop.
std::optional<FirstDatasets> OpenFirstDatasets(const config::Config& config, const dem::RasterCache& cache,
                                               const std::stop_token& stop,
                                               const std::shared_ptr<PreparationProgress>& shares);

}  // namespace terrace::cli
