#include <array>
#include <optional>

#include "engine/tin/mesh/spare_blocks.h"
#include "tests/bench/greedy_runs.h"
#include "tests/bench/rasters.h"
#include "tests/bench/resident_memory.h"
#include "tests/bench/targets.h"

namespace terrace::bench {
namespace {

struct Peak {
  std::size_t meshing_bytes = 0;   // of the triangulation while it runs
  std::size_t finished_bytes = 0;  // of the triangulation and of the mesh made from it; the larger peak
  std::size_t points = 0;
};

// The peak in blocks, if there are several; it includes the meshes of finished blocks.
Peak BlocksPeak(const tin::HeightField& field, const tin::GreedyGoal& goal) {
  tin::ReleaseSpareBlocks();
  const ResidentMemory memory;
  Peak peak;
  const tin::TinMesh mesh = MeshInBlocks(field, goal);
  peak.points = mesh.vertices.size();
  peak.meshing_bytes = peak.finished_bytes = memory.PeakBytes();
  return peak;
}

Peak MeshingPeak(const tin::HeightField& field, const tin::GreedyGoal& goal) {
  tin::ReleaseSpareBlocks();
  const ResidentMemory memory;
  Peak peak;
  tin::GreedyTriangulation tin(field);
  tin.Run(goal);
  peak.meshing_bytes = memory.PeakBytes();
  peak.points = tin.Mesh().vertices.size();
  peak.finished_bytes = memory.PeakBytes();
  return peak;
}

}  // namespace

Table MeasureMemory(Environment& environment) {
  Table table(
      "T7", "T7: peak of resident memory, bytes",
      {"case", "samples n", "vertices m", "field", "meshing", "(field + meshing - 4.1 n) / m", "with its mesh", "aim"});
  struct Case {
    const char* name;
    const char* file;
    Window window;
    tin::GreedyGoal goal;
    bool in_blocks = false;
  };
  const std::array<Case, 6> cases = {{
      {"jacksboro 5 m", "jacksboro.tif", {}, {5}},
      {"andes 257x257 5 m", "srtm3_S33W071_andes.tif", {500, 300, 257, 257}, {5}},
      {"crater 5 m", "crater.tif", {}, {5}},
      {"west-us 50000", "westUS.tif", {}, {0, 50000}},
      {"west-us 5 m", "westUS.tif", {}, {5}},
      {"west-us 5 m in blocks", "westUS.tif", {}, {5}, true},
  }};
  for (const Case& c : cases) {
    const std::string row = fmt::format("T7 {}", c.name);
    if (!environment.Wants(row)) continue;
    const std::optional<tin::HeightField> field = ReadField(c.file, c.window);
    if (!field) continue;
    const Peak peak = c.in_blocks ? BlocksPeak(*field, c.goal) : MeshingPeak(*field, c.goal);
    const auto n = static_cast<double>(field->width()) * static_cast<double>(field->height());
    const std::size_t field_bytes =
        sizeof(float) * static_cast<std::size_t>(field->stride()) * static_cast<std::size_t>(field->height());
    const double per_vertex =
        (static_cast<double>(field_bytes + peak.meshing_bytes) - 4.1 * n) / static_cast<double>(peak.points);
    table.Add({row, Count(static_cast<std::size_t>(n)), Count(peak.points), Count(field_bytes),
               Count(peak.meshing_bytes), Number(per_vertex, 3), Count(peak.finished_bytes), "80"});
  }
  return table;
}

}  // namespace terrace::bench
