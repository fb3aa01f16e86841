#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <memory>
#include <new>
#include <utility>

#include "archive/files/input_file.h"
#include "archive/pmtiles/pmtiles_file.h"
#include "archive/pmtiles/pmtiles_writer.h"
#include "archive/tile_scheme.h"
#include "archive/tile_writer.h"

namespace terrace::archive {
namespace {

class UnitWriter final : public TileWriter {
 public:
  UnitWriter(std::string name, const UnitOptions& options, PmtilesWriter writer)
      : name_(std::move(name)), options_(options), writer_(std::move(writer)) {}

  Result<void> Add(const geo::TileKey& key, const tiler::EncodedTile& tile, const dem::HeightRange& range) override {
    const bool is_mercator = options_.kind.format == tiler::TileFormat::kHeightPng;
    if (!IsInScheme(key, is_mercator) || UnitNameOf(key) != name_) {
      return MakeError(ErrorCode::kInvalidArgument, "tile {} does not belong to unit {}", geo::ToString(key), name_);
    }
    return writer_.Add(TileIdOf(PmtilesKeyOf(key, is_mercator)), tile, range);
  }

  Result<UnitSummary> Finish() override { return writer_.Finish(UnitMetadata(options_.kind, options_.key)); }

 private:
  const std::string name_;
  const UnitOptions options_;
  PmtilesWriter writer_;
};

Result<std::string> HashOfFile(const std::string& path) {
  constexpr std::uint64_t kPiece = std::uint64_t{1} << 20;
  const Result<std::unique_ptr<const InputFile>> file = InputFile::Open(path);
  if (!file) return tl::unexpected(file.error());
  const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(), XXH3_freeState);
  if (state == nullptr) throw std::bad_alloc();
  XXH3_128bits_reset(state.get());
  for (std::uint64_t at = 0; at < (*file)->size(); at += kPiece) {
    const Result<std::string> bytes = (*file)->Read(at, std::min(kPiece, (*file)->size() - at));
    if (!bytes) return tl::unexpected(bytes.error());
    XXH3_128bits_update(state.get(), bytes->data(), bytes->size());
  }
  const XXH128_hash_t hash = XXH3_128bits_digest(state.get());
  return fmt::format("{:016x}{:016x}", hash.high64, hash.low64);
}

}  // namespace

Result<std::unique_ptr<TileWriter>> CreateUnit(const std::string& place, const std::string& name,
                                               const UnitOptions& options) {
  const Result<std::optional<geo::TileKey>> root = UnitRoot(name);
  if (!root) return tl::unexpected(root.error());
  const Result<PmtilesOptions> file_options = PmtilesOptionsOf(options.kind, *root);
  if (!file_options) return tl::unexpected(file_options.error());
  Result<PmtilesWriter> writer = PmtilesWriter::Create(place + "/" + UnitPath(name), *file_options);
  if (!writer) return tl::unexpected(std::move(writer.error()));
  return std::make_unique<UnitWriter>(name, options, *std::move(writer));
}

Result<UnitSummary> VerifyUnit(const std::string& place, const std::string& name, std::uint64_t key) {
  const std::string path = place + "/" + UnitPath(name);
  const auto as_damaged = [](Error error) {
    if (error.code == ErrorCode::kUnavailable) error.code = ErrorCode::kInvalidArgument;
    return tl::unexpected(std::move(error));
  };
  const Result<std::unique_ptr<const PmtilesFile>> file = PmtilesFile::Open(path);
  if (!file) return as_damaged(file.error());
  if (UnitKeyIn((*file)->metadata()) != key) {
    return MakeError(ErrorCode::kInvalidArgument, "{} was baked from other sources or with other options", path);
  }
  UnitSummary summary;
  const Result<void> read = (*file)->ForEach([&](std::uint64_t, const CheckedTile&) -> Result<void> {
    ++summary.tiles;
    return {};
  });
  if (!read) return as_damaged(read.error());
  summary.bytes = (*file)->bytes();
  const Result<std::string> hash = HashOfFile(path);
  if (!hash) return as_damaged(hash.error());
  summary.xxh3 = *hash;
  return summary;
}

}  // namespace terrace::archive
