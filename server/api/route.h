// The rows of the URL table (server/routes.cc), and what one request's URL names.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "engine/geo/tile_key.h"
#include "server/api/tile_formats.h"
#include "server/http/application.h"

namespace terrace::server {

struct Call;
struct Handlers;  // server/routes.h
class Segments;   // server/api/router.h
struct RouteRow;

struct Route {
  const RouteRow* row = nullptr;       // null: not a URL of the server
  std::string dataset;                 // the first segment of the URL, decoded, if it is a dataset
  geo::TileKey key;                    // of tiles and subtrees: valid in the tiling scheme of the format
  geo::TileKey root;                   // of subtrees: root of the tree that the URL counts from, an ancestor of `key`
  int subtree_levels = 0;              // of subtrees: 1 .. proto::kTallestSubtree
  const TileFormat* format = nullptr;  // of tiles: by the suffix
  std::string file;                    // of the viewer: relative to its folder, decoded: "index.html" for "/"
  std::string query;                   // without '?', not decoded
};

// What a reply reveals. Decides which grant the request needs.
enum class Shows : std::uint8_t {
  kNothing,       // nothing about datasets: pages and probes
  kSeenDatasets,  // those that the client may see
  kOneDataset,    // the URL's
  kAllDatasets,
};

struct RouteRow {
  std::string_view label;    // in logs and metrics
  std::string_view pattern;  // "/{dataset}/layer.json": '{' in a segment matches any; "..." at the end: one or more
  Answer (*handle)(const Handlers& handlers, const Call& call);
  // Reads what the URL names besides its dataset. Returns false if the URL names nothing. Null: nothing to read.
  bool (*read)(const Segments& segments, Route& route) = nullptr;
  Shows shows = Shows::kOneDataset;
  bool is_probe = false;         // a health check: exempt from rate limits
  bool is_of_process = false;    // answered without a catalog
  bool has_templates = false;    // the reply contains the token of the request's query
  bool takes_any_query = false;  // the query is state of the page; the server ignores it
  // Limit of a POST's body, from the number of locations that one request may have. Null: POST is not supported.
  std::size_t (*max_body_bytes)(std::size_t max_locations) = nullptr;

  bool takes_post() const { return max_body_bytes != nullptr; }
};

}  // namespace terrace::server
