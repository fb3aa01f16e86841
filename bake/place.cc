#include "bake/place.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include <array>
#include <cerrno>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

#include "archive/files/bucket.h"
#include "archive/files/output_file.h"
#include "archive/unit_name.h"
#include "bake/place_files.h"
#include "engine/core/errno_text.h"
#include "engine/core/names.h"
#include "engine/core/parse_number.h"
#include "tiler/encoder_version.h"

namespace terrace::bake {
namespace {

namespace fs = std::filesystem;

constexpr const char* kIdentityFile = "bake.json";
constexpr const char* kPlaceIdFile = "bake-place.id";

// What the kernel states about a process. Empty: unknown.
struct ProcessState {
  std::string state;  // "R"; "Z" and "X": it has ended, but its parent does not know yet
  std::string start;  // in the kernel's ticks; differs for a later process with the same number

  static ProcessState Of(long pid) {
    const std::string stat = ReadText(fmt::format("/proc/{}/stat", pid)).value_or("");
    const std::size_t name_end = stat.rfind(')');
    if (name_end == std::string::npos) return {};
    ProcessState process;
    std::istringstream fields(stat.substr(name_end + 1));
    fields >> process.state;
    constexpr int kStart = 20;  // counted after the name
    for (int i = 1; i < kStart; ++i) fields >> process.start;
    return process;
  }
};

constexpr const char* kUnknown = "unknown";

// Identifies the namespace of process numbers: a container has its own.
std::string NumberSpace() {
  std::error_code error;
  const std::string space = fs::read_symlink("/proc/self/ns/pid", error).string();
  return error ? kUnknown : space;
}

std::string FirstWord(const char* path) {
  std::string word;
  std::istringstream(ReadText(path).value_or("")) >> word;
  return word.empty() ? kUnknown : word;
}

// Identifies a boot of a machine.
std::string BootOf() { return FirstWord("/proc/sys/kernel/random/boot_id"); }

// Stays the same after a restart. A hash, because the number itself is confidential (machine-id(5)). Names of hosts do
// not identify a machine: those of containers are often equal.
std::string MachineOf() {
  const std::string id = FirstWord("/etc/machine-id");
  if (id == kUnknown || id == "uninitialized") return kUnknown;
  return fmt::format("{:016x}", XXH3_64bits_withSeed(id.data(), id.size(), /*seed=*/0x7465727261636521));
}

// The owner of a lock, as its file states it: host, process, its start, boot, namespace of process numbers, machine.
struct Owner {
  std::string host = kUnknown, pid = kUnknown, start, boot = kUnknown, space, machine = kUnknown;

  static Owner Parse(const std::string& text) {
    Owner owner;
    std::istringstream(text) >> owner.host >> owner.pid >> owner.start >> owner.boot >> owner.space >> owner.machine;
    return owner;
  }
  // Of this boot or an earlier one. Containers may share a machine-id, so outside of them only.
  bool IsOfThisMachine() const {
    constexpr const char* kFirstSpace = "pid:[4026531836]";  // the kernel's own (PROC_PID_INIT_INO)
    return space == kFirstSpace && NumberSpace() == kFirstSpace && machine != kUnknown && machine == MachineOf() &&
           host == HostName();
  }
  // Whether the process has certainly ended. Nothing is known about processes of other machines and containers.
  bool HasEnded() const {
    if (boot == kUnknown) return false;
    if (boot != BootOf()) return IsOfThisMachine();
    if (space != NumberSpace()) return false;
    const long number = ParseNumber<long>(pid).value_or(0);
    if (number <= 0) return false;
    if (::kill(static_cast<pid_t>(number), 0) != 0 && errno == ESRCH) return true;
    const ProcessState now = ProcessState::Of(number);
    if (now.state == "Z" || now.state == "X") return true;
    return !start.empty() && !now.start.empty() && now.start != start;
  }
};

Result<void> MakeFolder(const std::string& place) {
  if (archive::IsBucket(place)) return {};
  std::error_code error;
  if (fs::exists(place, error) && !fs::is_directory(place, error)) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: is a file; a bake needs a folder: give another place with --out",
                     place);
  }
  if (const int failed = archive::CreateFolders(place); failed != 0) {
    return MakeError(ErrorCode::kUnavailable, "{}: cannot be created: {}; give a folder that can be written with --out",
                     place, ErrorText(failed));
  }
  if (::access(place.c_str(), W_OK | X_OK) != 0) {
    return MakeError(ErrorCode::kUnavailable, "{}: cannot be written: {}; give a folder that can be written with --out",
                     place, ErrorText());
  }
  return {};
}

