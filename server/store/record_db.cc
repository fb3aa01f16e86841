#include "server/store/record_db.h"

#include <rocksdb/db.h>
#include <rocksdb/env.h>
#include <rocksdb/filter_policy.h>
#include <rocksdb/options.h>
#include <rocksdb/table.h>
#include <rocksdb/write_batch.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <vector>

namespace terrace::server {
namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;
constexpr std::size_t kProbeBytes = kMiB;
constexpr std::size_t kErasedAtOnce = 1000;

rocksdb::Slice SliceOf(std::string_view text) { return {text.data(), text.size()}; }

tl::unexpected<Error> Fail(const rocksdb::Status& status) {
  const bool damaged = status.IsCorruption();
  return MakeError(damaged ? ErrorCode::kInternal : ErrorCode::kUnavailable, "{}", status.ToString());
}

// Records are deleted with their file, so a file should be a small part of the capacity. More files make look-ups
// slower, because a look-up checks the filter of each file.
std::size_t FileBytes(std::size_t capacity_bytes) { return std::clamp(capacity_bytes / 256, kMiB, 64 * kMiB); }

rocksdb::Options OptionsOf(const RecordDbOptions& options) {
  rocksdb::Options db;
  if (options.env != nullptr) db.env = options.env;
  db.create_if_missing = true;
  // Files are written once and deleted whole, the oldest first: nothing is ever merged.
  db.compaction_style = rocksdb::kCompactionStyleFIFO;
  db.ttl = 0;
  db.periodic_compaction_seconds = 0;
  db.write_buffer_size = FileBytes(options.capacity_bytes);
  db.max_write_buffer_number = 2;
  db.compaction_options_fifo.max_table_files_size = RecordDb::RecordBytes(options.capacity_bytes);
  db.compression = options.compress ? rocksdb::kLZ4Compression : rocksdb::kNoCompression;
  // RocksDB reserves ten of them for its other files. One shard: a file cache with 64 shards would hold up to 64 more.
  db.max_open_files =
      static_cast<int>(std::clamp<std::size_t>(options.open_files, RecordDb::kMinOpenFiles, 1 << 20)) + 10;
  db.table_cache_numshardbits = 0;
  // A log that ends in the middle of a record, or has a damaged one, loses that record and not the store.
  db.wal_recovery_mode = rocksdb::WALRecoveryMode::kSkipAnyCorruptedRecords;
  db.avoid_flush_during_shutdown = true;  // the log contains the reason
  db.info_log_level = rocksdb::WARN_LEVEL;
  db.max_log_file_size = kMiB;
  db.keep_log_file_num = 2;
  db.max_manifest_file_size = kMiB;
  db.stats_dump_period_sec = 0;
  db.stats_persist_period_sec = 0;
  rocksdb::BlockBasedTableOptions table;
  table.no_block_cache = true;  // frequent records are in the memory tier
  table.filter_policy.reset(rocksdb::NewBloomFilterPolicy(10));
  table.checksum = rocksdb::kXXH3;
  table.format_version = 5;
  db.table_factory.reset(rocksdb::NewBlockBasedTableFactory(table));
  return db;
}

// Damage that reopening does not repair. A failing disk may recover.
bool IsDamaged(const rocksdb::Status& status) {
  return status.IsCorruption() || status.IsInvalidArgument() || status.IsNotSupported() || status.IsNotFound() ||
         status.IsPathNotFound();
}

}  // namespace

// If look-ups cycle through more files than may be open, an LRU cache would always evict the file needed next.
std::size_t RecordDb::FilesOf(std::size_t capacity_bytes) { return 4 * (capacity_bytes / FileBytes(capacity_bytes)); }

// Reserve: two full buffers with their logs, the file that is written from them, preallocated logs, and one file more
// until the oldest is deleted.
std::size_t RecordDb::RecordBytes(std::size_t capacity_bytes) { return capacity_bytes - 6 * FileBytes(capacity_bytes); }

class RecordDb::Impl {
 public:
  explicit Impl(std::unique_ptr<rocksdb::DB> open) : db(std::move(open)) {}
  std::size_t Property(const std::string& name) const {
    std::uint64_t value = 0;
    return db->GetIntProperty(name, &value) ? static_cast<std::size_t>(value) : 0;
  }

  const std::unique_ptr<rocksdb::DB> db;
  std::atomic<bool> failed{false};  // a write has failed
};

