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
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

#include "tiler/encoder_version.h"

namespace terrace::bake {
namespace {

namespace fs = std::filesystem;

constexpr const char* kIdentityFile = "bake.json";

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

std::string WhyOf(int error) { return std::generic_category().message(error); }

// When a process began, in the kernel's ticks: tells a process from a later one with the same number. Empty: unknown.
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

// The owner as the lock file has it: host, process, its start.
struct Owner {
  std::string host, pid, start;

  static Owner Parse(const std::string& text) {
    Owner owner;
    std::istringstream(text) >> owner.host >> owner.pid >> owner.start;
    return owner;
  }
  // Whether the process has surely ended. Of other hosts nothing is known.
  bool HasEnded() const {
    if (host != HostName()) return false;
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
                     place, WhyOf(errno));
  }
  return {};
}

// Creates the lock file with its content at once, so that no one sees it empty. Returns errno.
int CreateLock(const std::string& file) {
  const std::string own = fmt::format("{}.{}.{}.partial", file, HostName(), ::getpid());
  {
    std::ofstream out(own, std::ios::binary);
    out << HostName() << ' ' << ::getpid() << ' ' << StartOf(::getpid()) << '\n';
    out.flush();
    if (!out) {
      const int error = errno != 0 ? errno : EIO;
      ::unlink(own.c_str());
      return error;
    }
  }
  const int error = ::link(own.c_str(), file.c_str()) == 0 ? 0 : errno;
  ::unlink(own.c_str());
  return error;
}

bool IsOurs(const std::string& name) {
  static const std::set<std::string> kNames = {
      kIdentityFile, archive::kManifestFile, "top.pmtiles", "units", "terrain", "glb", "png", "lost+found"};
  return kNames.contains(name) || name.ends_with(".lock") || name.ends_with(".partial");
}

// The differences between a noted identity and this one, as one sentence; empty: none.
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
    if (error == 0) return PlaceLock(file);
    if (error != EEXIST) {
      return MakeError(ErrorCode::kUnavailable,
                       "{}: cannot be written: {}; give a folder with room that can be written", file, WhyOf(error));
    }
    const std::string text = ReadText(file);
    const Owner owner = Owner::Parse(text);
    if (!owner.HasEnded()) {
      return MakeError(ErrorCode::kOverloaded,
                       "{}: process {} on host {} is baking there; wait for it, give each process a part with --shard, "
                       "or remove {} if that process has ended",
                       place, owner.pid, owner.host, file);
    }
    // Another process may have taken it over meanwhile: only the lock that was read is removed.
    const std::string stale = fmt::format("{}.{}.{}.partial", file, HostName(), ::getpid());
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
  for (const auto& entry : fs::directory_iterator(place, error)) {
    const std::string name = entry.path().filename().string();
    if (IsOurs(name)) continue;
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: holds something that is no bake ({}); give an empty or a new folder with --out", place, name);
  }
  if (error) return MakeError(ErrorCode::kUnavailable, "{}: cannot be read: {}", place, error.message());
  const fs::path file = fs::path(place) / kIdentityFile;
  if (fs::exists(file, error)) return CheckSame(place, ReadText(file), identity, file.string());
  for (const char* folder : {"", "/terrain", "/glb", "/png"}) {
    const std::string archive = place + folder;
    if (!fs::exists(fs::path(archive) / archive::kManifestFile, error)) continue;
    const auto manifest = archive::ReadManifest(archive);
    if (!manifest) return tl::unexpected(manifest.error());
    if (auto same = CheckSame(place, manifest->options, identity, archive); !same) return same;
    if (manifest->dataset.generation != generation) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: holds a finished bake of version {}, and the sources are of version {} now; bake them into "
                       "another folder with --out NEW --update {}",
                       place, tiler::VersionText(manifest->dataset.generation), tiler::VersionText(generation), place);
    }
  }
  const std::string partial = file.string() + ".partial";
  {
    std::ofstream out(partial, std::ios::binary);
    out << ToJson(identity) << '\n';
    out.flush();
    if (!out) {
      const int why = errno;
      ::unlink(partial.c_str());
      return MakeError(ErrorCode::kUnavailable, "{}: cannot be written: {}", file.string(), WhyOf(why));
    }
  }
  fs::rename(partial, file, error);
  if (error) return MakeError(ErrorCode::kUnavailable, "{}: cannot be written: {}", file.string(), error.message());
  return {};
}

void TidyPlace(const std::string& place, const std::vector<archive::Manifest>& manifests) {
  std::error_code ignored;
  for (const archive::Manifest& manifest : manifests) {
    const fs::path folder = ArchivePlace(place, manifest, manifests.size() == 1);
    std::set<std::string> wanted;
    for (const archive::UnitEntry& unit : manifest.units) {
      if (unit.tiles > 0) wanted.insert(fs::path(archive::UnitPath(unit.name)).filename().string());
    }
    std::vector<fs::path> leftovers;
    for (const fs::path& within : {folder, folder / "units"}) {
      for (const auto& entry : fs::directory_iterator(within, ignored)) {
        const std::string name = entry.path().filename().string();
        const bool is_unit = name.ends_with(".pmtiles");
        if ((is_unit && !wanted.contains(name)) || name.ends_with(".partial")) leftovers.push_back(entry.path());
      }
    }
    for (const fs::path& file : leftovers) fs::remove(file, ignored);
  }
  fs::remove(fs::path(place) / kIdentityFile, ignored);
}

}  // namespace terrace::bake
