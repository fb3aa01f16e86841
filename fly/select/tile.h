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
  kStructure,  // never drawn: the root, and the parent of the root of an implicit tree
};

enum class LoadState { kUnloaded, kReady, kFailed };

// What selection decided about a tile in one frame. A kicked tile was selected, but an ancestor is drawn instead.
enum class Verdict { kNone, kCulled, kRendered, kRefined, kKickedRendered, kKickedRefined };

struct Visit {
  std::uint64_t frame = 0;  // 0: never
  Verdict verdict = Verdict::kNone;
};

struct ImplicitTree;

// Requests since the last success.
struct Attempts {
  int all = 0;
  int failed = 0;      // without refusals
  double seconds = 0;  // that they and the pauses after them took
};

struct Tile {
  Tile* parent = nullptr;
  std::vector<std::unique_ptr<Tile>> children;
  bool children_unknown = false;  // the tree could not decide on them yet, as where a subtree is missing

  Volume volume;
  double geometric_error_m = 0;
  std::optional<geo::TileKey> key;  // in the quadtree of EPSG:4326, where the volume is one of its rectangles

  Content content = Content::kMesh;
  std::string uri;  // of an explicit tile of a tileset, relative to the document
  std::shared_ptr<ImplicitTree> tree;
  geo::TileKey local;  // inside `tree`: level 0 is its root

  // Its children are always visited instead of it. True for structure, and for empty tiles whose error is not below the
  // parent's.
  bool always_refine = false;

  LoadState state = LoadState::kUnloaded;
  bool in_flight = false;  // a request for it runs
  double sent_s = 0;       // when it was sent, seconds since the start
  bool waiting = false;    // a request for it failed, and will be repeated after a pause
  bool is_stale = false;   // loaded, but from an older version of the dataset
  Attempts attempts;

  double stated_error_m = -1;  // the reply's Terrain-Max-Error; -1: not stated
  std::uint64_t decoded_bytes = 0;
  std::uint32_t version = 0;  // of the document that it was loaded by: 1, 2, ..; 0: none

  std::array<Visit, 2> visits;  // of this frame and of the one before

  // The tile whose mesh is drawn for it.
  const Tile& MeshTile() const { return content == Content::kUpsampled ? *parent : *this; }
  bool HasMesh() const { return MeshTile().content == Content::kMesh; }
  bool NeedsLoad() const { return !in_flight && !waiting && (state == LoadState::kUnloaded || is_stale); }
  bool IsPending() const { return in_flight || waiting; }
  // Whether drawing it leaves no hole that a reply could fill. A tile that has failed is drawn as nothing.
  bool IsRenderable() const {
    if (state == LoadState::kFailed) return true;
    return state == LoadState::kReady && (!always_refine || children.empty());
  }
};

// The verdict of the frame before `frame`; kNone if the tile was not visited in it.
Verdict PreviousVerdict(const Tile& tile, std::uint64_t frame);

}  // namespace terrace::fly
