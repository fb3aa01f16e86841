// Writes a 3TZ file: a zip file with an index of its entries, which finds an entry without reading the directory
// (3D Tiles Archive Format 1.3; APPNOTE.TXT of zip 6.3, with zip64 where 32 bits do not suffice).
//
// libzip and minizip do not fit: the index needs the offset of each entry, which libzip does not report, and minizip
// seeks back after each entry, which OutputFile cannot. Sizes and checksums are known beforehand, so a writer is short.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "archive/files/output_file.h"
#include "engine/core/result.h"

namespace terrace::archive {

// Used by one thread at a time. The same entries in the same order make the same bytes. Takes up to 96 bytes
// of memory for each entry, most of it in Finish. Destroyed without Finish: removes what it wrote. Errors: those of
// OutputFile; kUnavailable, too: OpenSSL has no MD5.
class ZipWriter {
 public:
  // `start`: where the first entry begins, after a hole; readers of zip files allow it. For tests of large files.
  static Result<ZipWriter> Create(const std::string& path, std::uint64_t start = 0);

  // Adds an uncompressed entry. `name`: ASCII, with slashes, none in front. Precondition: below 4 GiB, and not empty.
  Result<void> Add(std::string_view name, std::string_view bytes);
  // Adds a deflated entry. `gzip`: its content, compressed by proto::Gzip. kInvalidArgument: it is not a gzip stream.
  Result<void> AddGzip(std::string_view name, std::string_view gzip);

  // Writes the index as the last entry, and renames the file. kInvalidArgument: two entries have one name.
  Result<void> Finish();

 private:
  struct Indexed {
    std::uint64_t low = 0, high = 0;  // MD5 of the name, as two little-endian numbers: the order of the index
    std::uint64_t offset = 0;         // of the local header
  };
  struct Content {
    std::uint16_t method = 0;  // 0: stored, 8: deflated
    std::uint32_t crc32 = 0, size = 0;
    std::string_view bytes;  // as stored
  };

  ZipWriter(OutputFile out, SpoolFile directory) : out_(std::move(out)), directory_(std::move(directory)) {}
  Result<void> Put(std::string_view name, const Content& content);

  OutputFile out_;
  SpoolFile directory_;  // the central directory, which comes after all entries
  std::uint64_t directory_bytes_ = 0, entries_ = 0;
  std::vector<Indexed> index_;
};

}  // namespace terrace::archive
