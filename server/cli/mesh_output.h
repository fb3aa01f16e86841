// What the kinds of `terrace mesh` have in common: the file they write and the times they tell.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "proto/mesh_file.h"
#include "server/cli/output_file.h"

namespace terrace::cli {

class MeshOutput {
 public:
  // Before the work: a folder that is missing costs no time. kInvalidArgument: no such format.
  static Result<MeshOutput> Open(const std::string& path);

  // The whole file. `colors` is empty or by vertex.
  Result<void> Write(const std::vector<proto::MeshVertex>& vertices,
                     const std::vector<std::array<std::uint32_t, 3>>& triangles,
                     const std::vector<proto::VertexColor>& colors = {});

 private:
  MeshOutput(proto::MeshFileFormat format, OutputFile file) : format_(format), file_(std::move(file)) {}

  proto::MeshFileFormat format_;
  OutputFile file_;
};

struct MeshSeconds {
  double read = 0, triangulate = 0, write = 0;
};

inline double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace terrace::cli
