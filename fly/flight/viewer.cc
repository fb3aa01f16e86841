#include "fly/flight/viewer.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

#include "fly/content/glb.h"
#include "fly/content/gunzip.h"
#include "fly/content/quantized_mesh.h"
#include "fly/select/coverage.h"

namespace terrace::fly {
namespace {

// As CesiumJS asks: with it servers know a client of terrain, and send normals.
constexpr const char* kAcceptTerrain =
    "application/vnd.quantized-mesh;extensions=octvertexnormals,application/octet-stream;q=0.9,*/*;q=0.01";
constexpr const char* kAcceptJson = "application/json,*/*;q=0.01";

constexpr std::uint64_t kCoveragePeriod = 6;  // frames
constexpr std::uint64_t kTrackPeriod = 10;
constexpr double kWorstPixels = 9999;                   // inside of a tile's volume the error has no bound
constexpr double kFirstPause = 0.5, kLongestPause = 8;  // seconds, where the server names none
constexpr double kDocumentPause = 2;                    // between two looks at a document that has changed
constexpr int kDamagedAttempts = 2;

// 0.75 to 1.25, spread evenly: clients that were refused together do not come back together.
double Spread(std::uint64_t i) { return 0.75 + 0.5 * std::fmod(static_cast<double>(i) * 0.6180339887498949, 1.0); }

bool IsTransient(const HttpReply& reply, Outcome outcome) {
  switch (outcome) {
    case Outcome::kOk:
    case Outcome::kNotFound:
      return false;
    case Outcome::kStatus:
      return reply.status >= 500;
    default:
      return true;
  }
}

std::string Describe(const HttpReply& reply, Outcome outcome) {
  if (reply.failure != Failure::kNone) return fmt::format("{}: {}", NameOf(outcome), reply.detail);
  return fmt::format("status {}", reply.status);
}

}  // namespace

Viewer::Viewer(const FlightOptions& options, int number, HttpClient& http, WorkerPool& workers, Statistics& statistics)
    : options_(options), number_(number), http_(http), workers_(workers), statistics_(statistics) {}

Outcome Viewer::OutcomeOf(const HttpReply& reply) {
  switch (reply.failure) {
    case Failure::kNone:
      break;
    case Failure::kConnect:
      return Outcome::kNoConnection;
    case Failure::kTimeout:
      return Outcome::kTimeout;
    case Failure::kCut:
      return Outcome::kCut;
    case Failure::kMalformed:
    case Failure::kTooLarge:
      return Outcome::kNoHttp;
  }
  if (reply.status >= 200 && reply.status < 300) return Outcome::kOk;
  if (reply.status == 429 || reply.status == 503) return Outcome::kRefused;
  return reply.status == 404 || reply.status == 410 ? Outcome::kNotFound : Outcome::kStatus;
}

void Viewer::Decode(Format format, Arrival& arrival) {
  arrival.outcome = OutcomeOf(arrival.reply);
  if (arrival.outcome != Outcome::kOk) {
    arrival.message = terrace::fly::Describe(arrival.reply, arrival.outcome);
    return;
  }
  const auto damaged = [&arrival](const Error& error) {
    arrival.outcome = Outcome::kDamaged;
    arrival.message = error.message;
  };
  std::string& body = arrival.reply.body;
  // Some servers leave the label out; the first bytes tell.
  if (arrival.reply.is_gzip || IsGzip(body)) {
    Result<std::string> plain = Gunzip(body);
    if (!plain) return damaged(plain.error());
    body = *std::move(plain);
  }
  if (arrival.what != What::kTile) {
    arrival.text = std::move(body);
    return;
  }
  Result<TileContent> content = format == Format::kTerrain ? DecodeQuantizedMesh(body) : DecodeGlb(body);
  body = {};
  if (!content) return damaged(content.error());
  arrival.content = *content;
}

void Viewer::Ask(What what, Tile* tile, const std::string& uri) {
  Result<Url> url = what == What::kDocument ? Result<Url>(options_.document) : Resolve(options_.document, uri);
  if (!url) {
    if (tile != nullptr) tile->state = LoadState::kFailed;
    statistics_.AddMessage(url.error().message);
    return;
  }
  if (tile != nullptr) {
    tile->in_flight = true;
    ++active_;
    if (what == What::kTile) statistics_.AddUrl(url->target);
  }
  const bool is_terrain = options_.format == Format::kTerrain;
  const char* accept = what == What::kDocument             ? kAcceptJson
                       : what == What::kTile && is_terrain ? kAcceptTerrain
                                                           : "*/*";
  const auto version = static_cast<std::uint32_t>(versions_.size());
  http_.Get(number_, *std::move(url), accept,
            [inbox = inbox_, &workers = workers_, format = options_.format, what, tile, version](HttpReply reply) {
              auto arrival = std::make_shared<Arrival>();
              arrival->what = what;
              arrival->tile = tile;
              arrival->version = version;
              arrival->reply = std::move(reply);
              workers.Post([inbox, format, arrival] {
                Decode(format, *arrival);
                const std::lock_guard lock(inbox->mutex);
                inbox->arrivals.push_back(std::move(*arrival));
              });
            });
}

void Viewer::TakeArrivals(double now_s) {
  std::vector<Arrival> arrivals;
  {
    const std::lock_guard lock(inbox_->mutex);
    arrivals.swap(inbox_->arrivals);
  }
  for (Arrival& arrival : arrivals) Take(arrival, now_s);
}

void Viewer::Take(Arrival& arrival, double now_s) {
  if (arrival.tile != nullptr) {
    arrival.tile->in_flight = false;
    --active_;
  }
  if (arrival.what == What::kSubtree && arrival.outcome == Outcome::kOk) {
    const Result<void> taken = tree_->TakeSubtree(*arrival.tile, arrival.text);
    if (!taken) {
      arrival.outcome = Outcome::kDamaged;
      arrival.message = taken.error().message;
    }
  }
  RequestRecord record;
  record.outcome = arrival.outcome;
  record.is_tile = arrival.what == What::kTile;
  record.tier = ParseCacheTier(arrival.reply.server_timing);
  record.seconds = arrival.reply.seconds;
  record.bytes = arrival.reply.bytes;
  record.opened_connection = arrival.reply.opened_connection;
  record.triangles = arrival.content.triangles;
  record.is_incomplete = arrival.content.covered >= 0 && std::abs(arrival.content.covered - 1) > 1e-9;
  statistics_.AddRequest(now_s, record);
  if (!arrival.message.empty()) {
    constexpr const char* kNames[] = {"document", "subtree", "tile"};
    statistics_.AddMessage(fmt::format("{}: {}", kNames[static_cast<std::size_t>(arrival.what)], arrival.message));
  }
  if (arrival.what == What::kDocument) return TakeDocument(arrival, now_s);
  if (arrival.outcome != Outcome::kOk) return FailOrWait(arrival, now_s);
  arrival.tile->attempts = 0;
  if (arrival.what == What::kTile) TakeTile(arrival, now_s);
}

void Viewer::TakeDocument(const Arrival& arrival, double now_s) {
  asks_document_ = false;
  document_due_s_ = now_s + kDocumentPause;
  if (arrival.outcome != Outcome::kOk) {
    document_due_s_ = now_s + PauseFor(arrival, ++document_attempts_);
    document_problem_ = arrival.message;
    if (!tree_ && (!IsTransient(arrival.reply, arrival.outcome) ||
                   (arrival.outcome != Outcome::kRefused && document_attempts_ >= options_.max_attempts))) {
      GiveUp(fmt::format("{}: {}", options_.document.Text(), arrival.message));
    }
    return;
  }
  if (tree_) {
    const std::string before = tree_->version();
    if (const Result<void> taken = tree_->TakeDocument(arrival.text); !taken) {
      statistics_.AddMessage(taken.error().message);
    }
    if (tree_->version() == before) return;
    statistics_.AddVersionChange(now_s, before, tree_->version());
    versions_.push_back(tree_->version());
    for (Tile* tile : ready_) tile->is_stale = true;  // drawn until the new one is there
    return;
  }
  Result<std::unique_ptr<TileTree>> tree =
      options_.format == Format::kTerrain ? MakeLayerTree(arrival.text) : MakeTilesetTree(arrival.text);
  if (!tree) return GiveUp(fmt::format("{}: {}", options_.document.Text(), tree.error().message));
  tree_ = *std::move(tree);
  versions_.push_back(tree_->version());
  record_.document_s = now_s - start_s_;
  phase_ = Phase::kFirstView;
}

void Viewer::TakeTile(const Arrival& arrival, double now_s) {
  Tile& tile = *arrival.tile;
  tile_bytes_ -= tile.decoded_bytes;
  tree_->TakeContent(tile, arrival.content);
  tile.triangles = arrival.content.triangles;
  tile.decoded_bytes = arrival.content.bytes;
  tile_bytes_ += tile.decoded_bytes;
  tile.version = arrival.version;
  tile.is_stale = arrival.version != versions_.size();
  const std::string& stated = arrival.reply.max_error;
  tile.stated_error_m = -1;
  std::from_chars(stated.data(), stated.data() + stated.size(), tile.stated_error_m);
  if (tile.key) statistics_.AddAsked(now_s, *tile.key, ParseCacheTier(arrival.reply.server_timing));
  TakeReady(tile);
  CheckVersion(arrival, now_s);
}

void Viewer::TakeReady(Tile& tile) {
  if (tile.state != LoadState::kReady) ready_.push_back(&tile);
  tile.state = LoadState::kReady;
}

// A URL with a version that is not the current one is answered with the current tile, which must not be stored.
void Viewer::CheckVersion(const Arrival& arrival, double now_s) {
  const bool is_suspect =
      arrival.outcome == Outcome::kNotFound || arrival.reply.cache_control.find("no-store") != std::string::npos;
  if (!is_suspect || tree_->version().empty() || asks_document_ || now_s < document_due_s_) return;
  asks_document_ = true;
  Ask(What::kDocument, nullptr, "");
}

double Viewer::PauseFor(const Arrival& arrival, int attempts) const {
  double pause_s = std::min(kLongestPause, kFirstPause * std::exp2(std::min(attempts, 10) - 1));
  const std::string& text = arrival.reply.retry_after;
  double stated = -1;
  std::from_chars(text.data(), text.data() + text.size(), stated);
  const std::uint64_t seed = static_cast<std::uint64_t>(number_) * 1000 + waiting_.size();
  if (stated >= 0) return stated + (Spread(seed) - 0.75);  // never sooner than asked
  return pause_s * Spread(seed);
}

void Viewer::FailOrWait(const Arrival& arrival, double now_s) {
  Tile& tile = *arrival.tile;
  ++tile.attempts;
  CheckVersion(arrival, now_s);
  const int limit = arrival.outcome == Outcome::kRefused ? 1'000'000  // a busy server is asked as long as it answers so
                    : arrival.outcome == Outcome::kDamaged ? kDamagedAttempts
                                                           : options_.max_attempts;
  if (IsTransient(arrival.reply, arrival.outcome) && tile.attempts < limit) {
    tile.waiting = true;
    waiting_.push_back({&tile, now_s + PauseFor(arrival, tile.attempts)});
    statistics_.AddRetry();
    return;
  }
  tile.is_stale = false;  // what it has stays
  if (tile.state != LoadState::kReady) tile.state = LoadState::kFailed;
}

void Viewer::WakeWaiting(double now_s) {
  std::erase_if(waiting_, [now_s](const Waiting& waiting) {
    if (waiting.due_s > now_s) return false;
    waiting.tile->waiting = false;
    return true;
  });
}

void Viewer::StartLoad(Tile& tile) {
  if (!tile.NeedsLoad()) return;
  if (tile.content == Content::kUpsampled) {
    Tile& parent = *tile.parent;
    if (parent.state == LoadState::kUnloaded) return StartLoad(parent);
    tile.stated_error_m = parent.stated_error_m;
    tile.version = parent.version;
    tile.is_stale = false;
    tile.state = LoadState::kReady;
    return;
  }
  const TileRequest request = tree_->RequestFor(tile);
  if (request.kind == TileRequest::Kind::kNothing) {
    tile.is_stale = false;
    tile.state = LoadState::kReady;
    return;
  }
  Ask(request.kind == TileRequest::Kind::kSubtree ? What::kSubtree : What::kTile, &tile, request.uri);
}

void Viewer::StartLoads(const Selection& selection) {
  for (const LoadTask& task : selection.loads) {
    if (active_ >= options_.max_loads) return;
    StartLoad(*task.tile);
  }
}

// The longest unseen tiles go first; what this frame visited stays.
void Viewer::Unload(std::uint64_t frame) {
  if (tile_bytes_ <= options_.max_tile_bytes) return;
  std::sort(ready_.begin(), ready_.end(),
            [](const Tile* a, const Tile* b) { return a->visits[0].frame > b->visits[0].frame; });
  while (!ready_.empty() && tile_bytes_ > options_.max_tile_bytes && ready_.back()->visits[0].frame < frame) {
    Tile& tile = *ready_.back();
    ready_.pop_back();
    tile_bytes_ -= std::exchange(tile.decoded_bytes, 0);
    tile.state = LoadState::kUnloaded;
    tile.is_stale = false;
  }
}

FrameRecord Viewer::Describe(const Selection& selection, const View& view) {
  FrameRecord record;
  record.phase = phase_;
  record.is_refined = selection.IsRefined();
  record.drawn = selection.drawn.size();
  record.wanted = selection.loads.size() + selection.pending;
  record.is_loaded = record.is_refined && record.wanted == 0;
  record.in_flight = static_cast<std::size_t>(active_);
  std::uint32_t version = 0;
  for (const DrawnTile& drawn : selection.drawn) {
    const Tile& tile = *drawn.tile;
    const bool can_refine = !tile.children.empty() || tile.may_have_more_children;
    if (can_refine) record.worst_px = std::clamp(drawn.error_px, record.worst_px, kWorstPixels);
    if (tile.may_have_more_children && drawn.error_px >= options_.select.max_error_px) record.is_refined = false;
    record.triangles += tile.triangles;
    if (tile.state != LoadState::kReady || tile.content == Content::kEmpty) continue;
    if (tile.stated_error_m >= 0) {
      const double px = view.ErrorInPixels(tile.stated_error_m, drawn.distance_m);
      record.worst_stated_px = std::clamp(px, record.worst_stated_px, kWorstPixels);
    }
    if (version != 0 && tile.version != version) record.is_mixed = true;
    version = tile.version;
  }
  if (phase_ == Phase::kFlying && frame_ % kCoveragePeriod == 0) {
    const Coverage coverage = MeasureCoverage(view, frame_, tree_->root());
    record.is_measured = true;
    record.rays = coverage.rays;
    record.missing = coverage.missing;
    record.uncovered = coverage.uncovered;
  }
  return record;
}

double Viewer::FlownSeconds(double now_s) const {
  const double offset = options_.path.duration_s() * number_ / options_.clients;
  if (phase_ == Phase::kFlying) return offset + now_s - takeoff_s_;
  return phase_ == Phase::kArrived ? offset + options_.duration_s : offset;
}

void Viewer::Advance(const FrameRecord& record, double now_s) {
  const Phase before = phase_;
  const double first_view_s = record_.first_view_s;
  AdvancePhase(record, now_s);
  if (phase_ != before || record_.first_view_s != first_view_s) statistics_.SetClient(number_, record_);
}

void Viewer::AdvancePhase(const FrameRecord& record, double now_s) {
  if (phase_ == Phase::kFirstView && (record.is_refined || now_s - start_s_ > options_.first_view_limit_s)) {
    if (record.is_refined) record_.first_view_s = now_s - start_s_;
    phase_ = Phase::kFlying;
    takeoff_s_ = now_s;
  }
  if (phase_ == Phase::kFlying && now_s - takeoff_s_ >= options_.duration_s) {
    phase_ = Phase::kArrived;
    landing_s_ = now_s;
    return;  // the next frame is the first at the end
  }
  if (phase_ == Phase::kArrived) {
    if (record.is_refined && record_.arrival_s < 0) record_.arrival_s = now_s - landing_s_;
    // A view that came later than the take-off still counts as one.
    if (record.is_refined && record_.first_view_s < 0) record_.first_view_s = now_s - start_s_;
    if (record.is_loaded || now_s - landing_s_ > options_.arrival_limit_s) phase_ = Phase::kDone;
  }
  if (phase_ == Phase::kFlying && record.is_refined && record_.first_view_s < 0)
    record_.first_view_s = now_s - start_s_;
}

void Viewer::GiveUp(const std::string& why) {
  record_.failure = why;
  phase_ = Phase::kDone;
  statistics_.SetClient(number_, record_);
}

void Viewer::Frame(double now_s, bool is_late) {
  if (start_s_ < 0) start_s_ = now_s;
  TakeArrivals(now_s);
  if (phase_ == Phase::kDone) return;
  if (!tree_) {
    if (now_s - start_s_ > options_.first_view_limit_s) {
      const std::string& problem = document_problem_;
      return GiveUp(fmt::format("{}: no document within {} s{}{}", options_.document.Text(),
                                options_.first_view_limit_s, problem.empty() ? "" : "; ", problem));
    }
    if (!asks_document_ && now_s >= document_due_s_) {
      asks_document_ = true;
      Ask(What::kDocument, nullptr, "");
    }
    return;
  }
  WakeWaiting(now_s);
  const Pose pose = options_.path.PoseAt(FlownSeconds(now_s));
  const View view(pose, options_.lens);
  Selection selection;
  ++frame_;
  SelectTiles(
      options_.select, view, [this](Tile& tile) { tree_->AddChildren(tile); }, frame_, tree_->root(), selection);
  FrameRecord record = Describe(selection, view);
  record.is_late = is_late;
  StartLoads(selection);
  Unload(frame_);
  statistics_.AddFrame(now_s, record);
  if (number_ == 0 && frame_ % kTrackPeriod == 1) statistics_.AddCamera(pose.position);
  Advance(record, now_s);
}

}  // namespace terrace::fly
