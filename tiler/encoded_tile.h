// A finished tile, ready to leave: immutable and shared between the cache and every response that sends it.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

namespace terrace::tiler {

// Where the time of a build went. Zero where a step did not run.
struct StageTimes {
  std::chrono::microseconds queue{0};  // before a worker took it up
  std::chrono::microseconds read{0}, refine{0}, encode{0}, compress{0};
};

inline std::chrono::microseconds MicrosecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::steady_clock::now() - start);
}

// What a build found of its tile's refinement; kNone where the format has no mesh.
enum class RefinementUse : std::uint8_t { kMade, kContinued, kReplayed, kNone };

// Lines of a reply's head, each with its CR LF, that depend on the body alone: neither on who asks nor on the
// configuration.
struct HeadLines {
  std::string text;
  std::size_t of_body = 0;  // so many bytes at its front describe the body: a reply without one leaves them away
};

struct EncodedTile {
  std::string bytes;       // the body in its content coding
  std::string etag;        // strong, with the quotes
  double max_error_m = 0;  // measured on the encoded integers: the Terrain-Max-Error header
  // Metres, at least the distance from every sample of the sources: the Terrain-Certified-Error header. Nothing where
  // the format has no surface.
  std::optional<double> certified_error_m = {};
  std::uint32_t vertices = 0;
  std::uint32_t triangles = 0;
  StageTimes times;  // of the build that made it
  RefinementUse refinement = RefinementUse::kMade;
  bool from_disk = false;  // read from the disk tier, not built
  HeadLines head;          // see MakeTileHead
};

inline std::size_t BytesOf(const EncodedTile& tile) { return tile.bytes.size() + tile.head.text.size(); }

using TilePtr = std::shared_ptr<const EncodedTile>;

}  // namespace terrace::tiler
