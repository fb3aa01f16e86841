// From a request target to its row in the table of URLs, and what it names. Pure; knows no dataset.
#pragma once

#include <cstddef>
#include <forward_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "server/api/route.h"

namespace terrace::server {

// The decoded segments of a path; an encoded '/' does not separate.
class Segments {
 public:
  // Nothing: malformed percent-encoding. `path` has to outlive the segments.
  static std::optional<Segments> Of(std::string_view path);

  std::size_t size() const { return pieces_.size(); }
  std::string_view operator[](std::size_t i) const { return pieces_[i]; }

 private:
  std::vector<std::string_view> pieces_;
  std::forward_list<std::string> decoded_;  // of pieces that had to be; their places do not change
};

// Immutable.
class RouteTable {
 public:
  // `rows` must outlive this; of two that fit, the first counts.
  explicit RouteTable(std::span<const RouteRow> rows);

  // `target` in origin form ("/maui/0/0/0.terrain?error=5") or absolute form ("http://host/...").
  // kInvalidArgument: neither form, malformed percent-encoding, or a parameter whose name has any. kNotFound: no such
  // URL; tile numbers that are not plain decimal numbers, or lie outside the tiling scheme, name no tile.
  Result<Route> Match(std::string_view target) const;

  // True for the first segments of URLs that begin with no dataset. No dataset may have such a name.
  bool IsReserved(std::string_view name) const;

 private:
  struct Entry {
    const RouteRow* row;
    std::vector<std::string_view> pattern;  // segments; an empty one is any
    bool has_rest = false;                  // more segments may follow
  };

  static bool Fits(const Entry& entry, const Segments& segments);

  std::vector<Entry> entries_;
};

// What rows read: /{dataset}/{z}/{x}/{y}.terrain, .glb and so on;
// /{dataset}/3dtiles/{root}/{level}/{x}/{y}.glb and .{levels}.subtree, counted from the root; and the viewer's files.
bool ReadTile(const Segments& segments, Route& route);
bool ReadImplicitTile(const Segments& segments, Route& route);
bool ReadSubtree(const Segments& segments, Route& route);
bool ReadViewerFile(const Segments& segments, Route& route);

}  // namespace terrace::server
