#include "server/documents/static_files.h"

#include <spdlog/spdlog.h>

#include <fstream>
#include <iterator>
#include <optional>
#include <system_error>
#include <utility>

#include "proto/compress.h"

namespace terrace::server {
namespace {

namespace fs = std::filesystem;

Result<std::string> ReadFile(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  if (!in) return MakeError(ErrorCode::kUnavailable, "{}: cannot be read; check its permissions", path.string());
  return bytes;
}

Result<Document> LoadDocument(const fs::path& path) {
  Result<std::string> bytes = ReadFile(path);
  if (!bytes) return tl::unexpected(bytes.error());
  std::optional<std::string> gzipped;
  std::error_code ignored;
  if (const fs::path sibling = path.string() + ".gz"; fs::is_regular_file(sibling, ignored)) {
    Result<std::string> compressed = ReadFile(sibling);
    if (!compressed) return tl::unexpected(compressed.error());
    if (proto::Gunzip(*compressed, bytes->size()) == *bytes) {
      gzipped = std::move(*compressed);
    } else {
      spdlog::warn("{} is not the compressed form of {}, and is not used; make it anew with `gzip -kf {}`",
                   sibling.string(), path.string(), path.string());
    }
  }
  return Document::Make(std::move(*bytes), MediaTypeOf(path.string()), std::move(gzipped));
}

bool IsCompressedSibling(const fs::path& path) {
  std::error_code ignored;
  return path.extension() == ".gz" && fs::is_regular_file(fs::path(path).replace_extension(), ignored);
}

}  // namespace

std::string_view MediaTypeOf(std::string_view path) {
  static constexpr std::pair<std::string_view, std::string_view> kTypes[] = {
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".mjs", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".json", "application/json"},
      {".map", "application/json"},
      {".txt", "text/plain; charset=utf-8"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".jpg", "image/jpeg"},
      {".gif", "image/gif"},
      {".ico", "image/x-icon"},
      {".wasm", "application/wasm"},
      {".woff2", "font/woff2"},
      {".glb", "model/gltf-binary"},
      {".xml", "application/xml"},
      {".ktx2", "image/ktx2"},
  };
  for (const auto& [extension, type] : kTypes) {
    if (path.ends_with(extension)) return type;
  }
  return "application/octet-stream";
}

Result<StaticFiles> StaticFiles::Load(const fs::path& directory) {
  StaticFiles files;
  std::error_code error;
  if (directory.empty() || fs::status(directory, error).type() == fs::file_type::not_found) return files;
  fs::recursive_directory_iterator walk(directory, error);
  for (; !error && walk != fs::recursive_directory_iterator(); walk.increment(error)) {
    if (!walk->is_regular_file(error) || IsCompressedSibling(walk->path())) continue;
    Result<Document> document = LoadDocument(walk->path());
    if (!document) return tl::unexpected(document.error());
    files.files_.emplace(walk->path().lexically_relative(directory).generic_string(), std::move(*document));
  }
  if (error) {
    return MakeError(ErrorCode::kUnavailable, "{}: cannot be listed ({}); check the viewer's folder",
                     directory.string(), error.message());
  }
  return files;
}

const Document* StaticFiles::Find(std::string_view path) const {
  const auto found = files_.find(path);
  return found == files_.end() ? nullptr : &found->second;
}

}  // namespace terrace::server
