#include "bake/place.h"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

#include "engine/core/errno_text.h"
#include "tiler/encoder_version.h"

namespace terrace::bake {
namespace {

namespace fs = std::filesystem;

constexpr const char* kIdentityFile = "bake.json";
constexpr const char* kPlaceIdFile = "bake-place.id";

std::string HostName() {
  std::array<char, 256> name{};
  if (::gethostname(name.data(), name.size() - 1) != 0) return "unknown";
  return name.data();
}

std::string ReadText(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

// The start of a process in the kernel's ticks. It differs for a later process with the same number. Empty: unknown.
std::string StartOf(long pid) {
  const std::string stat = ReadText(fmt::format("/proc/{}/stat", pid));
  const std::size_t name_end = stat.rfind(')');
  if (name_end == std::string::npos) return {};
  std::istringstream fields(stat.substr(name_end + 1));
  std::string field;
  constexpr int kStart = 20;  // counted after the name
  for (int i = 0; i < kStart; ++i) fields >> field;
  return field;
}

// The name of this process's temporary file, which is renamed to `file`.
std::string OwnPartial(const std::string& file) {
  return fmt::format("{}.{}.{}.partial", file, HostName(), ::getpid());
}

// Identifies the namespace of process numbers: a container has its own.
std::string NumberSpace() {
  std::error_code error;
  const std::string space = fs::read_symlink("/proc/self/ns/pid", error).string();
  return error ? "unknown" : space;
}

// Identifies the boot of the kernel.
std::string BootOf() {
  std::string boot;
  std::istringstream(ReadText("/proc/sys/kernel/random/boot_id")) >> boot;
  return boot.empty() ? "unknown" : boot;
}

// The owner of a lock, as its file states it: host, process, its start, boot, namespace of process numbers.
struct Owner {
  std::string host, pid, start, boot, space;

  static Owner Parse(const std::string& text) {
    Owner owner;
    std::istringstream(text) >> owner.host >> owner.pid >> owner.start >> owner.boot >> owner.space;
    return owner;
  }
  // Whether the process has certainly ended. Nothing is known about processes of other hosts and containers.
  bool HasEnded() const {
    if (host != HostName()) return false;
    if (boot != BootOf()) return true;
    if (space != NumberSpace()) return false;
    long number = 0;
    const auto [end, error] = std::from_chars(pid.data(), pid.data() + pid.size(), number);
    if (error != std::errc() || number <= 0) return false;
    if (::kill(static_cast<pid_t>(number), 0) != 0 && errno == ESRCH) return true;
    const std::string now = StartOf(number);
    return !start.empty() && !now.empty() && now != start;
  }
};

Result<void> MakeFolder(const std::string& place) {
  std::error_code error;
  if (fs::exists(place, error) && !fs::is_directory(place, error)) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: is a file; a bake needs a folder: give another place with --out",
                     place);
  }
  fs::create_directories(place, error);
  if (!fs::is_directory(place)) {
    return MakeError(ErrorCode::kUnavailable, "{}: cannot be created: {}; give a folder that can be written with --out",
                     place, error.message());
  }
  if (::access(place.c_str(), W_OK | X_OK) != 0) {
    return MakeError(ErrorCode::kUnavailable, "{}: cannot be written: {}; give a folder that can be written with --out",
                     place, ErrorText());
  }
  return {};
}

// Creates a file together with its content, so that no process reads it empty. Fails with EEXIST if it exists. Returns
// errno.
int CreateFile(const std::string& file, const std::string& content) {
  const std::string own = OwnPartial(file);
  {
    std::ofstream out(own, std::ios::binary);
    out << content << '\n';
    out.flush();
    if (!out) {
      const int error = errno != 0 ? errno : EIO;
      ::unlink(own.c_str());
      return error;
    }
  }
  int error = ::link(own.c_str(), file.c_str()) == 0 ? 0 : errno;
  if (error == EPERM || error == EOPNOTSUPP) {  // a file system without links
    const int made = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    error = made < 0 ? errno : 0;
    if (made >= 0) ::close(made);
    if (error == 0 && ::rename(own.c_str(), file.c_str()) != 0) error = errno;
  }
  ::unlink(own.c_str());
  return error;
}

// Creates the lock file. Returns errno.
int CreateLock(const std::string& file) {
  return CreateFile(
      file, fmt::format("{} {} {} {} {}", HostName(), ::getpid(), StartOf(::getpid()), BootOf(), NumberSpace()));
}

bool IsLock(const std::string& name) { return name.starts_with("bake") && name.ends_with(".lock"); }

// Whether it is an unfinished file of a lock, an identity, a manifest or a unit.
bool IsPartial(const std::string& name) {
  const bool is_ours = name.starts_with("bake") || name.starts_with(archive::kManifestFile) ||
                       name.find(".pmtiles.") != std::string::npos;
  return is_ours && name.ends_with(".partial");
}

// A lock in `place` that excludes `own`, and whose process may be running; empty: none. Locks of one division into
// shards do not exclude one another.
std::string OtherLock(const std::string& place, const std::string& own) {
  const auto division = [](const std::string& name) {
    const std::size_t of = name.rfind("-of-");
    return of == std::string::npos ? name : name.substr(of);
  };
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(place, error)) {
    const std::string name = entry.path().filename().string();
    if (!IsLock(name) || name == own || (division(name) == division(own) && name != "bake.lock")) continue;
    if (!Owner::Parse(ReadText(entry.path())).HasEnded()) return entry.path().string();
  }
  return {};
}

