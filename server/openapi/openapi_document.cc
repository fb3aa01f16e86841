#include "server/openapi/openapi_document.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/openapi/schemas.h"

namespace terrace::server {
namespace {

using Json = nlohmann::ordered_json;

Json Parsed(std::string_view text) { return Json::parse(text); }

Json RefTo(std::string_view kind, std::string_view name) {
  return {{"$ref", "#/components/" + std::string(kind) + "/" + std::string(name)}};
}

// A status besides 200: when it is sent, and by which operations.
struct StatusNote {
  int status;
  std::string_view name;  // among the components
  std::string_view when;
  std::string_view header;  // that every such reply has; empty: none
  bool (*applies)(const DocumentedUrl& url, bool is_post);
};

constexpr bool Always(const DocumentedUrl&, bool) { return true; }
constexpr bool IfPost(const DocumentedUrl&, bool is_post) { return is_post; }
constexpr bool IfGranted(const DocumentedUrl& url, bool) { return url.needs_grant; }
bool IfNamed(const DocumentedUrl& url, bool) { return url.pattern.find('{') != std::string::npos; }
bool IfTagged(const DocumentedUrl& url, bool is_post) {
  return !is_post && url.operation != nullptr && std::ranges::count(url.operation->headers, "ETag") > 0;
}

constexpr StatusNote kStatuses[] = {
    {304, "NotModified", "`If-None-Match` matches", "ETag", IfTagged},
    {400, "BadRequest", "A wrong parameter, or a malformed request", "", Always},
    {401, "Unauthorized", "A token is required, or the token is unknown", "WWW-Authenticate", IfGranted},
    {403, "Forbidden", "The token is for other datasets", "", IfGranted},
    {404, "NotFound", "No such URL, dataset, tile or file", "", IfNamed},
    {405, "MethodNotAllowed", "Another method than those of this URL", "", Always},
    {408, "RequestTimeout", "The request did not arrive in time", "", Always},
    {413, "ContentTooLarge", "The body exceeds the limit that follows from `max_locations`", "", IfPost},
    {414, "UriTooLong", "The request target is over 8 KiB", "", Always},
    {415, "UnsupportedMediaType", "The body has a `Content-Encoding`, or another type than those listed", "", IfPost},
    {429, "TooManyRequests", "More requests or connections than the server allows the client", "Retry-After", Always},
    {431, "HeaderTooLarge", "The request head is over 16 KiB", "", Always},
    {503, "Unavailable", "Overload, a source that cannot be read, a start or a stop; the request may be repeated",
     "Retry-After", Always},
};

// The value of a parameter in a target's query, as sent; nothing if it has none.
std::optional<std::string> QueryValueIn(std::string_view target, std::string_view name) {
  std::string_view query = target.substr(std::min(target.find('?'), target.size()));
  while (!query.empty()) {
    query.remove_prefix(1);
    const std::string_view piece = query.substr(0, query.find('&'));
    if (piece.starts_with(name) && piece.substr(name.size()).starts_with('=')) {
      return std::string(piece.substr(name.size() + 1));
    }
    query.remove_prefix(piece.size());
  }
  return std::nullopt;
}

// The first example's value, in the type that the schema names.
Json ExampleOf(const Json& schema, const std::optional<std::string>& text) {
  const std::string type = schema.value("type", "string");
  return type == "integer" || type == "number" ? Json::parse(*text) : Json(*text);
}

Json PathParameter(const DocumentedUrl& url, std::string_view name) {
  Json parameter = {{"name", name}, {"in", "path"}, {"required", true}};
  for (const PathNote& note : PathNotes()) {
    if (note.name != name) continue;
    parameter["description"] = note.meaning;
    parameter["schema"] = Parsed(note.schema);
  }
  if (!parameter.contains("schema")) parameter["schema"] = {{"type", "string"}};
  if (url.operation == nullptr) return parameter;
  for (const ExampleRequest& example : url.operation->examples) {
    const auto value = ValueIn(example.target, url.pattern, name);
    if (!value) continue;
    parameter["example"] = ExampleOf(parameter["schema"], value);
    break;
  }
  return parameter;
}

Json QueryParameter(const Operation& operation, const ParameterNote& note) {
  Json parameter = {{"name", note.name}, {"in", "query"}};
  if (note.is_required) parameter["required"] = true;
  parameter["description"] = note.meaning;
  parameter["schema"] = Parsed(note.schema);
  for (const ExampleRequest& example : operation.examples) {
    const auto value = QueryValueIn(example.target, note.name);
    if (!value) continue;
    parameter["example"] = ExampleOf(parameter["schema"], value);
    break;
  }
  return parameter;
}

Json ParametersOf(const DocumentedUrl& url) {
  Json parameters = Json::array();
  for (const std::string_view name : VariablesOf(url.pattern)) parameters.push_back(PathParameter(url, name));
  if (url.takes_any_query) return parameters;
  parameters.push_back(RefTo("parameters", "v"));
  if (url.operation == nullptr) return parameters;
  for (const ParameterNote& note : url.operation->parameters) {
    parameters.push_back(QueryParameter(*url.operation, note));
  }
  return parameters;
}

Json ContentOf(std::span<const MediaNote> media, bool is_post) {
  Json content = Json::object();
  for (const MediaNote& note : media) {
    if (note.is_of_post && !is_post) continue;
    content[std::string(note.type)] = Json::object();
    if (!note.schema.empty()) content[std::string(note.type)]["schema"] = RefTo("schemas", note.schema);
  }
  return content;
}

Json RepliesOf(const DocumentedUrl& url, bool is_post) {
  Json replies;
  Json& success = replies["200"] = {{"description", "The reply"}};
  if (url.operation != nullptr) {
    for (const std::string_view header : url.operation->headers) {
      // What a POST returns is not cached and has no ETag.
      if (!(is_post && header == "ETag")) success["headers"][std::string(header)] = RefTo("headers", header);
    }
    success["content"] = ContentOf(url.operation->replies, is_post);
  }
  for (const StatusNote& note : kStatuses) {
    if (!note.applies(url, is_post)) continue;
    Json& reply = replies[std::to_string(note.status)];
    reply = RefTo("responses", note.name);
    if (note.status != 503 || url.operation == nullptr || url.operation->unavailable.empty()) continue;
    reply = {{"description", note.when}, {"headers", {{"Retry-After", RefTo("headers", "Retry-After")}}}};
    reply["content"] = ContentOf(url.operation->unavailable, is_post);
    reply["content"]["application/problem+json"]["schema"] = RefTo("schemas", "Problem");
  }
  return replies;
}

// A member of a body. Numbers may be sent as texts, and texts as numbers.
Json MemberOf(const ParameterNote& note) {
  Json schema = Parsed(note.schema);
  const std::string type = schema.at("type");
  schema["type"] = Json::array({type, type == "string" ? "number" : "string"});
  const Json words = schema.value("enum", Json::array());
  for (const Json& word : words) {
    const Json number = word.is_string() ? Json::parse(word.get<std::string>(), nullptr, /*allow_exceptions=*/false)
                                         : Json(word.dump());
    if (number.is_number() || number.is_string()) schema["enum"].push_back(number);
  }
  schema["description"] = note.meaning;
  return schema;
}

// Bodies have the parameters of the query.
Json BodyOf(const Operation& operation) {
  Json object = {{"type", "object"}, {"additionalProperties", false}};
  for (const ParameterNote& note : operation.parameters) object["properties"][std::string(note.name)] = MemberOf(note);
  object["properties"]["v"] = {{"type", Json::array({"string", "number"})}, {"description", "As in the query"}};
  Json content = Json::object();
  for (const ExampleRequest& example : operation.examples) {
    if (example.body_type.empty()) continue;
    Json& media = content[std::string(example.body_type)];
    media = Json::object();
    if (example.body_type != "application/octet-stream") media["schema"] = object;
    if (example.body_type == "application/json") media["example"] = Parsed(example.body);
  }
  return {{"required", true}, {"content", std::move(content)}};
}

Json ExamplesOf(const Operation& operation, bool is_post) {
  Json examples = Json::array();
  for (const ExampleRequest& example : operation.examples) {
    if (is_post == example.body_type.empty()) continue;
    Json& added = examples.emplace_back(Json{{"target", example.target}});
    if (!is_post) continue;
    added["type"] = example.body_type;
    added[example.body_type == "application/octet-stream" ? "base64" : "body"] = example.body;
  }
  return examples;
}

Json OperationOf(const DocumentedUrl& url, bool is_post) {
  Json json;
  if (url.operation != nullptr) {
    const Operation& operation = *url.operation;
    json["operationId"] = std::string(operation.id) + (is_post ? "ByPost" : "");
    json["tags"] = {operation.tag};
    json["summary"] = operation.summary;
    json["description"] = operation.description;
  }
  json["security"] = Json::array({Json::object()});
  if (url.needs_grant) {
    json["security"].push_back({{"bearer", Json::array()}});
    json["security"].push_back({{"query", Json::array()}});
  }
  json["parameters"] = ParametersOf(url);
  if (is_post) {
    for (Json& parameter : json["parameters"]) {
      if (parameter.value("in", "") == "query") parameter.erase("required");  // the body may have it
    }
    json["requestBody"] = BodyOf(*url.operation);
  }
  json["responses"] = RepliesOf(url, is_post);
  if (url.operation != nullptr) json["x-examples"] = ExamplesOf(*url.operation, is_post);
  return json;
}

Json Components() {
  Json components;
  for (const NamedSchema& schema : Schemas()) {
    components["schemas"][std::string(schema.name)] = Parsed(schema.schema);
  }
  components["parameters"]["v"] = {
      {"name", "v"},
      {"in", "query"},
      {"description",
       "The version that the URL belongs to. It affects only how long the reply may be cached. May be repeated; the "
       "first counts."},
      {"schema", {{"type", "string"}}}};
  for (const HeaderNote& header : HeaderNotes()) {
    components["headers"][std::string(header.name)] = {{"description", header.meaning},
                                                       {"schema", Parsed(header.schema)}};
  }
  for (const StatusNote& note : kStatuses) {
    Json& response = components["responses"][std::string(note.name)] = {{"description", note.when}};
    if (!note.header.empty()) response["headers"][std::string(note.header)] = RefTo("headers", note.header);
    if (note.status == 304) continue;
    response["content"]["application/problem+json"]["schema"] = RefTo("schemas", "Problem");
  }
  components["securitySchemes"] = {
      {"bearer", {{"type", "http"}, {"scheme", "bearer"}, {"description", "A token of the server's configuration"}}},
      {"query",
       {{"type", "apiKey"},
        {"in", "query"},
        {"name", "token"},
        {"description", "The same token, for clients that cannot send `Authorization`"}}}};
  return components;
}

}  // namespace

std::vector<std::string_view> VariablesOf(std::string_view pattern) {
  std::vector<std::string_view> names;
  for (std::size_t at = 0; (at = pattern.find('{', at)) != std::string_view::npos;) {
    const std::size_t end = std::min(pattern.find('}', at), pattern.size());
    names.push_back(pattern.substr(at + 1, end - at - 1));
    at = end;
  }
  return names;
}

std::optional<std::string> ValueIn(std::string_view target, std::string_view pattern, std::string_view variable) {
  target = target.substr(0, target.find('?'));
  std::optional<std::string> found;
  while (!pattern.empty()) {
    const std::size_t literal = std::min(pattern.find('{'), pattern.size());
    if (!target.starts_with(pattern.substr(0, literal))) return std::nullopt;
    target.remove_prefix(literal);
    pattern.remove_prefix(literal);
    if (pattern.empty()) break;
    const std::size_t close = pattern.find('}');
    const std::string_view name = pattern.substr(1, close - 1);
    pattern.remove_prefix(close + 1);
    // A value ends before the next character of the pattern.
    const std::size_t end = pattern.empty() ? target.size() : target.find(pattern.front());
    if (end == std::string_view::npos) return std::nullopt;
    if (name == variable) found = std::string(target.substr(0, end));
    target.remove_prefix(end);
  }
  return target.empty() ? found : std::nullopt;
}

std::string WriteOpenApi(const std::vector<DocumentedUrl>& urls) {
  Json document;
  document["openapi"] = "3.1.0";
  document["info"] = {
      {"title", "terrace"},
      {"version", "1"},  // of the interface; /version reveals the program's to those who may know it
      {"summary", "Level-of-detail terrain tiles over HTTP"},
      {"description",
       "Elevation rasters as quantized-mesh, 3D Tiles, height images, heights and meshes. Each URL also "
       "answers HEAD and OPTIONS. Each query parameter may occur once unless stated otherwise; URLs that end in "
       "`.glb`, `.subtree` and `tileset.json` accept `error`, `fraction`, `compression` and `texture` repeatedly with "
       "one value, because clients append the parameters of `tileset.json` to the URLs below it. Unknown parameters "
       "get 400. `x-examples` has requests that a server of the sample data answers with 200."},
      {"contact", {{"name", "The terrace authors"}}},
      {"license", {{"name", "Apache-2.0"}, {"identifier", "Apache-2.0"}}}};
  document["servers"] = Json::array({{{"url", "/"}, {"description", "The server that sent this document"}}});
  for (const TagNote& tag : TagNotes()) {
    document["tags"].push_back({{"name", tag.name}, {"description", tag.meaning}});
  }
  for (const DocumentedUrl& url : urls) {
    Json& path = document["paths"][url.pattern];
    path["get"] = OperationOf(url, /*is_post=*/false);
    if (url.takes_post && url.operation != nullptr) path["post"] = OperationOf(url, /*is_post=*/true);
  }
  document["components"] = Components();
  return document.dump() + "\n";
}

}  // namespace terrace::server
