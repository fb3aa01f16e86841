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
  // `cache_control`: of subtrees that are asked for without a version.
  TilesetHandler(std::span<const DatasetView> datasets, std::string cache_control);

  // `?error=E` and `?fraction=F` go into the templates.
  Described Handle(const Call& call) const;

  // Any available tile may be the root, so that a tileset.json which a client has kept
  // from an earlier day stays good. The requested error decides how deep skirts hang, and so the heights in
  // it. 404 where no subtree begins.
  Described HandleSubtree(const Call& call) const;

 private:
  const std::span<const DatasetView> datasets_;
  const std::string cache_control_;
  // One per dataset: where its trees are rooted, and what is served where no error is requested.
  std::vector<std::shared_ptr<const std::vector<proto::TreeRoot>>> roots_;
  std::vector<Document> plain_;
};

}  // namespace terrace::server
