#include "server/cli/mesh_output.h"

namespace terrace::cli {

Result<MeshOutput> MeshOutput::Open(const std::string& path) {
  const auto format = proto::MeshFileFormatOf(path);
  if (!format) return tl::unexpected(format.error());
  Result<OutputFile> file = OutputFile::Open(path);
  if (!file) return tl::unexpected(std::move(file).error());
  return MeshOutput(*format, *std::move(file));
}

Result<void> MeshOutput::Write(const std::vector<proto::MeshVertex>& vertices,
                               const std::vector<std::array<std::uint32_t, 3>>& triangles,
                               const std::vector<proto::VertexColor>& colors) {
  Result<void> written = proto::WriteMesh(file_.stream(), format_, vertices, triangles, colors);
  return written ? file_.Commit() : written;
}

}  // namespace terrace::cli
