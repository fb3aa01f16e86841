#include "fly/flight/client.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <charconv>
#include <chrono>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "fly/content/glb.h"
#include "fly/content/gunzip.h"
#include "fly/content/quantized_mesh.h"
#include "fly/http/retry_after.h"

namespace terrace::fly {
namespace {

// The Accept header of CesiumJS, which asks for normals. Servers recognize terrain clients by it.
constexpr const char* kAcceptTerrain =
    "application/vnd.quantized-mesh;extensions=octvertexnormals,application/octet-stream;q=0.9,*/*;q=0.01";
constexpr const char* kAcceptJson = "application/json,*/*;q=0.01";

constexpr std::uint64_t kCoveragePeriod = 6;  // frames
constexpr std::uint64_t kTrackPeriod = 10;
constexpr double kWorstPixels = 9999;                   // limit: inside a tile's volume the error is infinite
constexpr double kFirstPause = 0.5, kLongestPause = 8;  // seconds, where the server names none
constexpr double kDocumentPause = 2;                    // seconds between two requests for the document
constexpr int kDamagedAttempts = 2;
constexpr int kMaxRedirects = 5;  // of tiles and subtrees, not of the document, to which their URIs are relative

// 0.75 to 1.25, spread evenly: clients that were refused together do not come back together.
double Spread(std::uint64_t i) { return 0.75 + 0.5 * std::fmod(static_cast<double>(i) * 0.6180339887498949, 1.0); }

bool IsTransient(const HttpReply& reply, Outcome outcome) {
  if (reply.failure == Failure::kUntrusted) return false;
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

// What the server says in a problem document (RFC 9457); empty: nothing.
std::string DetailOf(const std::string& body) {
  constexpr std::size_t kMaxDetailBytes = 500;
  const auto problem = nlohmann::json::parse(body, nullptr, /*allow_exceptions=*/false);
  const auto detail = problem.is_object() ? problem.find("detail") : problem.end();
  if (detail == problem.end() || !detail->is_string()) return {};
  const auto& text = detail->get_ref<const std::string&>();
  const bool is_line = std::none_of(text.begin(), text.end(), [](unsigned char c) { return c < ' ' || c == 0x7F; });
  return is_line && text.size() <= kMaxDetailBytes ? text : std::string();
}

std::string Explain(const HttpReply& reply, Outcome outcome, bool is_document) {
  if (reply.failure != Failure::kNone) return fmt::format("{}: {}", NameOf(outcome), reply.detail);
  std::string text = fmt::format("status {}", reply.status);
  if (const std::string detail = DetailOf(reply.body); !detail.empty()) text += ": " + detail;
  if (reply.location) {
    text += is_document ? fmt::format("; it moved to {}; give this URL", reply.location->PublicText())
                        : fmt::format("; it is redirected more than {} times", kMaxRedirects);
  }
  if (reply.status == 401) text += "; send a token with --header \"Authorization: Bearer TOKEN\"";
  return text;
}

// Of the tile and all of its descendants.
void ForEachTile(Tile& tile, const std::function<void(Tile&)>& call) {
  call(tile);
  for (const auto& child : tile.children) ForEachTile(*child, call);
}

}  // namespace

Client::Client(const FlightOptions& options, int number, HttpClient& http, boost::asio::thread_pool& workers,
               Statistics& statistics)
    : options_(options), number_(number), http_(http), workers_(workers), statistics_(statistics) {}

Outcome Client::OutcomeOf(const HttpReply& reply) {
  switch (reply.failure) {
    case Failure::kNone:
      break;
    case Failure::kConnect:
    case Failure::kUntrusted:
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

void Client::Decode(Format format, DecodedReply& decoded) {
  decoded.outcome = OutcomeOf(decoded.reply);
  const auto damaged = [&decoded](const Error& error) {
    decoded.outcome = Outcome::kDamaged;
    decoded.message = error.message;
    decoded.is_unsupported = error.code == ErrorCode::kNotFound;
  };
  std::string& body = decoded.reply.body;
  // Some servers omit Content-Encoding: the first bytes identify gzip as well.
  if (decoded.reply.is_gzip || IsGzip(body)) {
    Result<std::string> plain = Gunzip(body);
    if (plain) {
      body = *std::move(plain);
    } else if (decoded.outcome == Outcome::kOk) {
      return damaged(plain.error());
    }
  }
  if (decoded.outcome != Outcome::kOk) {
    decoded.message = Explain(decoded.reply, decoded.outcome, decoded.resource == Resource::kDocument);
    return;
  }
  if (decoded.resource != Resource::kTile) {
    decoded.text = std::move(body);
    return;
  }
  Result<TileContent> content = format == Format::kTerrain ? DecodeQuantizedMesh(body) : DecodeGlb(body);
  body = {};
  if (!content) return damaged(content.error());
  decoded.content = *content;
}

void Client::SendRequest(Resource resource, Tile* tile, const NextRequest& request) {
  Result<Url> url = resource == Resource::kDocument ? Result<Url>(options_.document)
                    : request.inherits_query        ? ResolveWithQuery(options_.document, request.uri)
                                                    : Resolve(options_.document, request.uri);
  if (!url) {
    if (tile != nullptr) Fail(*tile);
    statistics_.AddMessage(url.error().message);
    return;
  }
  if (tile != nullptr) {
    tile->in_flight = true;
    ++active_;
    if (options_.keeps_urls && resource == Resource::kTile) statistics_.AddUrl(url->target);
  }
  const bool is_terrain = options_.format == Format::kTerrain;
  const char* accept = resource == Resource::kDocument             ? kAcceptJson
                       : resource == Resource::kTile && is_terrain ? kAcceptTerrain
                                                                   : "*/*";
  http_.Get(number_, *std::move(url), accept, resource == Resource::kDocument ? 0 : kMaxRedirects,
            [inbox = inbox_, &workers = workers_, format = options_.format, resource, tile,
             version = version_](HttpReply reply) {
              auto decoded = std::make_shared<DecodedReply>();
              decoded->resource = resource;
              decoded->tile = tile;
              decoded->version = version;
              decoded->reply = std::move(reply);
              boost::asio::post(workers, [inbox, format, decoded] {
                Decode(format, *decoded);
                const std::lock_guard lock(inbox->mutex);
                inbox->replies.push_back(std::move(*decoded));
              });
            });
}

void Client::TakeReplies(double now_s) {
  std::vector<DecodedReply> replies;
  {
    const std::lock_guard lock(inbox_->mutex);
    replies.swap(inbox_->replies);
  }
  for (DecodedReply& decoded : replies) Take(decoded, now_s);
}

void Client::Take(DecodedReply& decoded, double now_s) {
  if (decoded.tile != nullptr) {
    decoded.tile->in_flight = false;
    --active_;
  }
  if (decoded.resource == Resource::kSubtree && decoded.outcome == Outcome::kOk) {
    const Result<void> taken = tree_->TakeSubtree(*decoded.tile, decoded.text);
    if (!taken) {
      decoded.outcome = Outcome::kDamaged;
      decoded.message = taken.error().message;
      decoded.is_unsupported = taken.error().code == ErrorCode::kNotFound;
    }
  }
  RequestRecord record;
  record.outcome = decoded.outcome;
  record.is_tile = decoded.resource == Resource::kTile;
  record.tier = ParseCacheTier(decoded.reply.server_timing);
  record.seconds = decoded.reply.seconds + (decoded.tile != nullptr ? decoded.tile->attempts.seconds : 0);
  record.bytes = decoded.reply.bytes;
  record.opened_connection = decoded.reply.opened_connection;
  record.triangles = decoded.content.triangles;
  record.is_incomplete = decoded.content.covered >= 0 && std::abs(decoded.content.covered - 1) > 1e-9;
  statistics_.AddRequest(now_s, record);
  if (!decoded.message.empty()) {
    constexpr const char* kNames[] = {"document", "subtree", "tile"};
    statistics_.AddMessage(fmt::format("{}: {}", kNames[static_cast<std::size_t>(decoded.resource)], decoded.message));
  }
  if (decoded.resource == Resource::kDocument) return TakeDocument(decoded, now_s);
  if (decoded.outcome != Outcome::kOk) return FailOrWait(decoded, now_s);
  decoded.tile->attempts = {};
  if (decoded.resource == Resource::kTile) TakeTile(decoded);
}

void Client::TakeDocument(const DecodedReply& decoded, double now_s) {
  is_document_requested_ = false;
  document_due_s_ = now_s + kDocumentPause;
  if (decoded.outcome != Outcome::kOk) {
    const bool asks_again = AsksAgain(decoded, document_attempts_);
    document_due_s_ = now_s + PauseFor(decoded, document_attempts_);
    document_problem_ = decoded.message;
    if (asks_again) {
      wants_document_ = true;
      return statistics_.AddRetry();
    }
    if (tree_) return;
    return GiveUp(fmt::format("{}: {}", options_.document.PublicText(), decoded.message));
  }
  document_attempts_ = {};
  if (tree_) {
    const std::string before = tree_->version();
    if (const Result<void> taken = tree_->TakeDocument(decoded.text); !taken) {
      statistics_.AddMessage(taken.error().message);
    }
    if (tree_->version() == before) return;
    statistics_.AddVersionChange(now_s, before, tree_->version());
    ++version_;
    wants_document_ = false;                          // what raised doubts meanwhile were URLs of the older version
    for (Tile* tile : ready_) tile->is_stale = true;  // drawn until the new one is there
    ForEachTile(tree_->root(), [](Tile& tile) {
      if (tile.state == LoadState::kFailed) tile.state = LoadState::kUnloaded;
    });
    return;
  }
  Result<std::unique_ptr<TileTree>> tree =
      options_.format == Format::kTerrain ? MakeLayerTree(decoded.text) : MakeTilesetTree(decoded.text);
  if (!tree) return GiveUp(fmt::format("{}: {}", options_.document.PublicText(), tree.error().message));
  tree_ = *std::move(tree);
  if (!tree_->note().empty()) statistics_.AddMessage(fmt::format("document: {}", tree_->note()));
  version_ = 1;
  record_.document_s = now_s - start_s_;
  phase_ = Phase::kFirstView;
  statistics_.SetClient(number_, record_);
}

void Client::TakeTile(const DecodedReply& decoded) {
  Tile& tile = *decoded.tile;
  tile_bytes_ -= tile.decoded_bytes;
  tree_->TakeContent(tile, decoded.content);
  tile.decoded_bytes = decoded.content.bytes;
  tile_bytes_ += tile.decoded_bytes;
  tile.version = decoded.version;
  tile.is_stale = decoded.version != version_;
  const std::string& stated = decoded.reply.max_error;
  tile.stated_error_m = -1;
  std::from_chars(stated.data(), stated.data() + stated.size(), tile.stated_error_m);
  if (tile.key) statistics_.AddLoadedTile(*tile.key);
  TakeReady(tile);
  CheckVersion(decoded);
}

void Client::TakeReady(Tile& tile) {
  if (tile.state != LoadState::kReady) ready_.push_back(&tile);
  tile.state = LoadState::kReady;
}

// terrace answers a URL of another version with the current tile and no-store. Such a reply means that the document has
// changed. Errors are no-store too; of them only 404 does. URLs of an older version say nothing about this one.
void Client::CheckVersion(const DecodedReply& decoded) {
  if (tree_->version().empty() || decoded.version != version_) return;
  const bool is_current = decoded.reply.cache_control.find("no-store") == std::string::npos;
  if (decoded.outcome == Outcome::kNotFound || (decoded.outcome == Outcome::kOk && !is_current)) wants_document_ = true;
}

// Counts an attempt without success. Returns whether another one is due: after refusals without limit.
bool Client::AsksAgain(const DecodedReply& decoded, Attempts& attempts) const {
  ++attempts.all;
  if (decoded.outcome == Outcome::kRefused) return true;
  ++attempts.failed;
  const int limit = decoded.outcome == Outcome::kDamaged ? kDamagedAttempts : options_.max_attempts;
  return !decoded.is_unsupported && IsTransient(decoded.reply, decoded.outcome) && attempts.failed < limit;
}

double Client::PauseFor(const DecodedReply& decoded, const Attempts& attempts) const {
  const double pause_s = std::min(kLongestPause, kFirstPause * std::exp2(std::min(attempts.all, 10) - 1));
  const std::optional<double> stated =
      RetryAfterSeconds(decoded.reply.retry_after, decoded.reply.date, std::chrono::system_clock::now());
  const std::uint64_t seed = static_cast<std::uint64_t>(number_) * 1000 + waiting_.size();
  if (stated) return *stated + (Spread(seed) - 0.75);  // never sooner than asked
  return pause_s * Spread(seed);
}

void Client::FailOrWait(const DecodedReply& decoded, double now_s) {
  Tile& tile = *decoded.tile;
  CheckVersion(decoded);
  if (!AsksAgain(decoded, tile.attempts)) {
    tile.attempts = {};  // a later version begins anew
    if (decoded.version == version_) Fail(tile);
    return;
  }
  const double pause_s = PauseFor(decoded, tile.attempts);
  tile.attempts.seconds += decoded.reply.seconds + pause_s;
  tile.waiting = true;
  waiting_.push_back({&tile, now_s + pause_s});
  statistics_.AddRetry();
}

void Client::Fail(Tile& tile) {
  tile.is_stale = false;  // the outdated content stays
  if (tile.state != LoadState::kReady) tile.state = LoadState::kFailed;
}

void Client::WakeWaiting(double now_s) {
  std::erase_if(waiting_, [now_s](const Waiting& waiting) {
    if (waiting.due_s > now_s) return false;
    waiting.tile->waiting = false;
    return true;
  });
}

void Client::StartLoad(Tile& tile, double now_s) {
  if (!tile.NeedsLoad()) return;
  if (tile.content == Content::kUpsampled) {
    if (tile.parent->state == LoadState::kUnloaded) return StartLoad(*tile.parent, now_s);
    tile.state = tile.parent->state;  // a quarter of a tile that has failed is a hole too
    return;
  }
  const NextRequest request = tree_->RequestFor(tile);
  if (request.kind == NextRequest::Kind::kNothing) {
    tile.state = LoadState::kReady;
    return;
  }
  tile.sent_s = now_s;
  SendRequest(request.kind == NextRequest::Kind::kSubtree ? Resource::kSubtree : Resource::kTile, &tile, request);
}

void Client::StartLoads(const Selection& selection, double now_s) {
  for (const LoadTask& task : selection.loads) {
    if (active_ >= options_.max_loads) return;
    StartLoad(*task.tile, now_s);
  }
}

// Unloads the tiles that were not visited for longest. Those that this frame visited stay.
void Client::Unload(std::uint64_t frame) {
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

FrameRecord Client::Describe(const Selection& selection, const View& view) {
  FrameRecord record;
  record.phase = phase_;
  record.is_refined = selection.IsRefined();
  record.is_waiting = !selection.IsSettled();
  record.wanted = selection.loads.size() + selection.pending;
  record.is_loaded = !record.is_waiting && record.wanted == 0;
  record.in_flight = static_cast<std::size_t>(active_);
  std::uint32_t version = 0;
  for (const DrawnTile& drawn : selection.drawn) {
    const Tile& tile = *drawn.tile;
    const bool can_refine = !tile.children.empty() || tile.children_unknown;
    record.drawn += tile.HasMesh() ? 1 : 0;
    if (can_refine) record.worst_px = std::clamp(drawn.error_px, record.worst_px, kWorstPixels);
    if (tile.children_unknown && drawn.error_px >= options_.select.max_error_px) {
      record.is_refined = false;
      record.is_waiting |= tile.state != LoadState::kFailed;
    }
    const Tile& loaded = tile.MeshTile();
    const bool is_of_level_0 = loaded.key && loaded.key->level == 0;
    const bool suffices =
        !is_of_level_0 || can_refine || !tree_->has_finer_levels() || drawn.error_px < options_.select.max_error_px;
    record.sees_data |= tile.HasMesh() && suffices;
    if (tile.state != LoadState::kReady || loaded.version == 0) continue;
    if (loaded.stated_error_m >= 0 && drawn.distance_m > 0) {
      const double px = view.ErrorInPixels(loaded.stated_error_m, drawn.distance_m);
      record.worst_stated_px = std::clamp(px, record.worst_stated_px, kWorstPixels);
    }
    if (version != 0 && loaded.version != version) record.is_mixed = true;
    version = loaded.version;
  }
  if (phase_ == Phase::kFlying && frame_ % kCoveragePeriod == 0) {
    record.coverage = MeasureCoverage(view, frame_, tree_->root());
  }
  return record;
}

double Client::FlownSeconds(double now_s) const {
  const double offset = options_.path.duration_s() * number_ / options_.clients;
  if (phase_ == Phase::kFlying) return offset + now_s - takeoff_s_;
  return phase_ == Phase::kArrived ? offset + options_.duration_s : offset;
}

void Client::Advance(const FrameRecord& record, double now_s) {
  const Phase before = phase_;
  const double first_view_s = record_.first_view_s;
  AdvancePhase(record, now_s);
  if (phase_ != before || record_.first_view_s != first_view_s) statistics_.SetClient(number_, record_);
}

void Client::AdvancePhase(const FrameRecord& record, double now_s) {
  // A view that comes later than the take-off still counts as one.
  if (record.is_refined && record_.first_view_s < 0) record_.first_view_s = now_s - start_s_;
  // A tile that has failed does not hold up the flight.
  if (phase_ == Phase::kFirstView && (!record.is_waiting || now_s - start_s_ > options_.first_view_limit_s)) {
    phase_ = Phase::kFlying;
    takeoff_s_ = now_s;
  }
  if (phase_ == Phase::kFlying && now_s - takeoff_s_ >= options_.duration_s) {
    phase_ = Phase::kArrived;
    landing_s_ = now_s;
    return;  // the next frame is the first one from the final position
  }
  if (phase_ == Phase::kArrived) {
    if (record.is_refined && record_.arrival_s < 0) record_.arrival_s = now_s - landing_s_;
    if (record.is_loaded || now_s - landing_s_ > options_.arrival_limit_s) phase_ = Phase::kDone;
  }
}

void Client::GiveUp(const std::string& why) {
  record_.failure = why;
  phase_ = Phase::kDone;
  statistics_.SetClient(number_, record_);
}

void Client::Frame(double now_s, bool is_late) {
  if (start_s_ < 0) start_s_ = now_s;
  last_frame_s_ = now_s;
  TakeReplies(now_s);
  if (phase_ == Phase::kDone) return;
  if (!tree_ && now_s - start_s_ > options_.first_view_limit_s) {
    const std::string& problem = document_problem_;
    return GiveUp(fmt::format("{}: no document within {} s{}{}", options_.document.PublicText(),
                              options_.first_view_limit_s, problem.empty() ? "" : "; ", problem));
  }
  if (wants_document_ && !is_document_requested_ && now_s >= document_due_s_) {
    wants_document_ = false;
    is_document_requested_ = true;
    SendRequest(Resource::kDocument, nullptr, {});
  }
  if (!tree_) return;
  WakeWaiting(now_s);
  const Pose pose = options_.path.PoseAt(FlownSeconds(now_s));
  const View view(pose, options_.lens);
  Selection selection;
  ++frame_;
  SelectTiles(
      options_.select, view, [this](Tile& tile) { tree_->AddChildren(tile); }, frame_, tree_->root(), selection);
  FrameRecord record = Describe(selection, view);
  record.is_late = is_late;
  StartLoads(selection, now_s);
  Unload(frame_);
  statistics_.AddFrame(now_s, record);
  if (number_ == 0 && frame_ % kTrackPeriod == 1) statistics_.AddCamera(pose.position);
  Advance(record, now_s);
}

void Client::Finish() {
  if (!tree_) return;
  ForEachTile(tree_->root(), [this](const Tile& tile) {
    if (tile.content != Content::kMesh) return;
    if (tile.state == LoadState::kFailed) return statistics_.AddFailedTile();
    if (!tile.in_flight && tile.attempts.all == 0) return;
    statistics_.AddOpenTile(tile.attempts.seconds + (tile.in_flight ? last_frame_s_ - tile.sent_s : 0));
  });
}

}  // namespace terrace::fly
