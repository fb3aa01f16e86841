// A node of the tree of tiles that a client knows: what the server offers, how much of it is loaded, and what
// selection decided in the last two frames.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/geo/tile_key.h"
#include "fly/scene/volume.h"

namespace terrace::fly {

enum class Content {
  kMesh,       // has a URL
  kUpsampled,  // a quarter of the parent's mesh, made by the client where the server has only some of four children
  kEmpty,      // nothing to draw here
  kStructure,  // never drawn itself: the root, the place of an implicit tree
};

enum class LoadState { kUnloaded, kReady, kFailed };

// What selection decided about a tile in one frame. A kicked tile was selected, but an ancestor is drawn instead.
enum class Verdict { kNone, kCulled, kRendered, kRefined, kKickedRendered, kKickedRefined };

struct Visit {
  std::uint64_t frame = 0;  // 0: never
  Verdict verdict = Verdict::kNone;
};

struct ImplicitTree;

struct Tile {
  Tile* parent = nullptr;
  std::vector<std::unique_ptr<Tile>> children;
  bool may_have_more_children = false;  // unknown until something has been loaded

  Volume volume;
  double geometric_error_m = 0;
  std::optional<geo::TileKey> key;  // in the quadtree of EPSG:4326, where the volume is one of its rectangles

  Content content = Content::kMesh;
  std::string uri;  // of an explicit tile of a tileset, relative to the document
  std::shared_ptr<ImplicitTree> tree;
  geo::TileKey local;  // inside `tree`: level 0 is its root

  // Its children are always visited instead of it. Structure is, and empty tiles whose error is not below the parent's.
  bool always_refine = false;

  LoadState state = LoadState::kUnloaded;
  bool in_flight = false;  // a request for it runs
  bool waiting = false;    // for the time that a Retry-After named
  bool is_stale = false;   // loaded, but from an older version of the dataset
  int attempts = 0;        // failed ones since it was wanted

  double stated_error_m = -1;  // of the reply's Terrain-Max-Error; -1: not stated
  std::uint32_t triangles = 0;
  std::uint64_t decoded_bytes = 0;
  std::uint32_t version = 0;  // index of the version that it was loaded from

  std::array<Visit, 2> visits;  // of this frame and of the one before

  bool NeedsLoad() const { return !in_flight && !waiting && (state == LoadState::kUnloaded || is_stale); }
  bool IsPending() const { return in_flight || waiting; }
  // Drawing it leaves no hole that waiting could close. A tile that failed for good is drawn as nothing.
  bool IsRenderable() const {
    if (state == LoadState::kFailed) return true;
    return state == LoadState::kReady && (!always_refine || children.empty());
  }
};

// The verdict of the frame before `frame`; kNone if the tile was not visited in it.
Verdict PreviousVerdict(const Tile& tile, std::uint64_t frame);

}  // namespace terrace::fly
