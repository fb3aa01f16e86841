// What the kinds of `terrace mesh` have in common: the file they write, and what they tell of it.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "engine/tin/mesh/height_field.h"
#include "proto/gltf/mesh_file.h"
#include "server/cli/mesh/output_file.h"

namespace terrace::cli {

class MeshOutput {
 public:
  // Before the work: a folder that is missing costs no time. kInvalidArgument: no such format, or one of the files that
  // are read.
  static Result<MeshOutput> Open(const std::string& path, const std::vector<std::string>& inputs);

  // The whole file. The vertices lie on the placement's grid; `colors` is empty or by vertex.
  Result<void> Write(std::vector<proto::MeshVertex> vertices,
                     const std::vector<std::array<std::uint32_t, 3>>& triangles, const proto::GridPlacement& placement,
                     const std::vector<proto::VertexColor>& colors = {});

 private:
  MeshOutput(proto::MeshFileFormat format, OutputFile file) : format_(format), file_(std::move(file)) {}

  proto::MeshFileFormat format_;
  OutputFile file_;
};

struct MeshSeconds {
  double read = 0, triangulate = 0, write = 0;
};

// Samples without a height, of which `measured` have one.
inline std::size_t VoidsOf(const tin::HeightField& field, std::size_t measured) {
  return static_cast<std::size_t>(field.width()) * static_cast<std::size_t>(field.height()) - measured;
}
std::string TextOfVoids(std::size_t voids);  // empty where there are none

// On stderr, where fewer vertices meet every sample than were asked for. 0: no number was.
void ReportUnused(const std::string& input, std::size_t points, std::size_t vertices);

inline double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace terrace::cli