// Whether it is a file or folder of tiles.
bool IsContent(const std::string& name) {
  return name == archive::UnitPath("top") || name == "units" ||
         std::ranges::any_of(archive::kFormatNames, [&](const auto& format) { return format.second == name; });
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
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: does not say what is baked there; remove the folder {}, or give another with --out", noted_in,
                     place);
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
    const int error = CreateLock(file);
    if (error == 0) {
      PlaceLock lock(file);
      const std::string other = OtherLock(place, fs::path(file).filename().string());
      if (other.empty()) return lock;
      const Owner owner = Owner::Parse(ReadText(other));
      return MakeError(ErrorCode::kOverloaded,
                       "{}: process {} on host {} is baking there, all of it or another division into shards; wait for "
                       "it, or remove {} if that process has ended",
                       place, owner.pid, owner.host, other);
    }
    if (error != EEXIST) {
      return MakeError(ErrorCode::kUnavailable,
                       "{}: cannot be written: {}; give a folder with room that can be written", file,
                       ErrorText(error));
    }
    const std::string text = ReadText(file);
    const Owner owner = Owner::Parse(text);
    if (!owner.HasEnded()) {
      return MakeError(ErrorCode::kOverloaded,
                       "{}: process {} on host {} is baking there; wait for it, or remove {} if that process has ended",
                       place, owner.pid, owner.host, file);
    }
    // Removes the lock that was read, but not one with which another process has replaced it meanwhile.
    const std::string stale = OwnPartial(file);
    if (::rename(file.c_str(), stale.c_str()) != 0) continue;
    if (ReadText(stale) != text) ::link(stale.c_str(), file.c_str());
    ::unlink(stale.c_str());
  }
  return MakeError(ErrorCode::kOverloaded, "{}: another bake has just begun there; wait for it", place);
}

PlaceLock::PlaceLock(PlaceLock&& other) noexcept : file_(std::exchange(other.file_, {})) {}

PlaceLock::~PlaceLock() {
  if (!file_.empty()) ::unlink(file_.c_str());
}

Result<void> ClaimPlace(const std::string& place, const BakeIdentity& identity, std::uint64_t generation) {
  std::error_code error;
  std::string content;
  for (const auto& entry : fs::directory_iterator(place, error)) {
    const std::string name = entry.path().filename().string();
    if (IsContent(name)) content = name;
    if (IsOurs(name)) continue;
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: holds something that is no bake ({}); give an empty or a new folder with --out", place, name);
  }
  if (error) return MakeError(ErrorCode::kUnavailable, "{}: cannot be read: {}", place, error.message());
  const fs::path file = fs::path(place) / kIdentityFile;
  bool is_known = fs::exists(file, error);
  if (is_known) {
    if (auto same = CheckSame(place, ReadText(file), identity, file.string()); !same) return same;
  }
  std::vector<std::string> archives = {place};
  for (const auto& [format, name] : archive::kFormatNames) archives.push_back(fmt::format("{}/{}", place, name));
  for (const std::string& archive : archives) {
    if (!fs::exists(fs::path(archive) / archive::kManifestFile, error)) continue;
    is_known = true;
    const auto manifest = archive::ReadManifest(archive);
    if (!manifest) return tl::unexpected(manifest.error());
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
                     "{}: holds {}, but nothing says that it is of a bake; give an empty or a new folder with --out",
                     place, content);
  }
  if (fs::exists(file, error)) return {};
  const int why = CreateFile(file.string(), ToJson(identity));
  if (why == EEXIST) return CheckSame(place, ReadText(file), identity, file.string());  // of another shard
  if (why != 0) return MakeError(ErrorCode::kUnavailable, "{}: cannot be written: {}", file.string(), ErrorText(why));
  return {};
}