RecordDb::RecordDb(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

// After a failed write, Debian's build of RocksDB aborts when the log is used again.
RecordDb::~RecordDb() {
  if (!impl_->failed) static_cast<void>(impl_->db->SyncWAL());
}

Result<std::unique_ptr<RecordDb>> RecordDb::Open(const RecordDbOptions& options, bool* discarded) {
  const rocksdb::Options db_options = OptionsOf(options);
  const std::string directory = options.directory.string();
  *discarded = false;
  rocksdb::DB* db = nullptr;
  rocksdb::Status status = rocksdb::DB::Open(db_options, directory, &db);
  if (IsDamaged(status)) {
    *discarded = true;
    status = rocksdb::DestroyDB(directory, db_options);
    if (status.ok()) status = rocksdb::DB::Open(db_options, directory, &db);
  }
  if (!status.ok()) return MakeError(ErrorCode::kUnavailable, "{}: {}", directory, status.ToString());
  return std::unique_ptr<RecordDb>(new RecordDb(std::make_unique<Impl>(std::unique_ptr<rocksdb::DB>(db))));
}

Result<void> RecordDb::Destroy(const RecordDbOptions& options) {
  const rocksdb::Status status = rocksdb::DestroyDB(options.directory.string(), OptionsOf(options));
  if (!status.ok()) return MakeError(ErrorCode::kUnavailable, "{}: {}", options.directory.string(), status.ToString());
  return {};
}

Result<std::optional<std::string>> RecordDb::Get(std::string_view key) const {
  std::string value;
  const rocksdb::Status status = impl_->db->Get(rocksdb::ReadOptions(), SliceOf(key), &value);
  if (status.IsNotFound()) return std::nullopt;
  if (!status.ok()) return Fail(status);
  return std::optional(std::move(value));
}

Result<void> RecordDb::Write(std::span<const Change> changes) {
  rocksdb::WriteBatch batch;
  for (const Change& change : changes) {
    const rocksdb::Status added =
        change.value ? batch.Put(SliceOf(change.key), SliceOf(*change.value)) : batch.Delete(SliceOf(change.key));
    if (!added.ok()) return Fail(added);
  }
  const rocksdb::Status status = impl_->db->Write(rocksdb::WriteOptions(), &batch);
  if (!status.ok()) {
    impl_->failed = true;
    return Fail(status);
  }
  return {};
}

Result<std::size_t> RecordDb::EraseIf(std::string_view prefix,
                                      const std::function<bool(std::string_view key)>& is_chosen,
                                      const std::stop_token& stop) {
  std::size_t erased = 0;
  std::vector<Change> changes;
  const auto write = [&] {
    erased += changes.size();
    const Result<void> written = Write(changes);
    changes.clear();
    return written;
  };
  const std::unique_ptr<rocksdb::Iterator> record(impl_->db->NewIterator(rocksdb::ReadOptions()));
  for (record->Seek(SliceOf(prefix)); record->Valid() && record->key().starts_with(SliceOf(prefix)); record->Next()) {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "stopped");
    const std::string_view key(record->key().data(), record->key().size());
    if (is_chosen(key)) changes.push_back({std::string(key), std::nullopt});
    if (changes.size() < kErasedAtOnce) continue;
    if (const Result<void> written = write(); !written) return tl::unexpected(written.error());
  }
  if (!record->status().ok()) return Fail(record->status());
  if (const Result<void> written = write(); !written) return tl::unexpected(written.error());
  return erased;
}

std::size_t RecordDb::bytes() const {
  return impl_->Property(rocksdb::DB::Properties::kTotalSstFilesSize) +
         impl_->Property(rocksdb::DB::Properties::kCurSizeAllMemTables);
}

std::size_t RecordDb::entries() const { return impl_->Property(rocksdb::DB::Properties::kEstimateNumKeys); }

Result<void> RecordDb::CheckWritable(const RecordDbOptions& options) {
  rocksdb::Env& env = options.env != nullptr ? *options.env : *rocksdb::Env::Default();
  const std::string path = (options.directory / "probe").string();
  std::unique_ptr<rocksdb::WritableFile> file;
  rocksdb::Status status = env.CreateDirIfMissing(options.directory.string());
  if (status.ok()) status = env.NewWritableFile(path, &file, rocksdb::EnvOptions());
  if (status.ok()) status = file->Append(std::string(kProbeBytes, '\0'));
  if (status.ok()) status = file->Sync();
  if (status.ok()) status = file->Close();
  file.reset();
  static_cast<void>(env.DeleteFile(path));
  if (!status.ok()) return Fail(status);
  return {};
}

}  // namespace terrace::server
