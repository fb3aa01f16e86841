#include "archive/manifest.h"

#include <limits>
#include <utility>

#include "archive/files/input_file.h"
#include "archive/files/output_file.h"
#include "archive/manifest_json.h"
#include "archive/pmtiles/pmtiles_file.h"

namespace terrace::archive {
namespace {

// Ten times as many as the manifest of all land of the Earth at 30 m has.
constexpr std::uint64_t kMaxManifestBytes = std::uint64_t{32} << 20;

Result<Manifest> WithPlace(const std::string& place, Result<Manifest> manifest) {
  if (manifest) return manifest;
  return MakeError(manifest.error().code, "{}: {}", place, manifest.error().message);
}

Result<Manifest> ReadSingle(const std::string& path) {
  const Result<std::unique_ptr<const PmtilesFile>> file = PmtilesFile::Open(path);
  if (!file) return tl::unexpected(file.error());
  return ManifestOf(path, (*file)->metadata());
}

// A manifest that is larger than readers take must not end a bake.
Result<void> CheckJson(const std::string& path, const std::string& json, std::size_t max_values) {
  Result<void> checked = CheckBounds(json, max_values);
  if (checked && json.size() > kMaxManifestBytes) {
    checked =
        MakeError(ErrorCode::kInvalidArgument, "it has {} bytes, and the limit is {}", json.size(), kMaxManifestBytes);
  }
  if (checked) return {};
  return MakeError(ErrorCode::kInvalidArgument, "{}: would be too large: {}; bake fewer levels or a smaller area", path,
                   checked.error().message);
}

}  // namespace

Result<void> CheckManifest(const std::string& place, Manifest manifest, std::size_t more_units,
                           std::size_t max_values) {
  constexpr std::uint64_t kWidest = std::numeric_limits<std::uint64_t>::max();
  const UnitEntry widest{"7-255-127", kWidest, kWidest, kWidest, std::string(32, 'f')};
  manifest.units.insert(manifest.units.end(), more_units, widest);
  return CheckJson(place + "/" + kManifestFile, ToJson(manifest), max_values);
}

Result<Manifest> ManifestOf(const std::string& path, const std::string& metadata) {
  const Result<std::string> json = ManifestIn(metadata);
  if (!json) return MakeError(json.error().code, "{} is no archive of terrace: {}", path, json.error().message);
  return WithPlace(path, ParseManifest(*json));
}

Result<void> WriteManifest(const std::string& place, const Manifest& manifest) {
  const std::string path = place + "/" + kManifestFile, json = ToJson(manifest);
  if (Result<void> checked = CheckJson(path, json, kMaxValues); !checked) return checked;
  if (const Result<std::string> there = ReadFile(path, kMaxManifestBytes); there && *there == json) return {};
  Result<OutputFile> out = OutputFile::Create(path);
  if (!out) return tl::unexpected(std::move(out.error()));
  if (Result<void> written = out->Write(json); !written) return written;
  return out->Finish();
}

Result<Manifest> ReadManifest(const std::string& place) {
  if (IsSingleFile(place)) return ReadSingle(place);
  const std::string path = place + "/" + kManifestFile;
  const Result<std::string> json = ReadFile(path, kMaxManifestBytes);
  if (!json && json.error().code == ErrorCode::kNotFound) {
    if (!MayExist(place)) {
      return MakeError(ErrorCode::kNotFound, "there is no {}; give the folder or file that 'terrace bake' wrote",
                       place);
    }
    return MakeError(
        ErrorCode::kNotFound,
        "{} has no {}: it is no archive, or its bake has not finished, or the file was removed; run the same "
        "bake again: it keeps the files that are there, and writes it",
        place, kManifestFile);
  }
  if (!json) return tl::unexpected(json.error());
  return WithPlace(path, ParseManifest(*json));
}

}  // namespace terrace::archive
