#include "server/telemetry/metrics.h"

#include <fmt/format.h>
#include <prometheus/counter.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <shared_mutex>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/gdal/gdal_runtime.h"

namespace terrace::server {
namespace {

using Buckets = prometheus::Histogram::BucketBoundaries;

// Seconds. A cached tile takes well under a millisecond, a large build about one second.
const Buckets& Seconds() {
  static const Buckets buckets = {0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30};
  return buckets;
}

constexpr auto kCounter = prometheus::MetricType::Counter, kGauge = prometheus::MetricType::Gauge;

double InSeconds(std::chrono::microseconds time) { return std::chrono::duration<double>(time).count(); }

void AddMetric(prometheus::MetricFamily& family, std::vector<prometheus::ClientMetric::Label> labels, double value) {
  prometheus::ClientMetric& metric = family.metric.emplace_back();
  metric.label = std::move(labels);
  (family.type == kCounter ? metric.counter.value : metric.gauge.value) = value;
}

struct CacheTier {
  const char *name, *kind;
  tiler::StoreStats stats;
  bool counts_lookups = true;
};

// A family for each number, with a value for each tier and kind. Memory, the first `in_memory` tiers, has no writes.
void AddCaches(const std::vector<CacheTier>& tiers, std::size_t in_memory, std::vector<prometheus::MetricFamily>& all) {
  const auto add = [&](prometheus::MetricType type, const char* name, const char* help, auto member,
                       std::size_t first) {
    if (first == tiers.size()) return;
    prometheus::MetricFamily family{name, help, type, {}};
    for (std::size_t i = first; i < tiers.size(); ++i) {
      if (type == kCounter && !tiers[i].counts_lookups) continue;
      AddMetric(family, {{"tier", tiers[i].name}, {"kind", tiers[i].kind}},
                static_cast<double>(tiers[i].stats.*member));
    }
    all.push_back(std::move(family));
  };
  using Stats = tiler::StoreStats;
  add(kCounter, "terrace_cache_hits_total", "Found in a cache", &Stats::hits, 0);
  add(kCounter, "terrace_cache_misses_total", "Looked for in a cache and not found", &Stats::misses, 0);
  add(kGauge, "terrace_cache_entries", "Entries of a cache; of the disk cache an estimate", &Stats::entries, 0);
  add(kGauge, "terrace_cache_bytes", "Bytes that count against the limit of a cache", &Stats::bytes, 0);
  add(kCounter, "terrace_cache_errors_total", "Reads and writes of a cache that the disk or the network failed",
      &Stats::errors, in_memory);
  add(kCounter, "terrace_cache_damaged_total", "Records that did not check out and were erased", &Stats::damaged,
      in_memory);
  add(kCounter, "terrace_cache_written_total", "Values written", &Stats::written, in_memory);
  add(kCounter, "terrace_cache_dropped_total", "Values not written, as the store failed or was behind", &Stats::dropped,
      in_memory);
  add(kCounter, "terrace_cache_timeouts_total", "Look-ups that took longer than a store on a network may",
      &Stats::timeouts, in_memory);
  add(kCounter, "terrace_cache_skipped_total",
      "Look-ups that were not made: the store is off, or little would be found", &Stats::skipped, in_memory);
  add(kCounter, "terrace_cache_switched_off_total", "How often a store on a network was switched off",
      &Stats::switched_off, in_memory);
  add(kGauge, "terrace_cache_on", "1 while a cache reads and writes, 0 while it is switched off", &Stats::on,
      in_memory);
}

prometheus::MetricFamily Samples(const tiler::TilePipeline* pipeline) {
  prometheus::MetricFamily family{"terrace_source_samples_total",
                                  "Samples read for tiles: measured, narrow voids filled from their edges, and voids "
                                  "left to other sources or the floor",
                                  kCounter,
                                  {}};
  if (pipeline == nullptr) return family;
  for (const tiler::Dataset& dataset : pipeline->datasets()) {
    if (!dataset.model) continue;
    const dem::SampleCounts counts = dataset.model->CountSamples();
    for (const auto& [kind, count] : {std::pair("measured", counts.measured), std::pair("filled", counts.filled),
                                      std::pair("void", counts.voids)}) {
      AddMetric(family, {{"dataset", dataset.name}, {"kind", kind}}, static_cast<double>(count));
    }
  }
  return family;
}

prometheus::MetricFamily StoreTimes(const Metrics::ServerState& state) {
  prometheus::MetricFamily family{"terrace_store_read_seconds_total",
                                  "Time of look-ups of tiles in the tiers below memory, found or not",
                                  kCounter,
                                  {}};
  for (std::size_t i = 0; i < std::min(state.tiles.store_times.size(), state.stores.size()); ++i) {
    AddMetric(family, {{"tier", state.stores[i]->name()}}, InSeconds(state.tiles.store_times[i]));
  }
  return family;
}

prometheus::MetricFamily Versions(const std::vector<DatasetView>& datasets) {
  prometheus::MetricFamily family{
      "terrace_dataset_info", "1 for each dataset, with the version that it is served in", kGauge, {}};
  for (const DatasetView& dataset : datasets) {
    AddMetric(family, {{"dataset", dataset.name}, {"version", dataset.version()}}, 1);
  }
  return family;
}

}  // namespace

struct Metrics::Families {
  prometheus::Registry registry;
  prometheus::Family<prometheus::Counter>& requests = prometheus::BuildCounter()
                                                          .Name("terrace_http_requests_total")
                                                          .Help("Replies by route, dataset and status")
                                                          .Register(registry);
  prometheus::Family<prometheus::Histogram>& durations =
      prometheus::BuildHistogram()
          .Name("terrace_http_request_duration_seconds")
          .Help("From the end of a request's head to its last byte sent")
          .Register(registry);
  prometheus::Family<prometheus::Counter>& builds = prometheus::BuildCounter()
                                                        .Name("terrace_tile_builds_total")
                                                        .Help("Tiles built, by dataset and result")
                                                        .Register(registry);
  prometheus::Family<prometheus::Histogram>& stages =
      prometheus::BuildHistogram()
          .Name("terrace_tile_build_stage_seconds")
          .Help("Time of each step of a build, waiting for a worker included")
          .Register(registry);
  prometheus::Histogram& build_time = prometheus::BuildHistogram()
                                          .Name("terrace_tile_build_seconds")
                                          .Help("Time of a build, without waiting for a worker")
                                          .Register(registry)
                                          .Add({}, Seconds());
  struct Stage {
    std::chrono::microseconds tiler::StageTimes::*time;
    prometheus::Histogram& histogram;
  };
  const std::array<Stage, 5> each_stage = {
      {{&tiler::StageTimes::queue, stages.Add({{"stage", "queue"}}, Seconds())},
       {&tiler::StageTimes::read, stages.Add({{"stage", "read"}}, Seconds())},
       {&tiler::StageTimes::refine, stages.Add({{"stage", "refine"}}, Seconds())},
       {&tiler::StageTimes::encode, stages.Add({{"stage", "encode"}}, Seconds())},
       {&tiler::StageTimes::compress, stages.Add({{"stage", "compress"}}, Seconds())}}};
  prometheus::Family<prometheus::Counter>& refinements =
      prometheus::BuildCounter()
          .Name("terrace_refinements_total")
          .Help("Tiles built, by what was found of their refinement: replayed, continued, or made from the sources")
          .Register(registry);
  prometheus::Counter& made = refinements.Add({{"use", "made"}});
  prometheus::Counter& continued = refinements.Add({{"use", "continued"}});
  prometheus::Counter& replayed = refinements.Add({{"use", "replayed"}});
  prometheus::Counter& source_errors = prometheus::BuildCounter()
                                           .Name("terrace_source_read_errors_total")
                                           .Help("Replies that failed because a source could not be read")
                                           .Register(registry)
                                           .Add({});
  // The counters of a reply, cached by labels: looking up a family takes as long as answering from the cache. Route and
  // cache are literals, and the dataset exists.
  struct Reply {
    prometheus::Counter& count;
    prometheus::Histogram& duration;
  };
  using ReplyLabels = std::tuple<std::string_view, int, std::string_view, std::string_view>;
  struct OwnedLabels {
    std::string route, cache, dataset;
    int status;
    ReplyLabels View() const { return {route, status, cache, dataset}; }
  };
  struct ByLabels {
    using is_transparent = void;
    bool operator()(const OwnedLabels& a, const OwnedLabels& b) const { return a.View() < b.View(); }
    bool operator()(const OwnedLabels& a, const ReplyLabels& b) const { return a.View() < b; }
    bool operator()(const ReplyLabels& a, const OwnedLabels& b) const { return a < b.View(); }
  };
  // The metrics with a dataset as label.
  struct DatasetMetrics {
    std::set<prometheus::Counter*> requests;
    std::map<std::string, prometheus::Counter*, std::less<>> builds;  // by result
  };
  const Reply& AddReply(const ReplyRecord& record);
  void CountBuild(const std::string& dataset, std::string_view result);
  void Forget(const std::string& dataset, const DatasetMetrics& metrics);

