// Which tiles a client draws and loads for one frame, as cesium-native v0.62 selects them
// (Cesium3DTilesSelection/src/TilesetSelection.cpp) for tiles that replace their parents.
//
// A tile is refined while its geometric error takes more than `max_error_px` pixels on the screen at its distance. The
// visible children are drawn once all of them are loaded. Until then an ancestor is drawn, and the selected descendants
// are "kicked" (cesium-native's word). If one of them was drawn in the previous frame, they are not kicked: they are
// drawn as they are loaded, and those that are missing are holes. With `forbid_holes`, culled siblings must be loaded
// too before any of the four children is drawn.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "fly/scene/view.h"
#include "fly/select/tile.h"

namespace terrace::fly {

struct SelectOptions {
  double max_error_px = 16;
  double culled_error_px = 64;  // limit for tiles that are visited although they are culled, such as the root
  bool forbid_holes = false;
};

enum class LoadGroup { kPreload, kNormal, kUrgent };

struct LoadTask {
  Tile* tile = nullptr;
  LoadGroup group = LoadGroup::kNormal;
  double priority = 0;  // distance in metres * (1 - cosine of the angle to the view's axis); smaller is more urgent
};

struct DrawnTile {
  Tile* tile = nullptr;
  double error_px = 0;    // of its geometric error
  double distance_m = 0;  // to its volume
};

struct Selection {
  std::vector<DrawnTile> drawn;  // also tiles that are not loaded: they are holes
  std::vector<LoadTask> loads;   // most urgent first
  std::uint32_t pending = 0;     // wanted tiles whose load has begun
  bool any_kicked = false;

  // Whether the picture is complete: nothing was kicked, everything drawn is loaded, and some of it is terrain.
  bool IsRefined() const;
  // Whether nothing in the picture waits for a tile: it is complete but for tiles that have failed.
  bool IsSettled() const;
};

// Selects from `root` and its descendants, and records the verdicts in them. `frame` increases by one from call to
// call, starting at 1. `update` is called for each visited tile before it is judged; it may add children to the tile.
void SelectTiles(const SelectOptions& options, const View& view, const std::function<void(Tile&)>& update,
                 std::uint64_t frame, Tile& root, Selection& selection);

}  // namespace terrace::fly
