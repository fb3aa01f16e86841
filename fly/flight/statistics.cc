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

Statistics::Statistics(int clients) : clients_(static_cast<std::size_t>(clients)) {}

Second& Statistics::At(double now_s) {
  const std::size_t i = std::min(static_cast<std::size_t>(std::max(0.0, now_s)), kMaxSeconds - 1);
  if (seconds_.size() <= i) seconds_.resize(i + 1);
  return seconds_[i];
}

void Statistics::AddRequest(double now_s, const RequestRecord& record) {
  const std::lock_guard lock(mutex_);
  Second& second = At(now_s);
  const auto outcome = static_cast<std::size_t>(record.outcome);
  ++second.outcomes[outcome];
  ++totals_.outcomes[outcome];
  second.bytes += record.bytes;
  totals_.bytes += record.bytes;
  totals_.connections += record.opened_connection ? 1 : 0;
  if (!record.is_tile) ++totals_.other_requests;
  if (!record.is_tile || record.outcome != Outcome::kOk) return;
  const auto tier = static_cast<std::size_t>(record.tier);
  ++second.tiers[tier];
  ++totals_.tiers[tier];
  ++second.tiles;
  ++totals_.tiles;
  second.triangles += record.triangles;
  totals_.triangles += record.triangles;
  totals_.incomplete_tiles += record.is_incomplete ? 1 : 0;
  second.latencies_s.push_back(static_cast<float>(record.seconds));
  totals_.latencies_s.push_back(static_cast<float>(record.seconds));
}

void Statistics::AddFrame(double now_s, const FrameRecord& record) {
  const std::lock_guard lock(mutex_);
  Second& second = At(now_s);
  ++second.frames;
  second.refined += record.is_refined ? 1 : 0;
  second.drawn = std::max(second.drawn, record.drawn);
  second.wanted = std::max(second.wanted, record.wanted);
  second.in_flight = std::max(second.in_flight, record.in_flight);
  second.worst_px = std::max(second.worst_px, record.worst_px);
  second.worst_stated_px = std::max(second.worst_stated_px, record.worst_stated_px);
  const double hole = record.rays > 0 ? static_cast<double>(record.missing + record.uncovered) / record.rays : 0;
  ++totals_.frames;
  totals_.late_frames += record.is_late ? 1 : 0;
  totals_.mixed_frames += record.is_mixed ? 1 : 0;
  if (record.phase != Phase::kFlying) return;
  second.worst_hole = std::max(second.worst_hole, hole);
  ++second.flying;
  second.flying_refined += record.is_refined ? 1 : 0;
  ++totals_.flying_frames;
  totals_.refined_frames += record.is_refined ? 1 : 0;
  totals_.measured_frames += record.is_measured ? 1 : 0;
  totals_.hole_frames += hole > 0 ? 1 : 0;
  totals_.uncovered_frames += record.uncovered > 0 ? 1 : 0;
  totals_.worst_hole = std::max(totals_.worst_hole, hole);
  totals_.worst_px = std::max(totals_.worst_px, record.worst_px);
  totals_.worst_stated_px = std::max(totals_.worst_stated_px, record.worst_stated_px);
  totals_.frame_worst_px.push_back(static_cast<float>(record.worst_px));
}

void Statistics::AddLoadedTile(double now_s, const geo::TileKey& key, CacheTier tier) {
  const std::lock_guard lock(mutex_);
  loaded_tiles_.push_back({key, now_s, tier});
}

void Statistics::AddUrl(std::string url) {
  const std::lock_guard lock(mutex_);
  urls_.push_back(std::move(url));
}

void Statistics::AddRetry() {
  const std::lock_guard lock(mutex_);
  ++totals_.retries;
}

void Statistics::AddVersionChange(double now_s, const std::string& from, const std::string& to) {
  const std::lock_guard lock(mutex_);
  ++totals_.version_changes;
  version_changes_.push_back(now_s);
  ++totals_.messages["the dataset changed from version " + from + " to " + to];
}

void Statistics::AddMessage(const std::string& message) {
  const std::lock_guard lock(mutex_);
  const bool is_new = !totals_.messages.contains(message);
  ++totals_.messages[is_new && totals_.messages.size() >= kMaxMessages ? "other messages" : message];
}

void Statistics::SetClient(int client, const ClientRecord& record) {
  const std::lock_guard lock(mutex_);
  clients_[static_cast<std::size_t>(client)] = record;
}

void Statistics::AddCamera(const GeodeticPoint& point) {
  const std::lock_guard lock(mutex_);
  if (track_.size() < kMaxTrack) track_.push_back(point);
}

Totals Statistics::totals() const {
  const std::lock_guard lock(mutex_);
  return totals_;
}

Second Statistics::second(std::size_t i) const {
  const std::lock_guard lock(mutex_);
  return i < seconds_.size() ? seconds_[i] : Second{};
}

std::vector<Second> Statistics::seconds() const {
  const std::lock_guard lock(mutex_);
  return seconds_;
}

std::vector<LoadedTile> Statistics::loaded_tiles() const {
  const std::lock_guard lock(mutex_);
  return loaded_tiles_;
}

std::vector<std::string> Statistics::urls() const {
  const std::lock_guard lock(mutex_);
  return urls_;
}

std::vector<ClientRecord> Statistics::clients() const {
  const std::lock_guard lock(mutex_);
  return clients_;
}

std::vector<GeodeticPoint> Statistics::track() const {
  const std::lock_guard lock(mutex_);
  return track_;
}

std::vector<double> Statistics::version_changes() const {
  const std::lock_guard lock(mutex_);
  return version_changes_;
}

}  // namespace terrace::fly
