// The row of the URL table that a request matches, and what its URL names. server/routes.cc has the table.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "engine/geo/tile_key.h"
#include "server/http/application.h"

namespace terrace::server {

struct RequestContext;  // request_context.h
struct RouteRow;
struct HandlerState;   // server/handlers/handlers.h
class Segments;        // server/routes.h
struct TileFormatRow;  // tile_formats.h
struct Operation;      // server/openapi/operation.h

struct Route {
  const RouteRow* row = nullptr;  // null: not a URL of the server
  std::string dataset;            // the first segment of the URL, decoded, if it is a dataset
  geo::TileKey key;               // of tiles and subtrees: valid in the tiling scheme of the format
  geo::TileKey root;              // of subtrees and implicit tiles: root of the URL's tree, an ancestor of `key`
  int subtree_levels = 0;         // of subtrees: 1 .. proto::kMaxServedSubtreeLevels
  const TileFormatRow* format = nullptr;  // of tiles: by the suffix
  std::string file;                       // of the viewer: relative to its folder, decoded: "index.html" for "/"
  std::string query;                      // without '?', not decoded
};

// What a reply reveals. Decides which grant the request needs.
enum class DatasetScope : std::uint8_t {
  kNothing,          // nothing about datasets: pages and probes
  kVisibleDatasets,  // those that the client may see
  kOneDataset,       // the URL's
  kAllDatasets,
};

// A row of the table.
struct RouteRow {
  std::string_view label;    // in logs and metrics
  std::string_view pattern;  // "/{dataset}/layer.json": '{' in a segment matches any; "..." at the end: one or more
  Answer (*handle)(const HandlerState& state, const RequestContext& context);
  // What /openapi.json says about the URL. Null if the pattern ends in {suffix}: TileFormatRow::operation has it.
  const Operation* operation = nullptr;
  // Reads what the URL names besides its dataset. Returns false if the URL names nothing. Null: nothing to read.
  bool (*read)(const Segments& segments, Route& route) = nullptr;
  DatasetScope scope = DatasetScope::kOneDataset;
  bool is_probe = false;          // a health check: exempt from rate limits
  bool needs_no_catalog = false;  // answered without a catalog
  bool has_templates = false;     // the reply contains URL templates, which repeat the token if it came in the query
  bool takes_any_query = false;   // the query is state of the page; the server ignores it
  // Limit of a POST's body, from the number of locations that one request may have. Null: POST is not supported.
  std::size_t (*max_body_bytes)(std::size_t max_locations) = nullptr;

  bool takes_post() const { return max_body_bytes != nullptr; }
};

}  // namespace terrace::server
