// A key-value store on disk with a bounded size: a wrapper of RocksDB with the functions that a cache needs.
// If the records exceed the capacity, the oldest are deleted, one file of them at a time. Written records survive the
// end of the process; a power failure may lose the most recent ones. Thread-safe. No RocksDB type appears in this
// header.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>

#include "engine/core/result.h"

namespace rocksdb {
class Env;
}

namespace terrace::server {

struct RecordDbOptions {
  std::filesystem::path directory;  // made if it is missing; its parent exists
  std::size_t capacity_bytes = 0;   // of its files, kMinCapacity at least
  bool compress = false;            // LZ4
  // Limit of open record files, at least kMinOpenFiles. With fewer than FilesOf(capacity_bytes), a look-up may have to
  // open files first.
  std::size_t open_files = 1024;
  rocksdb::Env* env = nullptr;  // replaces the disk in tests; null: the disk. Must outlive the store
};

class RecordDb {
 public:
  static constexpr std::size_t kMinCapacity = std::size_t{16} << 20;
  static constexpr std::size_t kMinOpenFiles = 10;  // RocksDB's

  // File descriptors of a store in addition to record files: its lock, log, directories, manifests, write-ahead logs,
  // and the file that is being written.
  static constexpr std::size_t kOtherDescriptors = 10;

  // The largest number of record files of a store of this capacity. Most stores have a quarter of it; compressed ones
  // have more.
  static std::size_t FilesOf(std::size_t capacity_bytes);

  // The oldest records of a store of this capacity are deleted when its record files have more bytes than this. The
  // rest is for files that are being written.
  static std::size_t RecordBytes(std::size_t capacity_bytes);

  // Empties a store that is too damaged to be opened, and then sets `*discarded`. kUnavailable: the disk does not
  // respond, or the store is open already.
  static Result<std::unique_ptr<RecordDb>> Open(const RecordDbOptions& options, bool* discarded);
  // Closes without compaction.
  ~RecordDb();

  // Erases the files of a store that is not open, without reading them. Other files in its directory stay.
  // kUnavailable: the disk does not respond, or the store is open.
  static Result<void> Destroy(const RecordDbOptions& options);

  // Nothing if there is no such record. kInternal: the record is damaged. kUnavailable: the disk does not respond.
  Result<std::optional<std::string>> Get(std::string_view key) const;

  struct Change {
    std::string key;
    std::optional<std::string> value;  // nothing: erased
  };
  // Writes all changes or none. kUnavailable: the disk does not respond, or is full.
  Result<void> Write(std::span<const Change> changes);

  // Erases the records whose keys begin with `prefix` and that `is_chosen` accepts. Reads all that begin with it.
  // Returns their number. kCancelled: `stop` was requested. kInternal: a record is damaged. kUnavailable: as Write.
  // After an error records may be left.
  Result<std::size_t> EraseIf(std::string_view prefix, const std::function<bool(std::string_view key)>& is_chosen,
                              const std::stop_token& stop = {});

  // Approximate.
  std::size_t bytes() const;
  std::size_t entries() const;

  // Checks that a file of 1 MiB can be written to the store's directory. kUnavailable: it cannot.
  static Result<void> CheckWritable(const RecordDbOptions& options);

 private:
  class Impl;
  explicit RecordDb(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace terrace::server