namespace {

// Removes what killed processes have left: unfinished files, and the locks of those that have certainly ended. A lock
// of another host stays, because it is not known here whether its owner still runs.
void RemoveLeftovers(const std::string& place, const std::vector<fs::path>& folders) {
  std::error_code ignored;
  std::vector<fs::path> leftovers;
  for (const fs::path& folder : folders) {
    for (const fs::path& within : {folder, folder / "units"}) {
      for (const auto& entry : fs::directory_iterator(within, ignored)) {
        if (IsPartial(entry.path().filename().string())) leftovers.push_back(entry.path());
      }
    }
  }
  for (const auto& entry : fs::directory_iterator(place, ignored)) {
    const std::string name = entry.path().filename().string();
    if (IsLock(name) && Owner::Parse(ReadText(entry.path())).HasEnded()) leftovers.push_back(entry.path());
  }
  for (const fs::path& file : leftovers) fs::remove(file, ignored);
}

}  // namespace

void TidyPlace(const std::string& place, const std::vector<archive::Manifest>& manifests) {
  std::error_code ignored;
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
      for (const auto& entry : fs::directory_iterator(within, ignored)) {
        const std::string name = entry.path().filename().string();
        if (name.ends_with(".pmtiles") && !wanted.contains(name)) unknown.push_back(entry.path());
      }
    }
    for (const fs::path& file : unknown) fs::remove(file, ignored);
  }
  RemoveLeftovers(place, folders);
  fs::remove(fs::path(place) / kPlaceIdFile, ignored);
  fs::remove(fs::path(place) / kIdentityFile, ignored);
}

Result<std::string> PlaceId(const std::string& place) {
  const fs::path file = fs::path(place) / kPlaceIdFile;
  std::random_device random;
  const int error = CreateFile(file.string(), fmt::format("{:08x}{:08x}", random(), random()));
  std::string id;
  std::istringstream(ReadText(file)) >> id;
  if (!id.empty()) return id;
  return MakeError(ErrorCode::kUnavailable, "{}: cannot be {}: {}", file.string(),
                   error != 0 && error != EEXIST ? "written" : "read", ErrorText(error == EEXIST ? EIO : error));
}

bool RemoveNotesIfFinished(const std::string& place, const std::vector<archive::Manifest>& manifests) {
  std::error_code ignored;
  std::vector<fs::path> folders = {place};
  for (const archive::Manifest& manifest : manifests) {
    folders.emplace_back(ArchivePlace(place, manifest, manifests.size() == 1));
    if (!fs::exists(folders.back() / archive::kManifestFile, ignored)) return false;
  }
  RemoveLeftovers(place, folders);
  fs::remove(fs::path(place) / kPlaceIdFile, ignored);
  fs::remove(fs::path(place) / kIdentityFile, ignored);
  return true;
}

void RemoveNotesIfEmpty(const std::string& place, const std::string& own_lock) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(place, error)) {
    const std::string name = entry.path().filename().string();
    if (name != kIdentityFile && name != kPlaceIdFile && name != fmt::format("bake-{}.lock", own_lock)) return;
  }
  fs::remove(fs::path(place) / kPlaceIdFile, error);
  fs::remove(fs::path(place) / kIdentityFile, error);
}

void RemoveLocksOfJob(const std::string& place, const std::string& job, const std::string& but_of_worker) {
  const std::string own = fmt::format("bake-{}.lock", LockOfWorker(but_of_worker, job));
  const std::string ending = LockOfWorker("", job) + ".lock";
  std::error_code ignored;
  std::vector<fs::path> locks;
  for (const auto& entry : fs::directory_iterator(place, ignored)) {
    const std::string name = entry.path().filename().string();
    if (IsLock(name) && name.ends_with(ending) && name != own) locks.push_back(entry.path());
  }
  for (const fs::path& lock : locks) fs::remove(lock, ignored);
}

std::string LockOfWorker(const std::string& worker, const std::string& job) {
  return fmt::format("{}-of-job-{}", worker, job);
}

}  // namespace terrace::bake
