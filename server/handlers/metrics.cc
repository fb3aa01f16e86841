#include "server/handlers/metrics.h"

#include <fmt/format.h>
#include <prometheus/counter.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include <chrono>
#include <map>
#include <mutex>
#include <shared_mutex>
#include <string>
#include <utility>
#include <vector>

namespace terrace::server {
namespace {

using Buckets = prometheus::Histogram::BucketBoundaries;

// Seconds. A cached tile takes well under a millisecond, a large build about one second.
const Buckets& Seconds() {
  static const Buckets buckets = {0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30};
  return buckets;
}

double InSeconds(std::chrono::microseconds time) { return std::chrono::duration<double>(time).count(); }

prometheus::MetricFamily Value(prometheus::MetricType type, const char* name, const char* help, double value) {
  prometheus::ClientMetric metric;
  (type == prometheus::MetricType::Counter ? metric.counter.value : metric.gauge.value) = value;
  prometheus::MetricFamily family;
  family.name = name;
  family.help = help;
  family.type = type;
  family.metric.push_back(std::move(metric));
  return family;
}

}  // namespace

struct Metrics::Families {
  prometheus::Registry registry;
  prometheus::Family<prometheus::Counter>& requests = prometheus::BuildCounter()
                                                          .Name("terrace_http_requests_total")
                                                          .Help("Replies by route and status")
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
  prometheus::Family<prometheus::Histogram>& stages = prometheus::BuildHistogram()
                                                          .Name("terrace_tile_build_stage_seconds")
                                                          .Help("Time of each step of a build")
                                                          .Register(registry);
  prometheus::Family<prometheus::Counter>& refinements =
      prometheus::BuildCounter()
          .Name("terrace_refinements_total")
          .Help("Tiles built, by what was found of their refinement: replayed, continued, or made from the source")
          .Register(registry);
  prometheus::Counter& made = refinements.Add({{"use", "made"}});
  prometheus::Counter& continued = refinements.Add({{"use", "continued"}});
  prometheus::Counter& replayed = refinements.Add({{"use", "replayed"}});
  prometheus::Counter& source_errors = prometheus::BuildCounter()
                                           .Name("terrace_source_read_errors_total")
                                           .Help("Builds that failed because a source could not be read")
                                           .Register(registry)
                                           .Add({});
  prometheus::Histogram& read = stages.Add({{"stage", "read"}}, Seconds());
  prometheus::Histogram& refine = stages.Add({{"stage", "refine"}}, Seconds());
  prometheus::Histogram& encode = stages.Add({{"stage", "encode"}}, Seconds());
  prometheus::Histogram& compress = stages.Add({{"stage", "compress"}}, Seconds());
  std::vector<std::string> dataset_names;

  // What a reply counts in, found by its route, a literal, and its status: looking a family up takes as long as
  // answering from the cache.
  struct Reply {
    prometheus::Counter& count;
    prometheus::Histogram& duration;
  };
  const Reply& ReplyOf(std::string_view route, int status);

  std::shared_mutex mutex;
  std::map<std::pair<std::string_view, int>, Reply> replies;  // guarded by mutex
};

const Metrics::Families::Reply& Metrics::Families::ReplyOf(std::string_view route, int status) {
  {
    const std::shared_lock lock(mutex);
    if (const auto found = replies.find({route, status}); found != replies.end()) return found->second;
  }
  const std::string name(route);
  const Reply reply{requests.Add({{"route", name}, {"status", fmt::to_string(status)}}),
                    durations.Add({{"route", name}}, Seconds())};
  const std::unique_lock lock(mutex);
  return replies.emplace(std::pair(route, status), reply).first->second;
}

Metrics::Metrics(std::span<const DatasetView> datasets) : families_(std::make_unique<Families>()) {
  for (const DatasetView& dataset : datasets) families_->dataset_names.push_back(dataset.name);
}

Metrics::~Metrics() = default;

void Metrics::CountReply(const ReplyRecord& record) {
  const Families::Reply& reply = families_->ReplyOf(record.route, record.status);
  reply.count.Increment();
  reply.duration.Observe(InSeconds(record.duration));
}

void Metrics::CountBuild(const TileRequest& request, const Result<TilePtr>& tile) {
  const std::string_view result = tile ? "ok" : ToString(tile.error().code);
  families_->builds.Add({{"dataset", families_->dataset_names.at(request.dataset)}, {"result", std::string(result)}})
      .Increment();
  if (!tile) {
    if (tile.error().code == ErrorCode::kUnavailable) families_->source_errors.Increment();
    return;
  }
  switch ((*tile)->refinement) {
    case RefinementUse::kMade:
      families_->made.Increment();
      break;
    case RefinementUse::kContinued:
      families_->continued.Increment();
      break;
    case RefinementUse::kReplayed:
      families_->replayed.Increment();
      break;
    case RefinementUse::kNone:
      break;
  }
  const StageTimes& times = (*tile)->times;
  families_->read.Observe(InSeconds(times.read));
  families_->refine.Observe(InSeconds(times.refine));
  families_->encode.Observe(InSeconds(times.encode));
  families_->compress.Observe(InSeconds(times.compress));
}

std::string Metrics::Text(const TileService::Stats& tiles, const ByteCacheStats& refinements,
                          const EdgeStats& edge) const {
  constexpr auto kCounter = prometheus::MetricType::Counter;
  constexpr auto kGauge = prometheus::MetricType::Gauge;
  std::vector<prometheus::MetricFamily> all = families_->registry.Collect();
  const auto add = [&all](prometheus::MetricType type, const char* name, const char* help, auto value) {
    all.push_back(Value(type, name, help, static_cast<double>(value)));
  };
  add(kCounter, "terrace_cache_hits_total", "Tiles served from the cache", tiles.hits);
  add(kCounter, "terrace_cache_misses_total", "Tile requests that started a build or were refused one", tiles.misses);
  add(kCounter, "terrace_flights_joined_total", "Tile requests that waited for a build already under way",
      tiles.joined);
  add(kGauge, "terrace_cache_entries", "Tiles in the cache", tiles.cache.entries);
  add(kGauge, "terrace_cache_bytes", "Bytes charged to the cache", tiles.cache.bytes);
  add(kGauge, "terrace_refinement_cache_entries", "Refinements of tiles in the cache", refinements.entries);
  add(kGauge, "terrace_refinement_cache_bytes", "Bytes charged to the cache of refinements", refinements.bytes);
  add(kGauge, "terrace_flights", "Builds under way or waiting", tiles.in_flight);
  add(kGauge, "terrace_queue_length", "Builds that wait for a worker", tiles.queued);
  add(kGauge, "terrace_http_connections", "Open connections", edge.connections);
  add(kCounter, "terrace_http_connections_refused_total", "Connections turned away", edge.refused_connections);
  add(kGauge, "terrace_http_transfer_bytes", "Bytes of bodies on their way", edge.transfers.held_bytes);
  add(kCounter, "terrace_http_transfers_refused_total", "Bodies that found no room", edge.transfers.refused);
  add(kCounter, "terrace_http_transfers_cut_total", "Replies cut off because others needed their room",
      edge.transfers.cut);
  return prometheus::TextSerializer().Serialize(all);
}

}  // namespace terrace::server
