#include "server/cli/mesh/mesh_output.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

namespace terrace::cli {

Result<MeshOutput> MeshOutput::Open(const std::string& path, const std::vector<std::string>& inputs) {
  for (const std::string& input : inputs) {
    std::error_code ignored;
    if (!std::filesystem::equivalent(path, input, ignored)) continue;
    return MakeError(ErrorCode::kInvalidArgument, "--out: {} is the file that is read; give the mesh another name",
                     path);
  }
  const auto format = proto::MeshFileFormatOf(path);
  if (!format) return tl::unexpected(format.error());
  Result<ReplacedFile> file = ReplacedFile::Open(path);
  if (!file) return tl::unexpected(std::move(file).error());
  return MeshOutput(*format, *std::move(file));
}

Result<void> MeshOutput::Write(std::vector<proto::MeshVertex> vertices,
                               const std::vector<std::array<std::uint32_t, 3>>& triangles,
                               const proto::GridPlacement& placement, const std::vector<Rgb>& colors) {
  Result<void> written = proto::WriteMesh(file_.stream(), format_, std::move(vertices), triangles, colors, placement);
  if (!written) return MakeError(written.error().code, "{}: {}", file_.path(), written.error().message);
  return file_.Commit();
}

Result<void> MeshOutput::Write(const std::string& bytes) {
  file_.stream() << bytes;
  return file_.Commit();
}

std::int64_t PeakRssBytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::int64_t>(usage.ru_maxrss) * 1024;
}

std::string TextOfVoids(std::size_t voids) {
  return voids == 0 ? "" : fmt::format(" and across {} void{}", voids, voids == 1 ? "" : "s");
}

void ReportUnused(const std::string& input, std::size_t points, std::size_t vertices) {
  if (vertices >= points) return;
  fmt::print(stderr, "terrace: {}: {} vertices meet every sample; there is no use for {}\n", input, vertices, points);
}

}  // namespace terrace::cli