// What the lock files of this process contain.
std::string OwnLock() {
  return fmt::format("{} {} {} {} {} {}", HostName(), ::getpid(), ProcessState::Of(::getpid()).start, BootOf(),
                     NumberSpace(), MachineOf());
}

bool IsLock(const std::string& name) { return name.starts_with("bake") && name.ends_with(".lock"); }

// Whether it is an unfinished file of a lock, an identity, a manifest or a unit.
bool IsPartial(const std::string& name) {
  const bool is_ours = name.starts_with("bake") || name.starts_with(archive::kManifestFile) ||
                       name.find(".pmtiles.") != std::string::npos;
  return is_ours && name.ends_with(".partial");
}

// Removes the lock of a process that has ended, but not one with which another process has replaced it meanwhile. Those
// that want to remove it run on one machine (Owner::HasEnded), so they can exclude one another by flock.
void RemoveStaleLock(const std::string& file) {
  if (archive::IsBucket(file)) return Remove(file);
  int descriptor = ::open(file.c_str(), O_RDWR | O_CLOEXEC);                    // NFS: flock needs write access
  if (descriptor < 0) descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);  // another user's
  if (descriptor < 0) return;
  const bool is_locked = ::flock(descriptor, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK;
  struct stat opened {
  }, now{};
  const bool is_there = ::fstat(descriptor, &opened) == 0 && ::stat(file.c_str(), &now) == 0 &&
                        opened.st_dev == now.st_dev && opened.st_ino == now.st_ino;
  if (is_locked && is_there && Owner::Parse(ReadText(file).value_or("")).HasEnded()) ::unlink(file.c_str());
  ::close(descriptor);
}

// A lock in `place` that excludes `own`, and whose process may be running; empty: none. Locks of one division into
// shards do not exclude one another.
Result<std::string> OtherLock(const std::string& place, const std::string& own) {
  const auto division = [](const std::string& name) {
    const std::size_t of = name.rfind("-of-");
    return of == std::string::npos ? name : name.substr(of);
  };
  const Result<std::vector<std::string>> names = NamesIn(place);
  if (!names) return tl::unexpected(names.error());
  for (const std::string& name : *names) {
    if (!IsLock(name) || name == own || (division(name) == division(own) && name != "bake.lock")) continue;
    const std::string file = place + "/" + name;
    const Result<std::string> text = ReadText(file);
    if (!text && text.error().code == ErrorCode::kNotFound) continue;  // removed meanwhile
    if (!text) return tl::unexpected(text.error());
    if (!Owner::Parse(*text).HasEnded()) return file;
  }
  return std::string();
}

// `why`: of CreateFile. Messages of buckets name the object and the remedy already.
tl::unexpected<Error> CannotCreate(const std::string& file, const Error& why) {
  if (archive::IsBucket(file)) return tl::unexpected(why);
  return MakeError(ErrorCode::kUnavailable, "{}: cannot be written: {}; give a place with room that can be written",
                   file, why.message);
}

// Whether it is a file or folder of tiles.
bool IsContent(const std::string& name) {
  return name == archive::UnitPath("top") || name == "units" || ValueNamed(archive::kFormatNames, name).has_value();
}

bool IsOurs(const std::string& name) {
  return name == kIdentityFile || name == kPlaceIdFile || name == archive::kManifestFile || name == "lost+found" ||
         IsContent(name) || IsLock(name) || IsPartial(name);
}

// The differences between a written identity and this one, as one sentence; empty: none.
std::string Differences(const nlohmann::ordered_json& noted, const BakeIdentity& identity) {
  std::string text;
  for (const auto& [what, value] : identity.fields) {
    const std::string before =
        noted.contains(what) && noted[what].is_string() ? noted[what].get<std::string>() : "none";
    if (before != value) text += fmt::format("{}{} \"{}\", not \"{}\"", text.empty() ? "" : "; ", what, before, value);
  }
  return text;
}

Result<void> CheckSame(const std::string& place, const std::string& noted_json, const BakeIdentity& identity,
                       const std::string& noted_in) {
  const auto noted = nlohmann::ordered_json::parse(noted_json, nullptr, /*allow_exceptions=*/false);
  if (!noted.is_object()) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "{}: does not say what is baked there; if a bake has just begun there, run the same command again, "
        "else give another folder with --out",
        noted_in);
  }
  const std::string differences = Differences(noted, identity);
  if (differences.empty()) return {};
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: holds another bake: {}; give the same arguments to go on with it, or another folder with --out",
                   place, differences);
}

}  // namespace

