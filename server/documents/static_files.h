// The viewer's files, loaded into memory at the start: no request opens a file.
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
  // An empty set.
  StaticFiles() = default;

  // Loads every regular file below `directory`. If `a.js.gz` exists beside `a.js`, clients that accept gzip get it; it
  // must contain the same bytes. A directory that does not exist gives an empty set; one that cannot be read is an
  // error.
  static Result<StaticFiles> Load(const std::filesystem::path& directory);

  // `path`: relative to the directory, with '/'. Null: there is no such file.
  const Document* Find(std::string_view path) const;
  bool empty() const { return files_.empty(); }

 private:
  std::map<std::string, Document, std::less<>> files_;
};

// By the file's extension; application/octet-stream for unknown ones.
std::string_view MediaTypeOf(std::string_view path);

}  // namespace terrace::server
