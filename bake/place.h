// The place of a bake: a folder or a bucket that is empty, or has this bake, finished or not.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "archive/manifest.h"
#include "engine/core/result.h"

namespace terrace::bake {

// The folder of an archive: the place itself if it is the only one, else archive::FolderOf below it.
std::string ArchivePlace(const std::string& place, const archive::Manifest& manifest, bool is_only);

// An exclusive lock on a place, held until the object is destroyed.
class PlaceLock {
 public:
  // `shard`: names the lock of one shard; empty: of the whole place. Creates the folder. Takes over the lock of a
  // process that has ended, if it ran on this machine, and since the last boot in the same container. kUnavailable: the
  // folder cannot be created or written. kOverloaded: another bake works there; the message says which one and what to
  // do.
  static Result<PlaceLock> Take(const std::string& place, const std::string& shard);
  PlaceLock(PlaceLock&& other) noexcept;
  PlaceLock& operator=(PlaceLock&&) = delete;
  ~PlaceLock();

 private:
  explicit PlaceLock(std::string file) : file_(std::move(file)) {}

  std::string file_;  // empty: moved away
};

// The properties of a bake that must not change between its runs. Sources may change: their units are baked again.
struct BakeIdentity {
  struct Field {
    std::string what, value;
  };
  std::vector<Field> fields;  // "dataset", "format", "levels" ...
};

// The text of Manifest::identity.
std::string ToJson(const BakeIdentity& identity);

// Checks that the place can take this bake, and writes the identity there. The place is empty, or holds a bake of the
// same identity: an unfinished one, or a finished one of this `generation`. `is_exported_later`: it may hold
// kExportFolder. kInvalidArgument: it holds something else, or another bake; the message says what differs and what to
// do. kUnavailable: it cannot be read or written.
Result<void> ClaimPlace(const std::string& place, const BakeIdentity& identity, std::uint64_t generation,
                        bool is_exported_later);

// The folder in a place where another form of the finished bake is written before it is renamed to its own place.
inline constexpr const char* kExportFolder = "export";

// Removes what only an unfinished bake needs: the number of the place (PlaceId), unfinished files of killed
// processes, and locks of processes of which it is known that they have ended. The identity stays: with it, a bake that
// loses its manifest is an unfinished one, whose files are checked and kept.
void TidyPlace(const std::string& place, const std::vector<archive::Manifest>& manifests);

// Workers of a job share a place.

// A random number that is kept in the place until the bake is finished: workers that have the same one write into the
// same place, wherever it is mounted. kUnavailable: the place cannot be written.
Result<std::string> PlaceId(const std::string& place);
// Returns whether the archives there are finished. If so, removes the number (PlaceId) and what killed processes have
// left, as TidyPlace does.
bool TidyIfFinished(const std::string& place, const std::vector<archive::Manifest>& manifests);
// Removes the identity and the number if the place holds nothing else but the lock `own_lock`: the bake was
// refused.
void RemoveNotesIfEmpty(const std::string& place, const std::string& own_lock);
// The name of a worker's lock for PlaceLock::Take. Locks of one job exclude other bakes, but not one another.
std::string LockOfWorker(const std::string& worker, const std::string& job);
// Removes the locks of the job's other workers. The job is done: they were killed, or what they still do is not needed.
void RemoveLocksOfJob(const std::string& place, const std::string& job, const std::string& except_worker);

}  // namespace terrace::bake