std::string ToJson(const BakeIdentity& identity) {
  nlohmann::ordered_json json;
  for (const auto& [what, value] : identity.fields) json[what] = value;
  return json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string ArchivePlace(const std::string& place, const archive::Manifest& manifest, bool is_only) {
  return is_only ? place : place + "/" + archive::FolderOf(manifest.kind.format);
}

Result<PlaceLock> PlaceLock::Take(const std::string& place, const std::string& shard) {
  if (auto made = MakeFolder(place); !made) return tl::unexpected(made.error());
  const std::string file = fmt::format("{}/bake{}{}.lock", place, shard.empty() ? "" : "-", shard);
  constexpr int kTries = 3;
  for (int i = 0; i < kTries; ++i) {
    const Result<bool> created = CreateFile(file, OwnLock());
    if (created && *created) {
      PlaceLock lock(file);
      const Result<std::string> other = OtherLock(place, fs::path(file).filename().string());
      if (!other) return tl::unexpected(other.error());
      if (other->empty()) return lock;
      const Owner owner = Owner::Parse(ReadText(*other).value_or(""));
      return MakeError(ErrorCode::kOverloaded,
                       "{}: process {} on host {} is baking there, all of it or another division into shards; wait for "
                       "it, or remove {} if that process has ended",
                       place, owner.pid, owner.host, *other);
    }
    if (!created) return CannotCreate(file, created.error());
    const Result<std::string> text = ReadText(file);
    if (!text && text.error().code == ErrorCode::kNotFound) continue;  // removed meanwhile
    if (!text) return tl::unexpected(text.error());
    const Owner owner = Owner::Parse(*text);
    if (!owner.HasEnded()) {
      return MakeError(ErrorCode::kOverloaded,
                       "{}: process {} on host {} is baking there; wait for it, or remove {} if that process has ended",
                       place, owner.pid, owner.host, file);
    }
    RemoveStaleLock(file);
  }
  return MakeError(ErrorCode::kOverloaded, "{}: another bake has just begun there; wait for it", place);
}

PlaceLock::PlaceLock(PlaceLock&& other) noexcept : file_(std::exchange(other.file_, {})) {}

PlaceLock::~PlaceLock() {
  // In a bucket, another process may have replaced it.
  if (!file_.empty() && ReadText(file_).value_or("") == OwnLock() + '\n') Remove(file_);
}

Result<void> ClaimPlace(const std::string& place, const BakeIdentity& identity, std::uint64_t generation,
                        bool is_exported_later) {
  const Result<std::vector<std::string>> names = NamesIn(place);
  if (!names) return tl::unexpected(names.error());
  std::string content;
  for (const std::string& name : *names) {
    if (IsContent(name)) content = name;
    if (IsOurs(name) || (is_exported_later && name == kExportFolder)) continue;
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: holds something that is no bake ({}); give an empty or a new folder with --out", place, name);
  }
  const fs::path file = fs::path(place) / kIdentityFile;
  const auto check_noted = [&]() -> Result<void> {
    const Result<std::string> noted = ReadText(file);
    return noted ? CheckSame(place, *noted, identity, file.string()) : tl::unexpected(noted.error());
  };
  const Result<void> noted = check_noted();
  bool is_known = noted.has_value();
  if (!noted && noted.error().code != ErrorCode::kNotFound) return noted;
  std::vector<std::string> archives = {place};
  for (const auto& [name, format] : archive::kFormatNames) archives.push_back(fmt::format("{}/{}", place, name));
  for (const std::string& archive : archives) {
    const auto manifest = archive::ReadManifest(archive);
    if (!manifest && manifest.error().code == ErrorCode::kNotFound) continue;
    if (!manifest) return tl::unexpected(manifest.error());
    is_known = true;
    if (auto same = CheckSame(place, manifest->identity, identity, archive); !same) return same;
    if (manifest->dataset.generation != generation) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: holds a finished bake of version {}, and the sources are of version {} now; bake them into "
                       "another folder with --out NEW --update {}",
                       place, tiler::VersionText(manifest->dataset.generation), tiler::VersionText(generation), place);
    }
  }
  if (!is_known && !content.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: holds {}, but neither {} nor {} says of which bake; give an empty or a new folder with --out",
                     place, content, kIdentityFile, archive::kManifestFile);
  }
  const Result<bool> created = CreateFile(file.string(), ToJson(identity));
  if (!created) return CannotCreate(file.string(), created.error());
  if (!*created) return check_noted();  // it was there, or is of another shard
  return {};
}

