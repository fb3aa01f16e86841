// One client: its tree of tiles, what it loads, and what it sees in each frame.
#pragma once

#include <boost/asio/thread_pool.hpp>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "fly/flight/flight.h"

namespace terrace::fly {

class Client {
 public:
  // `number` counts from 0. The references must outlive the client. Requests may end after it: their callbacks share
  // ownership of what they use.
  Client(const FlightOptions& options, int number, HttpClient& http, boost::asio::thread_pool& workers,
         Statistics& statistics);

  // Draws a frame at `now_s` seconds since the start of all clients. `is_late`: the frame started more than one frame
  // period after its due time. One thread at a time.
  void Frame(double now_s, bool is_late);

  // Counts the tiles that were requested and have not arrived until the last frame. Call it once, after that frame.
  void Finish();

  Phase phase() const { return phase_; }

 private:
  enum class Resource { kDocument, kSubtree, kTile };

  // Made on a worker.
  struct DecodedReply {
    Resource resource = Resource::kTile;
    Tile* tile = nullptr;
    std::uint32_t version = 0;
    HttpReply reply;
    Outcome outcome = Outcome::kOk;
    TileContent content;
    std::string text;             // of a document or subtree
    std::string message;          // what is wrong with it
    bool is_unsupported = false;  // fly has no reader for its form
  };
  struct Inbox {
    std::mutex mutex;
    std::vector<DecodedReply> replies;
  };
  struct Waiting {
    Tile* tile;
    double due_s;
  };

  void SendRequest(Resource resource, Tile* tile, const NextRequest& request);
  static void Decode(Format format, DecodedReply& decoded);
  static Outcome OutcomeOf(const HttpReply& reply);
  void TakeReplies(double now_s);
  void Take(DecodedReply& decoded, double now_s);
  void TakeDocument(const DecodedReply& decoded, double now_s);
  void TakeTile(const DecodedReply& decoded);
  void TakeReady(Tile& tile);
  void FailOrWait(const DecodedReply& decoded, double now_s);
  static void Fail(Tile& tile);
  bool AsksAgain(const DecodedReply& decoded, Attempts& attempts) const;
  double PauseFor(const DecodedReply& decoded, const Attempts& attempts) const;
  void CheckVersion(const DecodedReply& decoded);
  void WakeWaiting(double now_s);
  void StartLoads(const Selection& selection, double now_s);
  void StartLoad(Tile& tile, double now_s);
  void Unload(std::uint64_t frame);
  FrameRecord Describe(const Selection& selection, const View& view);
  void Advance(const FrameRecord& record, double now_s);
  void AdvancePhase(const FrameRecord& record, double now_s);
  void GiveUp(const std::string& why);
  double FlownSeconds(double now_s) const;

  const FlightOptions& options_;
  const int number_;
  HttpClient& http_;
  boost::asio::thread_pool& workers_;
  Statistics& statistics_;
  const std::shared_ptr<Inbox> inbox_ = std::make_shared<Inbox>();

  Phase phase_ = Phase::kOpening;
  ClientRecord record_;
  double start_s_ = -1, takeoff_s_ = 0, landing_s_ = 0, last_frame_s_ = 0;
  bool wants_document_ = true;  // has none, or the dataset may have changed
  bool is_document_requested_ = false;
  double document_due_s_ = 0;
  Attempts document_attempts_;
  std::string document_problem_;  // of the last attempt

  std::unique_ptr<TileTree> tree_;
  std::uint32_t version_ = 0;  // of the document: 1, 2, ..
  std::uint64_t frame_ = 0;
  int active_ = 0;  // requests of tiles and subtrees
  std::vector<Waiting> waiting_;
  std::vector<Tile*> ready_;  // loaded, with content
  std::uint64_t tile_bytes_ = 0;
};

}  // namespace terrace::fly
