// The tree of tiles that a layer.json or tileset.json describes. It grows while the client flies. Not thread-safe.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "fly/content/tile_content.h"
#include "fly/select/tile.h"

namespace terrace::fly {

enum class Format { kTerrain, k3dTiles };

// What to request next for a tile that needs loading.
struct NextRequest {
  enum class Kind { kNothing, kMesh, kSubtree };
  Kind kind = Kind::kNothing;   // kNothing: the tile is ready without a request
  std::string uri;              // relative to the document
  bool inherits_query = false;  // the document's parameters that the URI lacks belong to it, as in cesium-native
};

class TileTree {
 public:
  virtual ~TileTree() = default;

  Tile& root() { return root_; }
  const std::string& version() const { return version_; }  // empty: the document states none
  // How the flight differs from that of cesium-native because of the document, for the report; empty: not at all.
  const std::string& note() const { return note_; }

  // Whether the document offers tiles deeper than level 0 of the quadtree of EPSG:4326.
  bool has_finer_levels() const { return has_finer_levels_; }

  // Adds the children of a tile that is visited, as far as they are known by now.
  virtual void AddChildren(Tile& tile) = 0;

  virtual NextRequest RequestFor(const Tile& tile) const = 0;

  // Takes the reply to a request of kind kSubtree. kInvalidArgument if it is damaged, kNotFound if fly has
  // no reader for its form.
  virtual Result<void> TakeSubtree(Tile& tile, std::string_view bytes) = 0;

  // Takes what the tile's content says about its volume.
  virtual void TakeContent(Tile& tile, const TileContent& content) = 0;

  // Takes a later version of the document: its version and URLs. Known tiles stay.
  virtual Result<void> TakeDocument(std::string_view json) = 0;

 protected:
  TileTree() = default;

  // Replaces all occurrences of `name`, a variable of a template for URIs.
  static void Replace(std::string& text, std::string_view name, const std::string& value) {
    for (std::size_t at = text.find(name); at != std::string::npos; at = text.find(name, at + value.size())) {
      text.replace(at, name.size(), value);
    }
  }

  Tile root_;
  std::string version_, note_;
  bool has_finer_levels_ = false;
};

// kInvalidArgument if the text is no such document; the message says what is missing.
Result<std::unique_ptr<TileTree>> MakeLayerTree(std::string_view layer_json);
Result<std::unique_ptr<TileTree>> MakeTilesetTree(std::string_view tileset_json);

}  // namespace terrace::fly
