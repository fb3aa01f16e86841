#include "fly/flight/statistics.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

namespace terrace::fly {
namespace {

constexpr std::size_t kMaxMessages = 50;
constexpr std::size_t kMaxSeconds = 7 * 86400;  // later ones count into the last
constexpr std::size_t kMaxTrack = 100'000;
constexpr std::size_t kMaxTiles = 6'000;

}  // namespace

const char* NameOf(Outcome outcome) {
  static constexpr std::array<const char*, kOutcomes> kNames = {
      "ok",      "refused (429, 503)", "not found (404, 410)", "other status", "no connection", "timeout", "cut off",
      "no HTTP", "damaged tile"};
  return kNames.at(static_cast<std::size_t>(outcome));
}

const char* KeyOf(Outcome outcome) {
  static constexpr std::array<const char*, kOutcomes> kKeys = {
      "ok", "refused", "not_found", "other_status", "no_connection", "timeout", "cut", "no_http", "damaged"};
  return kKeys.at(static_cast<std::size_t>(outcome));
}

const char* NameOf(CacheTier tier) {
  static constexpr std::array<const char*, kCacheTiers> kNames = {"hit", "lower", "join", "miss", "unknown"};
  return kNames.at(static_cast<std::size_t>(tier));
}

CacheTier ParseCacheTier(const std::string& server_timing) {
  constexpr std::string_view kStart = "cache;desc=";
  const std::size_t at = server_timing.find(kStart);
  if (at == std::string::npos) return CacheTier::kUnknown;
  const std::size_t begin = at + kStart.size();
  const std::string_view tier =
      std::string_view(server_timing).substr(begin, server_timing.find_first_of(",; ", begin) - begin);
  if (tier == "hit") return CacheTier::kHit;
  if (tier == "join") return CacheTier::kJoin;
  if (tier == "miss") return CacheTier::kMiss;
  return tier.empty() ? CacheTier::kUnknown : CacheTier::kLower;
}

double Percentile(std::vector<float> values, double share) {
  if (values.empty()) return 0;
  const auto last = static_cast<double>(values.size() - 1);
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(std::ceil(std::clamp(share, 0.0, 1.0) * last));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

Statistics::Statistics(int clients) { record_.clients.resize(static_cast<std::size_t>(clients)); }

Second& Statistics::At(double now_s) {
  const std::size_t i = std::min(static_cast<std::size_t>(std::max(0.0, now_s)), kMaxSeconds - 1);
  if (record_.seconds.size() <= i) record_.seconds.resize(i + 1);
  return record_.seconds[i];
}

void Statistics::AddRequest(double now_s, const RequestRecord& record) {
  const std::lock_guard lock(mutex_);
  Second& second = At(now_s);
  Totals& totals = record_.totals;
  const auto outcome = static_cast<std::size_t>(record.outcome);
  ++second.outcomes[outcome];
  ++totals.outcomes[outcome];
  second.bytes += record.bytes;
  totals.bytes += record.bytes;
  totals.connections += record.opened_connection ? 1 : 0;
  if (!record.is_tile) ++totals.other_requests;
  if (!record.is_tile || record.outcome != Outcome::kOk) return;
  const auto tier = static_cast<std::size_t>(record.tier);
  ++second.tiers[tier];
  ++totals.tiers[tier];
  ++second.tiles;
  ++totals.tiles;
  second.triangles += record.triangles;
  totals.triangles += record.triangles;
  totals.incomplete_tiles += record.is_incomplete ? 1 : 0;
  second.latencies_s.push_back(static_cast<float>(record.seconds));
  totals.latencies_s.Add(record.seconds);
}

void Statistics::AddFrame(double now_s, const FrameRecord& record) {
  const std::lock_guard lock(mutex_);
  Second& second = At(now_s);
  Totals& totals = record_.totals;
  ++second.frames;
  second.refined += record.is_refined ? 1 : 0;
  second.waiting += record.is_waiting ? 1 : 0;
  second.drawn = std::max(second.drawn, record.drawn);
  second.wanted = std::max(second.wanted, record.wanted);
  second.in_flight = std::max(second.in_flight, record.in_flight);
  if (record.drawn > 0) {
    second.worst_px = std::max(second.worst_px, record.worst_px);
    second.worst_stated_px = std::max(second.worst_stated_px, record.worst_stated_px);
  }
  const Coverage coverage = record.coverage.value_or(Coverage());
  const double hole = coverage.rays > 0 ? static_cast<double>(coverage.holes()) / coverage.rays : 0;
  ++totals.frames;
  totals.late_frames += record.is_late ? 1 : 0;
  totals.mixed_frames += record.is_mixed ? 1 : 0;
  if (record.phase != Phase::kFlying) return;
  second.worst_hole = std::max(second.worst_hole, hole);
  ++totals.flying_frames;
  totals.refined_frames += record.is_refined ? 1 : 0;
  totals.waiting_frames += record.is_waiting ? 1 : 0;
  totals.data_frames += record.sees_data ? 1 : 0;
  totals.measured_frames += coverage.rays > 0 ? 1 : 0;
  totals.hole_frames += hole > 0 ? 1 : 0;
  totals.uncovered_frames += coverage.uncovered > 0 ? 1 : 0;
  totals.worst_hole = std::max(totals.worst_hole, hole);
  if (record.drawn == 0) return;
  totals.worst_px = std::max(totals.worst_px, record.worst_px);
  totals.worst_stated_px = std::max(totals.worst_stated_px, record.worst_stated_px);
  totals.frame_worst_px.Add(record.worst_px);
}

void Statistics::AddLoadedTile(const geo::TileKey& key) {
  const std::lock_guard lock(mutex_);
  ++record_.totals.tiles_by_level[key.level];
  if (record_.loaded_tiles.size() < kMaxTiles) record_.loaded_tiles.insert({key.level, key.x, key.y});
}

void Statistics::AddFailedTile() {
  const std::lock_guard lock(mutex_);
  ++record_.totals.failed_tiles;
}

void Statistics::AddOpenTile(double waited_s) {
  const std::lock_guard lock(mutex_);
  record_.totals.open_s.Add(waited_s);
}

void Statistics::AddUrl(std::string url) {
  const std::lock_guard lock(mutex_);
  record_.urls.push_back(std::move(url));
}

void Statistics::AddRetry() {
  const std::lock_guard lock(mutex_);
  ++record_.totals.retries;
}

void Statistics::AddVersionChange(double now_s, const std::string& from, const std::string& to) {
  const std::lock_guard lock(mutex_);
  ++record_.totals.version_changes;
  record_.version_changes.push_back(now_s);
  ++record_.totals.messages["the dataset changed from version " + from + " to " + to];
}

void Statistics::AddMessage(const std::string& message) {
  const std::lock_guard lock(mutex_);
  const bool is_new = !record_.totals.messages.contains(message);
  ++record_.totals.messages[is_new && record_.totals.messages.size() >= kMaxMessages ? "other messages" : message];
}

void Statistics::SetClient(int client, const ClientRecord& record) {
  const std::lock_guard lock(mutex_);
  record_.clients[static_cast<std::size_t>(client)] = record;
}

void Statistics::AddCamera(const GeodeticPoint& point) {
  const std::lock_guard lock(mutex_);
  if (record_.track.size() < kMaxTrack) record_.track.push_back(point);
}

FlightRecord Statistics::record() const {
  const std::lock_guard lock(mutex_);
  return record_;
}

Second Statistics::second(std::size_t i) const {
  const std::lock_guard lock(mutex_);
  return i < record_.seconds.size() ? record_.seconds[i] : Second{};
}

}  // namespace terrace::fly
