// The rows of the table of all URLs (server/routes.cc), and what the URL of one request names.
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
  const RouteRow* row = nullptr;       // null: no URL of the server
  std::string dataset;                 // where the URL begins with one: decoded
  geo::TileKey key;                    // of tiles and subtrees: inside the tiling scheme of its format
  geo::TileKey root;                   // of subtrees: of the tree the URL counts in, an ancestor of `key`
  int subtree_levels = 0;              // of subtrees: 1 .. proto::kTallestSubtree
  const TileFormat* format = nullptr;  // of tiles: by the suffix
  std::string file;                    // of the viewer: relative to its folder, decoded: "index.html" for "/"
  std::string query;                   // without '?', not decoded
};

// What a reply shows, and so what a grant is asked for.
enum class Shows : std::uint8_t {
  kNothing,       // of a dataset: pages and probes
  kSeenDatasets,  // those that its reader may see
  kOneDataset,    // the URL's
  kAllDatasets,
};

struct RouteRow {
  std::string_view label;    // in logs and metrics
  std::string_view pattern;  // "/{dataset}/layer.json": a segment with '{' is any; "..." at the end: one or more
  Answer (*handle)(const Handlers& handlers, const Call& call);
  // Takes from the URL what is more than its dataset. False: it names nothing. Null: there is no more.
  bool (*read)(const Segments& segments, Route& route) = nullptr;
  Shows shows = Shows::kOneDataset;
  bool is_probe = false;         // of machines that must never be told to wait
  bool is_of_process = false;    // answered without a catalog
  bool has_templates = false;    // the reply has the token of its query in it
  bool takes_any_query = false;  // pages keep their state there, which is nothing to the server
  // Of a POST's body, by the number of locations that one request may name. Null: POST is not answered.
  std::size_t (*max_body_bytes)(std::size_t max_locations) = nullptr;

  bool takes_post() const { return max_body_bytes != nullptr; }
};

}  // namespace terrace::server
