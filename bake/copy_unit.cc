#include "bake/copy_unit.h"

#include <algorithm>
#include <cstdint>
#include <memory>

#include "archive/files/input_file.h"
#include "archive/files/output_file.h"
#include "archive/unit_name.h"

namespace terrace::bake {

Result<archive::FileSummary> CopyUnit(const std::string& from, const std::string& to, const archive::UnitEntry& entry) {
  const std::string source = from + "/" + archive::UnitPath(entry.name);
  const Result<std::unique_ptr<const archive::InputFile>> in = archive::InputFile::Open(source);
  if (!in) return tl::unexpected(in.error());
  Result<archive::OutputFile> out = archive::OutputFile::Create(to + "/" + archive::UnitPath(entry.name));
  if (!out) return tl::unexpected(out.error());
  constexpr std::uint64_t kPiece = std::uint64_t{1} << 20;
  for (std::uint64_t at = 0; at < (*in)->size(); at += kPiece) {
    const Result<std::string> bytes = (*in)->Read(at, std::min(kPiece, (*in)->size() - at));
    if (!bytes) return tl::unexpected(bytes.error());
    if (auto written = out->Write(*bytes); !written) return tl::unexpected(written.error());
  }
  if (out->size() != entry.bytes || out->xxh3() != entry.xxh3) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: is not the file that its manifest describes", source);
  }
  if (auto finished = out->Finish(); !finished) return tl::unexpected(finished.error());
  return archive::FileSummary{entry.tiles, entry.bytes, entry.xxh3};
}

}  // namespace terrace::bake
