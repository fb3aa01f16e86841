// GET /{dataset}/layer.json
#pragma once

#include <span>
#include <string>
#include <vector>

#include "server/api/call.h"
#include "server/documents/document.h"
#include "server/documents/document_maker.h"
#include "server/query/query.h"
#include "server/tiles/dataset_view.h"

namespace terrace::server {

class LayerHandler {
 public:
  // `datasets` must outlive this.
  explicit LayerHandler(std::span<const DatasetView> datasets);

  // Precondition: a route of layer.json. `?error=E` and `?fraction=F` go into the tile template.
  Described Handle(const Call& call) const;

 private:
  const std::span<const DatasetView> datasets_;
  std::vector<Document> plain_;  // one per dataset, for requests without an error
};

// The query of the tile template for a requested error: "error=5&atleast=1", "fraction=0.25" or empty. Numbers are
// printed in their shortest form and without '+', which CesiumJS would convert to a space.
std::string TileQuery(const RequestedError& requested);

// Adds the request's token to the query of a template if the token came in the query: such clients use templates
// unchanged.
std::string WithToken(std::string query, const Call& call);

// Identifies that token in cache keys, which must not contain the token itself: each token has one Grant as long as the
// server runs. Null: WithToken adds none.
const Grant* GrantInQuery(const Call& call);

}  // namespace terrace::server
