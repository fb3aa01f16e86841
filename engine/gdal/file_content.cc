#include "engine/gdal/file_content.h"

#include <fcntl.h>
#include <unistd.h>
#include <xxhash.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <mutex>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/common/open_file.h"
#include "engine/common/parallel_for.h"
#include "engine/common/source_log.h"
#include "engine/core/bytes.h"
#include "engine/core/errno_text.h"

namespace terrace::dem {
namespace {

// Smaller files are read again at each start: that takes less than a second.
constexpr std::uint64_t kMinKeptBytes = std::uint64_t{256} << 20;
constexpr std::size_t kReadBytes = std::size_t{1} << 20;
constexpr std::uint64_t kMagic = 0x31'54'4e'43'46'52'54;  // "TRFCNT1"

// FileStamp's == leaves out the time of the status change.
std::string BytesOf(const FileStamp& stamp) {
  ByteWriter writer;
  for (const std::uint64_t part : {stamp.device, stamp.inode, stamp.size, stamp.modified_ns, stamp.status_changed_ns}) {
    writer.Put(part);
  }
  return writer.Take();
}

// The hashes that this process knows, by path. Thread-safe.
class Known {
 public:
  std::optional<ContentHash> Find(const std::string& path, const FileStamp& stamp) {
    const std::lock_guard lock(mutex_);
    const auto found = hashes_.find(path);
    if (found == hashes_.end() || found->second.first != BytesOf(stamp)) return std::nullopt;
    return found->second.second;
  }
  void Add(const std::string& path, const FileStamp& stamp, const ContentHash& hash) {
    const std::lock_guard lock(mutex_);
    hashes_.insert_or_assign(path, std::pair(BytesOf(stamp), hash));
  }

 private:
  std::mutex mutex_;
  std::map<std::string, std::pair<std::string, ContentHash>> hashes_;  // guarded by mutex_
};

Known& KnownHashes() {
  static Known known;
  return known;
}

// A file of `cache_dir` with the hash of one large file: what it was made from, the hash, a checksum.
class KeptHash {
 public:
  KeptHash(const std::string& cache_dir, const std::string& path, const FileStamp& stamp) {
    const std::filesystem::path whole = AbsolutePath(path);
    const std::string text = whole.string();
    file_ = std::filesystem::path(cache_dir) /
            fmt::format("{}-{:016x}.content", whole.filename().string(), XXH3_64bits(text.data(), text.size()));
    ByteWriter writer;
    writer.Put(kMagic);
    writer.PutBytes(BytesOf(stamp));
    head_ = writer.Take();
  }

  std::optional<ContentHash> Load() const {
    std::ifstream in(file_, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    if (bytes.size() < head_.size()) return std::nullopt;
    ByteReader reader(std::string_view(bytes).substr(head_.size()));
    ContentHash hash;
    hash.high = reader.Get<std::uint64_t>();
    hash.low = reader.Get<std::uint64_t>();
    return Encode(hash) == bytes ? std::optional(hash) : std::nullopt;
  }

  // False: it cannot be written.
  bool Store(const ContentHash& hash) const {
    std::error_code failed;
    std::filesystem::create_directories(file_.parent_path(), failed);
    const std::filesystem::path partial = file_.string() + ".partial";
    std::ofstream out(partial, std::ios::binary);
    out << Encode(hash);
    out.close();
    if (out) std::filesystem::rename(partial, file_, failed);
    return Load().has_value();  // another process may have written and renamed the same file
  }

 private:
  std::string Encode(const ContentHash& hash) const {
    ByteWriter writer;
    writer.PutBytes(head_);
    writer.Put(hash.high);
    writer.Put(hash.low);
    std::string bytes = writer.Take();
    ByteWriter sum;
    sum.Put(XXH3_64bits(bytes.data(), bytes.size()));
    return bytes + sum.Take();
  }

  std::filesystem::path file_;
  std::string head_;
};

Result<ContentHash> ReadThrough(const std::string& path, const std::stop_token& stop) {
  const auto failed = [&] { return MakeError(ErrorCode::kUnavailable, "{}: cannot be read: {}", path, ErrorText()); };
  const OpenFile file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file.is_open()) return failed();
  ContentHasher hasher;
  std::vector<char> buffer(kReadBytes);
  for (;;) {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "{}: reading it was stopped", path);
    const ssize_t got = ::read(file.get(), buffer.data(), buffer.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return failed();
    if (got == 0) return hasher.Hash();
    hasher.AddBytes(buffer.data(), static_cast<std::size_t>(got));
  }
}

Result<ContentHash> HashFile(const std::string& path, const FileStamp& stamp, const FileContentOptions& options) {
  if (const auto known = KnownHashes().Find(path, stamp)) return *known;
  std::optional<KeptHash> kept;
  if (stamp.size >= kMinKeptBytes && !options.cache_dir.empty()) kept.emplace(options.cache_dir, path, stamp);
  std::optional<ContentHash> loaded = kept ? kept->Load() : std::nullopt;
  if (!loaded) {
    if (stamp.size >= kMinKeptBytes) {
      LogSource(SourceLog::Level::kInfo, path, "is read through once for its version, {} MB", stamp.size >> 20);
    }
    const auto read = ReadThrough(path, options.stop);
    if (!read) return read;
    if (StampOf(path) != stamp) return tl::unexpected(ChangedError(path));
    if (kept && !kept->Store(*read)) {
      LogSource(SourceLog::Level::kWarn, path, "its hash cannot be kept in {}: at the next start it is read again",
                options.cache_dir);
    }
    loaded = *read;
  }
  KnownHashes().Add(path, stamp, *loaded);
  return *loaded;
}

}  // namespace

Result<ContentHash> HashFiles(const StampedFiles& files, const FileContentOptions& options) {
  std::vector<std::optional<Result<ContentHash>>> hashes(files.size());
  ParallelFor(files.size(), [&](std::size_t i) {
    hashes[i] = HashFile(files.path(i), files.stamp(i), options);
    return hashes[i]->has_value();
  });
  ContentHasher all;
  for (const auto& hash : hashes) {
    if (!*hash) return tl::unexpected(hash->error());  // those after the first that failed may be missing
    all.Add(**hash);
  }
  for (const std::uint64_t other : files.gdal_path_fingerprints()) all.Add(other);
  return all.Hash();
}

}  // namespace terrace::dem
