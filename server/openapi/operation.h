// What /openapi.json says about one kind of URL. Each row of the table of URLs (server/routes.cc) and each tile format
// (server/api/tile_formats.cc) names its operation. Views of literals.
#pragma once

#include <string_view>
#include <vector>

namespace terrace::server {

// A parameter of the query, besides `v` and `token`, which every URL has.
struct ParameterNote {
  std::string_view name;
  std::string_view meaning;
  std::string_view schema;  // JSON Schema 2020-12 of the value, as JSON
  bool is_required = false;
};

// A media type of a reply or of a POST's body.
struct MediaNote {
  std::string_view type;         // "application/json"
  std::string_view schema = {};  // name of a row of kSchemas; empty: bytes
  bool is_of_post = false;       // a GET does not return it
};

// A request that gets 200 from a server of config/samples. A test sends each one.
struct ExampleRequest {
  std::string_view target;          // "/jacksboro/layer.json?error=5"
  std::string_view body_type = {};  // media type; empty: a GET
  std::string_view body = {};       // of application/octet-stream in Base64
};

struct Operation {
  std::string_view id;  // "getHeights"; that of a POST ends with "ByPost"
  std::string_view tag;
  std::string_view summary;      // one sentence without a full stop
  std::string_view description;  // Markdown
  std::vector<ParameterNote> parameters = {};
  std::vector<MediaNote> replies = {};      // of 200
  std::vector<MediaNote> unavailable = {};  // of 503, besides application/problem+json
  std::vector<std::string_view> headers = {};
  std::vector<ExampleRequest> examples = {};
};

}  // namespace terrace::server
