// The viewer's files, held in memory from the start: no request ever opens a file.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "server/documents/document.h"

namespace terrace::server {

class StaticFiles {
 public:
  // No files at all.
  StaticFiles() = default;

  // Every regular file below `directory`. `a.js.gz` beside `a.js` is what clients get that take gzip; it must hold the
  // same bytes. A directory that does not exist gives no files; one that cannot be read is an error.
  static Result<StaticFiles> Load(const std::filesystem::path& directory);

  // `path` relative to the directory, with '/'. Null when there is no such file.
  const Document* Find(std::string_view path) const;
  bool empty() const { return files_.empty(); }

 private:
  std::map<std::string, Document, std::less<>> files_;
};

// By the file's extension; application/octet-stream where it says nothing.
std::string_view MediaTypeOf(std::string_view path);

}  // namespace terrace::server
