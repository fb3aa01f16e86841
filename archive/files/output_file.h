// Writes a file that is complete or absent: under another name, then renamed; or an object of a bucket, put when it is
// complete.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "engine/core/result.h"

namespace terrace::archive {

// The end of the names of unfinished files.
inline constexpr std::string_view kPartial = ".partial";

// kUnavailable: the file cannot be written; the message names it and the reason. Used by one thread at a time.
class OutputFile {
 public:
  // Creates the folders of `path`. Objects of buckets (IsBucket) wait in a nameless file of TMPDIR, else /tmp.
  // Unfinished files have unique names: several may write the same file at a time.
  static Result<OutputFile> Create(const std::string& path);
  ~OutputFile();  // removes an unfinished file
  OutputFile(OutputFile&&) noexcept;
  OutputFile& operator=(OutputFile&&) = delete;

  Result<void> Write(std::string_view bytes);
  // Leaves a hole of zeros, which takes no space on most disks. Not part of xxh3().
  Result<void> Skip(std::uint64_t bytes);
  // Waits until the bytes are on the disk, and renames the file.
  Result<void> Finish();

  std::uint64_t size() const;
  // XXH3-128 of what was written, 32 hexadecimal digits.
  std::string xxh3() const;

 private:
  struct Impl;
  explicit OutputFile(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// Waits until the names in a folder are on the disk. Creates a folder and its parents, and waits until their names are
// on the disk. Both return 0, or why not, as errno does.
int SyncFolder(const std::string& folder);
int CreateFolders(const std::string& folder);

// Renames a complete file or folder. The new name is on the disk afterwards. kUnavailable: as OutputFile.
Result<void> Rename(const std::string& from, const std::string& to);

// Writes a file without waiting for the disk: for many small files. Makes its folder. kUnavailable: as OutputFile.
Result<void> WriteUnsynced(const std::string& path, std::string_view bytes);

// An unnamed temporary file in the folder of `path`, or in that of temporary files if the path is in a bucket. The
// system removes it when the process ends. Used by one thread at a time. kUnavailable: the folder cannot be made or
// written, or the file cannot be read.
class SpoolFile {
 public:
  static Result<SpoolFile> Create(const std::string& path);
  ~SpoolFile();
  SpoolFile(SpoolFile&& other) noexcept;
  SpoolFile& operator=(SpoolFile&&) = delete;

  // Returns where the bytes begin.
  Result<std::uint64_t> Append(std::string_view bytes);
  Result<std::string> Read(std::uint64_t offset, std::size_t size);

 private:
  SpoolFile(int descriptor, std::string folder);
  Result<void> Flush();

  int descriptor_;
  std::string folder_;
  std::string waiting_;  // not yet written
  std::uint64_t written_ = 0;
};

}  // namespace terrace::archive