namespace {

// Removes what killed processes have left: unfinished files, and the locks of those that have certainly ended. A lock
// of another machine stays, because it is not known here whether its owner still runs.
void RemoveLeftovers(const std::string& place, const std::vector<fs::path>& folders) {
  std::vector<fs::path> leftovers;
  for (const fs::path& folder : folders) {
    for (const fs::path& within : {folder, folder / "units"}) {
      for (const std::string& name : NamesIn(within).value_or(std::vector<std::string>())) {
        if (IsPartial(name)) leftovers.push_back(within / name);
      }
    }
  }
  for (const std::string& name : NamesIn(place).value_or(std::vector<std::string>())) {
    const fs::path file = fs::path(place) / name;
    if (IsLock(name) && Owner::Parse(ReadText(file).value_or("")).HasEnded()) RemoveStaleLock(file.string());
  }
  for (const fs::path& file : leftovers) Remove(file);
}

}  // namespace

void TidyPlace(const std::string& place, const std::vector<archive::Manifest>& manifests) {
  std::vector<fs::path> folders = {place};
  for (const archive::Manifest& manifest : manifests) {
    const fs::path folder = ArchivePlace(place, manifest, manifests.size() == 1);
    folders.push_back(folder);
    std::set<std::string> wanted;
    for (const archive::UnitEntry& unit : manifest.units) {
      if (unit.tiles > 0) wanted.insert(fs::path(archive::UnitPath(unit.name)).filename().string());
    }
    std::vector<fs::path> unknown;
    for (const fs::path& within : {folder, folder / "units"}) {
      for (const std::string& name : NamesIn(within).value_or(std::vector<std::string>())) {
        if (name.ends_with(".pmtiles") && !wanted.contains(name)) unknown.push_back(within / name);
      }
    }
    for (const fs::path& file : unknown) Remove(file);
  }
  RemoveLeftovers(place, folders);
  Remove(fs::path(place) / kPlaceIdFile);
}

Result<std::string> PlaceId(const std::string& place) {
  const fs::path file = fs::path(place) / kPlaceIdFile;
  std::random_device random;
  const Result<bool> created = CreateFile(file.string(), fmt::format("{:08x}{:08x}", random(), random()));
  if (!created) return CannotCreate(file.string(), created.error());
  const Result<std::string> text = ReadText(file);
  if (!text) return tl::unexpected(text.error());
  std::string id;
  std::istringstream(*text) >> id;
  if (!id.empty()) return id;
  return MakeError(ErrorCode::kUnavailable, "{} is empty; remove it", file.string());
}

bool TidyIfFinished(const std::string& place, const std::vector<archive::Manifest>& manifests) {
  std::vector<fs::path> folders = {place};
  for (const archive::Manifest& manifest : manifests) {
    folders.emplace_back(ArchivePlace(place, manifest, manifests.size() == 1));
    if (!Exists(folders.back() / archive::kManifestFile).value_or(false)) return false;
  }
  RemoveLeftovers(place, folders);
  Remove(fs::path(place) / kPlaceIdFile);
  return true;
}

void RemoveNotesIfEmpty(const std::string& place, const std::string& own_lock) {
  const Result<std::vector<std::string>> names = NamesIn(place);
  if (!names) return;
  for (const std::string& name : *names) {
    if (name != kIdentityFile && name != kPlaceIdFile && name != fmt::format("bake-{}.lock", own_lock)) return;
  }
  Remove(fs::path(place) / kPlaceIdFile);
  Remove(fs::path(place) / kIdentityFile);
}

void RemoveLocksOfJob(const std::string& place, const std::string& job, const std::string& except_worker) {
  const std::string own = fmt::format("bake-{}.lock", LockOfWorker(except_worker, job));
  const std::string ending = LockOfWorker("", job) + ".lock";
  for (const std::string& name : NamesIn(place).value_or(std::vector<std::string>())) {
    if (IsLock(name) && name.ends_with(ending) && name != own) Remove(fs::path(place) / name);
  }
}

std::string LockOfWorker(const std::string& worker, const std::string& job) {
  return fmt::format("{}-of-job-{}", worker, job);
}

}  // namespace terrace::bake
