// A bounded file store of records by key: RocksDB, behind the few calls that a cache makes of it.
//
// When the records take more than the capacity, the ones written first go, a file of them at a time. What was written
// survives the process at once; a power cut may take what was written last. Thread-safe. RocksDB's types stay
// behind this header.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "engine/core/result.h"

namespace rocksdb {
class Env;
}

namespace terrace::server {

struct RecordDbOptions {
  std::filesystem::path directory;  // made if it is missing; its parent exists
  std::size_t capacity_bytes = 0;   // of its files, kMinCapacity at least
  bool compress = false;            // LZ4
  // Record files open at a time, kMinOpenFiles at least. With fewer than FilesOf(capacity_bytes) a look-up may have to
  // open files first.
  std::size_t open_files = 1024;
  rocksdb::Env* env = nullptr;  // what stands for the disk, in tests; null: the disk. Outlives the store
};

class RecordDb {
 public:
  static constexpr std::size_t kMinCapacity = std::size_t{16} << 20;
  static constexpr std::size_t kMinOpenFiles = 10;  // RocksDB's

  // Descriptors of a store beside those of record files: its lock, log, directories, manifests, write-ahead logs, and
  // the file that is being written.
  static constexpr std::size_t kOtherDescriptors = 10;

  // As many record files as a store of this capacity may come to; mostly a quarter, but more where they are compressed.
  static std::size_t FilesOf(std::size_t capacity_bytes);

  // A store that is too damaged to be opened is emptied, and `*discarded` says so. kUnavailable: the disk does not
  // answer, or the store is open already.
  static Result<std::unique_ptr<RecordDb>> Open(const RecordDbOptions& options, bool* discarded);
  // Closes quickly: nothing is rewritten.
  ~RecordDb();

  // Erases the files of a store that is not open, unread; what else lies in its directory stays.
  static Result<void> Destroy(const RecordDbOptions& options);

  // Nothing if there is no such record. kInvalidArgument: it is damaged. kUnavailable: the disk does not answer.
  Result<std::optional<std::string>> Get(std::string_view key) const;

  struct Change {
    std::string key;
    std::optional<std::string> value;  // nothing: erased
  };
  // All or none of them. kUnavailable: the disk does not answer, or is full.
  Result<void> Write(std::span<const Change> changes);

  // About.
  std::size_t bytes() const;
  std::size_t entries() const;

  // Whether a file of 1 MiB can be written beside the store's.
  static Result<void> CheckWritable(const RecordDbOptions& options);

 private:
  class Impl;
  explicit RecordDb(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace terrace::server
