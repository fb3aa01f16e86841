// GET /{dataset}/tileset.json and the .subtree files under it.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "server/handlers/document.h"
#include "server/http/query.h"
#include "server/http/router.h"
#include "server/tiles/dataset_view.h"

namespace terrace::server {

// Thread-safe: immutable after construction. Subtrees are made anew for each request, which takes less than looking
// after a cache of them would save.
class TilesetHandler {
 public:
  // `datasets` must outlive this.
  TilesetHandler(std::span<const DatasetView> datasets, std::string cache_control);

  // Precondition: a kTileset route. `?error=E` and `?fraction=F` go into the content templates.
  Response Handle(const Route& route, const Request& request) const;

  // Precondition: a kSubtree route. Any available tile may be the root, so that a tileset.json which a client has kept
  // from an earlier day stays good. 404 where no subtree begins.
  Response HandleSubtree(const Route& route, const Request& request) const;

 private:
  const std::span<const DatasetView> datasets_;
  const std::string cache_control_;
  std::vector<Document> plain_;  // one per dataset: what is served without a wish
};

}  // namespace terrace::server
