// All URLs of the server: the table of rows (RouteRow, server/api/route.h), the row for a request target, and what the
// target names. Pure; knows no dataset.
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
#include "server/openapi/openapi_document.h"

namespace terrace::server {

// The decoded segments of a path. An encoded '/' does not separate segments.
class Segments {
 public:
  // Returns nothing if percent-encoding is malformed. `path` must outlive the segments.
  static std::optional<Segments> Of(std::string_view path);

  std::size_t size() const { return pieces_.size(); }
  std::string_view operator[](std::size_t i) const { return pieces_[i]; }

 private:
  std::vector<std::string_view> pieces_;
  std::forward_list<std::string> decoded_;  // decoded copies, where needed; a list: they must not move
};

// Immutable.
class RouteTable {
 public:
  // `rows` must outlive this object. The first row that matches is used.
  explicit RouteTable(std::span<const RouteRow> rows);

  // `target` in origin form ("/maui/0/0/0.terrain?error=5") or absolute form ("http://host/...").
  // kInvalidArgument: neither form, a '#', malformed percent-encoding in the path, or percent-encoding in the name of a
  // parameter (except of rows with takes_any_query).
  // kNotFound: not a URL of the server. A tile number that is not a plain decimal number, or that is outside the tiling
  // scheme, names no tile.
  Result<Route> Match(std::string_view target) const;

  // True for the first segments of URLs that do not begin with a dataset. No dataset may have such a name.
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

const RouteTable& Routes();

// For /openapi.json: one URL for each row; rows of tiles have one for each format of their folder.
std::vector<DocumentedUrl> DocumentedUrls();

}  // namespace terrace::server
