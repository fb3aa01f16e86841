// GET /{dataset}/tiles.json
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "server/api/call.h"
#include "server/http/request.h"
#include "server/http/response.h"
#include "server/tiles/dataset_view.h"

namespace terrace::server {

class TileJsonHandler {
 public:
  // `datasets` must outlive this.
  // `origin_headers`: as in HandlerOptions.
  TileJsonHandler(std::span<const DatasetView> datasets, std::string_view origin_headers);

  // Precondition: a route of tiles.json. `?encoding` and `?size` go into the tile template.
  Response Handle(const Call& call) const;

 private:
  const std::span<const DatasetView> datasets_;
  const std::string_view origin_headers_;
};

// "http://host:port" under which the client addressed this server or the proxy in front of it; empty without a Host
// header.
std::string OriginOf(const Request& request);

}  // namespace terrace::server
