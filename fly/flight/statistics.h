// What happened in a flight, second by second.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "engine/geo/tile_key.h"
#include "fly/flight/value_counts.h"
#include "fly/scene/volume.h"
#include "fly/select/coverage.h"

namespace terrace::fly {

// How a request ended.
enum class Outcome {
  kOk,
  kRefused,   // 429 or 503: the client waits as long as Retry-After says
  kNotFound,  // 404, 410
  kStatus,    // another status than 2xx
  kNoConnection,
  kTimeout,
  kCut,     // closed before the reply was complete
  kNoHttp,  // bytes that are not an HTTP reply, or too many
  kDamaged  // a complete reply that does not decode
};
inline constexpr std::size_t kOutcomes = 9;
const char* NameOf(Outcome outcome);  // as in reports: "ok", "refused (429, 503)", ...
const char* KeyOf(Outcome outcome);   // as in JSON: "ok", "refused", ...

// Where the server had the tile, from Server-Timing.
enum class CacheTier {
  kHit,     // in memory
  kLower,   // in a tier below memory: archive, disk or shared cache
  kJoin,    // the request joined the build of another one
  kMiss,    // built for this request
  kUnknown  // the reply does not say
};
inline constexpr std::size_t kCacheTiers = 5;
const char* NameOf(CacheTier tier);
CacheTier ParseCacheTier(const std::string& server_timing);

enum class Phase { kOpening, kFirstView, kFlying, kArrived, kDone };

struct RequestRecord {
  Outcome outcome = Outcome::kOk;
  CacheTier tier = CacheTier::kUnknown;
  bool is_tile = true;  // not a document or subtree
  bool opened_connection = false;
  double seconds = 0;  // of a tile: of all its requests so far and the pauses between them
  std::uint64_t bytes = 0;
  std::uint32_t triangles = 0;
  bool is_incomplete = false;  // the triangles do not cover the tile's rectangle
};

struct FrameRecord {
  Phase phase = Phase::kFlying;
  bool is_refined = false;
  bool is_waiting = false;  // the picture lacks tiles other than those that have failed
  bool is_loaded = false;   // waits for nothing, and nothing is left to load ahead
  bool is_mixed = false;    // shows tiles of more than one version
  bool sees_data = false;   // shows more than level 0, or level 0 suffices for the view or is all there is
  bool is_late = false;
  double worst_px = 0;         // of the geometric errors of drawn tiles that can be refined
  double worst_stated_px = 0;  // of the errors that the server stated, at tiles whose volume the camera is not in
  std::size_t drawn = 0;       // with a mesh
  std::size_t wanted = 0, in_flight = 0;
  std::optional<Coverage> coverage;  // of some frames
};

struct Second {
  std::array<std::uint32_t, kOutcomes> outcomes{};
  std::array<std::uint32_t, kCacheTiers> tiers{};
  std::uint32_t tiles = 0;
  std::uint64_t bytes = 0, triangles = 0;
  std::vector<float> latencies_s;  // of replies with tiles
  std::uint32_t frames = 0, refined = 0, waiting = 0;
  double worst_px = 0, worst_stated_px = 0;
  std::size_t drawn = 0, wanted = 0, in_flight = 0;  // maxima over the frames
  double worst_hole = 0;                             // share of the screen
};

struct ClientRecord {
  double document_s = -1;    // until the document was read; -1: never
  double first_view_s = -1;  // until the first full view; -1: never
  double arrival_s = -1;     // from the end of the flight until the view was full; -1: never
  std::string failure;       // why it did not fly
};

struct Totals {
  std::array<std::uint64_t, kOutcomes> outcomes{};
  std::array<std::uint64_t, kCacheTiers> tiers{};
  std::uint64_t tiles = 0, other_requests = 0, bytes = 0, triangles = 0, retries = 0, connections = 0,
                version_changes = 0;
  std::uint64_t incomplete_tiles = 0;
  std::uint64_t frames = 0, flying_frames = 0, refined_frames = 0, waiting_frames = 0, late_frames = 0,
                mixed_frames = 0, data_frames = 0;
  // Flying frames whose Coverage has rays; those of them with holes; those where no tile was selected at some
  // point.
  std::uint64_t measured_frames = 0, hole_frames = 0, uncovered_frames = 0;
  double worst_hole = 0;                       // share of the screen
  double worst_px = -1, worst_stated_px = -1;  // of flying frames that drew a mesh; -1: there was none
  ValueCounts latencies_s;                     // of tiles that arrived
  std::uint64_t failed_tiles = 0;              // at the end
  ValueCounts open_s;          // how long the tiles were waited for that had neither arrived nor failed at the end
  ValueCounts frame_worst_px;  // of flying frames that drew a mesh
  std::map<int, std::uint64_t> tiles_by_level;
  // How often each failure, version change and note on the document occurred. After 50 texts, failures with new ones
  // are "other messages".
  std::map<std::string, std::uint64_t> messages;
};

// All that reports need.
struct FlightRecord {
  Totals totals;
  std::vector<Second> seconds;
  std::set<std::tuple<int, std::int64_t, std::int64_t>> loaded_tiles;  // level, x, y of the first 6,000 different ones
  std::vector<std::string> urls;  // of the requested tiles, if FlightOptions::keeps_urls
  std::vector<ClientRecord> clients;
  std::vector<GeodeticPoint> track;     // of client 0: each tenth frame, at most 100,000
  std::vector<double> version_changes;  // seconds since the start
};

// Thread-safe.
class Statistics {
 public:
  explicit Statistics(int clients);

  void AddRequest(double now_s, const RequestRecord& record);
  void AddFrame(double now_s, const FrameRecord& record);
  void AddLoadedTile(const geo::TileKey& key);
  void AddFailedTile();
  void AddOpenTile(double waited_s);
  void AddUrl(std::string url);
  void AddRetry();
  void AddVersionChange(double now_s, const std::string& from, const std::string& to);
  void AddMessage(const std::string& message);
  void SetClient(int client, const ClientRecord& record);
  void AddCamera(const GeodeticPoint& point);

  // Copies.
  FlightRecord record() const;
  Second second(std::size_t i) const;  // an empty one after the last

 private:
  Second& At(double now_s);

  mutable std::mutex mutex_;  // guards record_
  FlightRecord record_;
};

// The value with index ceil(share * (n - 1)) of the n values in ascending order, 0 <= share <= 1; 0 without values.
double Percentile(std::vector<float> values, double share);

}  // namespace terrace::fly
