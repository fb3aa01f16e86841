// GET /{dataset}/tileset.json and the .subtree files under it.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "proto/documents/implicit_tree.h"
#include "server/api/call.h"
#include "server/documents/document.h"
#include "server/documents/document_maker.h"
#include "server/query/query.h"
#include "server/tiles/dataset_view.h"

namespace terrace::server {

// Thread-safe: immutable after construction.
class TilesetHandler {
 public:
  // `datasets` must outlive this.
  // `cache_control`: for requests of subtrees without a version.
  TilesetHandler(std::span<const DatasetView> datasets, std::string cache_control);

  // `?error=E` and `?fraction=F` go into the templates.
  Described Handle(const Call& call) const;

  // Any available tile may be the root, so that an older tileset.json that a client has cached stays valid. The heights
  // in a subtree depend on the requested error, because skirts do. 404: no subtree begins at this tile.
  Described HandleSubtree(const Call& call) const;

 private:
  const std::span<const DatasetView> datasets_;
  const std::string cache_control_;
  // One per dataset: the roots of its trees, and the document for requests without an error.
  std::vector<std::shared_ptr<const std::vector<proto::TreeRoot>>> roots_;
  std::vector<Document> plain_;
};

}  // namespace terrace::server