  // Guards the maps. Holding it shared also keeps their targets alive. Every reply takes it, so it is held exclusively
  // only to add or remove labels, which waits for a family that is being collected.
  std::shared_mutex mutex;
  std::map<OwnedLabels, Reply, ByLabels> replies;
  std::map<std::string, DatasetMetrics, std::less<>> dataset_metrics;
};

// `mutex` is held.
const Metrics::Families::Reply& Metrics::Families::AddReply(const ReplyRecord& record) {
  OwnedLabels labels{std::string(record.route), std::string(record.cache), std::string(record.dataset), record.status};
  const std::string status = fmt::to_string(record.status);
  const Reply reply{requests.Add({{"route", labels.route}, {"dataset", labels.dataset}, {"status", status}}),
                    durations.Add({{"route", labels.route}, {"cache", labels.cache}}, Seconds())};
  DatasetMetrics& of_dataset = dataset_metrics[labels.dataset];
  of_dataset.requests.insert(&reply.count);
  return replies.emplace(std::move(labels), reply).first->second;
}

void Metrics::Families::CountBuild(const std::string& dataset, std::string_view result) {
  {
    const std::shared_lock lock(mutex);
    if (const auto known = dataset_metrics.find(dataset); known != dataset_metrics.end()) {
      const auto count = known->second.builds.find(result);
      if (count != known->second.builds.end()) return count->second->Increment();
    }
  }
  const std::unique_lock lock(mutex);
  prometheus::Counter& count = builds.Add({{"dataset", dataset}, {"result", std::string(result)}});
  count.Increment();
  dataset_metrics[dataset].builds.emplace(result, &count);
}

// `mutex` is held.
void Metrics::Families::Forget(const std::string& dataset, const DatasetMetrics& metrics) {
  std::erase_if(replies, [&](const auto& reply) { return reply.first.dataset == dataset; });
  for (prometheus::Counter* count : metrics.requests) requests.Remove(count);
  for (const auto& [result, count] : metrics.builds) builds.Remove(count);
}

Metrics::Metrics() : families_(std::make_unique<Families>()) {}
Metrics::~Metrics() = default;

void Metrics::CountReply(const ReplyRecord& record) {
  if (record.error == ToString(ErrorCode::kUnavailable)) families_->source_errors.Increment();
  const auto count = [&](const Families::Reply& reply) {
    reply.count.Increment();
    reply.duration.Observe(InSeconds(record.duration));
  };
  {
    const std::shared_lock lock(families_->mutex);
    const Families::ReplyLabels labels{record.route, record.status, record.cache, record.dataset};
    if (const auto found = families_->replies.find(labels); found != families_->replies.end()) {
      return count(found->second);
    }
  }
  const std::unique_lock lock(families_->mutex);
  count(families_->AddReply(record));
}

void Metrics::CountBuild(const DatasetView& dataset, const Result<tiler::TilePtr>& tile) {
  const std::string_view result = tile ? "ok" : ToString(tile.error().code);
  families_->CountBuild(dataset.name, result);
  if (!tile) return;
  switch ((*tile)->refinement_use) {
    case tiler::RefinementUse::kMade:
      families_->made.Increment();
      break;
    case tiler::RefinementUse::kContinued:
      families_->continued.Increment();
      break;
    case tiler::RefinementUse::kReplayed:
      families_->replayed.Increment();
      break;
    case tiler::RefinementUse::kNone:
      break;
  }
  std::chrono::microseconds in_all{0};
  for (const Families::Stage& stage : families_->each_stage) {
    stage.histogram.Observe(InSeconds((*tile)->times.*stage.time));
    if (stage.time != &tiler::StageTimes::queue) in_all += (*tile)->times.*stage.time;
  }
  families_->build_time.Observe(InSeconds(in_all));
}

void Metrics::RetainDatasets(const std::vector<DatasetView>& datasets) {
  std::set<std::string_view> served = {""};  // metrics without a dataset stay
  for (const DatasetView& dataset : datasets) served.insert(dataset.name);
  std::string from;  // names before it have been checked
  for (;;) {
    // Removes one at a time, because replies wait meanwhile, and each removal searches its family.
    const std::unique_lock lock(families_->mutex);
    auto gone = families_->dataset_metrics.lower_bound(from);
    while (gone != families_->dataset_metrics.end() && served.contains(gone->first)) ++gone;
    if (gone == families_->dataset_metrics.end()) return;
    families_->Forget(gone->first, gone->second);
    from = gone->first;
    families_->dataset_metrics.erase(gone);
  }
}

std::string Metrics::Text(const ServerState& state) const {
  std::vector<prometheus::MetricFamily> all = families_->registry.Collect();
  const auto add = [&all](prometheus::MetricType type, const char* name, const char* help, auto value) {
    AddMetric(all.emplace_back(prometheus::MetricFamily{name, help, type, {}}), {}, static_cast<double>(value));
  };
  std::vector<CacheTier> tiers = {{"memory", "tiles", {state.tiles.cache}},
                                  {"memory", "refinements", {state.refinements}}};
  if (state.catalog->pipeline) {
    tiers.push_back({"memory", "drawn_meshes", {state.catalog->pipeline->drawn_meshes()}, false});
  }
  const dem::KeptBlocks blocks = dem::ElevationModel::CountKeptBlocks();
  tiler::CacheStats of_blocks;
  of_blocks.entries = blocks.count;
  of_blocks.bytes = blocks.bytes;
  tiers.push_back({"memory", "sample_blocks", {of_blocks}, false});
  const std::size_t in_memory = tiers.size();
  for (std::size_t i = 0; i < state.stores.size(); ++i) {
    const tiler::StoreBase& store = *state.stores[i];
    tiers.push_back({store.name(), i < state.tile_stores ? "tiles" : "refinements", store.stats()});
  }
  AddCaches(tiers, in_memory, all);
  add(kCounter, "terrace_flights_joined_total", "Requests that waited for the build of another request", state.joined);
  add(kCounter, "terrace_builds_refused_total", "Tile requests refused as overloaded", state.tiles.refused);
  all.push_back(StoreTimes(state));
  add(kGauge, "terrace_flights", "Jobs under way or waiting", state.in_flight);
  add(kGauge, "terrace_queue_length", "Jobs that wait for a worker", state.queued);
  add(kGauge, "terrace_http_connections", "Open connections", state.connections);
  add(kCounter, "terrace_http_connections_refused_total", "Connections turned away", state.refused_connections);
  add(kGauge, "terrace_http_transfer_bytes", "Bytes of bodies on their way", state.transfers.held_bytes);
  add(kGauge, "terrace_http_transfers_waiting", "Bodies that wait for room", state.transfers.waiting);
  add(kCounter, "terrace_http_transfers_refused_total", "Bodies that found no room before their deadline",
      state.transfers.refused);
  add(kCounter, "terrace_http_transfers_cut_total",
      "Replies cut off and uploads displaced because others needed their room", state.transfers.cut);
  add(kGauge, "terrace_datasets", "Datasets served", state.catalog->datasets.size());
  add(kGauge, "terrace_degraded", "Problems that /readyz reports", state.problems);
  all.push_back(Versions(state.catalog->datasets));
  add(kCounter, "terrace_catalogs_total", "How often what is served was replaced", state.catalogs);
  const tiler::TilePipeline* const pipeline = state.catalog->pipeline.get();
  const dem::GdalCounts gdal = pipeline != nullptr ? dem::ReadGdalCounts() : dem::GdalCounts();
  add(kCounter, "terrace_gdal_errors_total", "Failures that GDAL reported", gdal.errors);
  add(kCounter, "terrace_gdal_warnings_total", "Warnings that GDAL reported", gdal.warnings);
  add(kGauge, "terrace_gdal_cache_bytes", "Blocks of sources in GDAL's cache", gdal.cache_bytes);
  all.push_back(Samples(pipeline));
  return prometheus::TextSerializer().Serialize(all);
}

}  // namespace terrace::server
