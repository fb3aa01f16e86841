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
  std::vector<Document> plain_;  // one per dataset: what is served where no error is requested
};

// What the tile template carries for a requested error: "error=5&atleast=1", "fraction=0.25" or nothing. Numbers are
// printed anew, shortest form, and without '+', which CesiumJS would turn into a space.
std::string TileQuery(const RequestedError& requested);

// The query of a template, with the request's token where that came in a query: clients that send it so send templates
// as they are.
std::string WithToken(std::string query, const Call& call);

// Stands for that token where it must not be kept itself: there is one grant of each, for as long as the server runs.
// Null: WithToken adds none.
const Grant* GrantInQuery(const Call& call);

}  // namespace terrace::server
