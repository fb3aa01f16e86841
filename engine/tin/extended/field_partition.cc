#include "engine/tin/extended/field_partition.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "engine/core/check.h"
#include "engine/tin/border.h"
#include "engine/tin/greedy.h"

namespace terrace::tin {
namespace {

constexpr int kSmallestBlockCells = 256;

// Weight of errors on a border between blocks. A line of samples keeps a bound with vertices three times as far apart
// as a surface. If a border has few vertices, the fans of slivers along it need more vertices inside the blocks than a
// denser border would have. The best weight lies between 1.3 and 2.
constexpr BorderOptions kSharedBorder{.weight = 1.5};

// A cut is good if the vertices on its borders are below this share of those estimated for the whole field.
constexpr double kMaxSharedVertices = 0.05;

// No cut is good if fewer vertices are estimated (the estimate is a third of the final number): then the position of
// the first vertices changes the count by more than the borders add, and meshing the whole field takes little time.
constexpr double kMinVertices = 4000;

// No cut is good if heights and triangles of the whole field take less: they nearly fit into the second-level cache.
constexpr double kMinBytes = 2 << 20, kBytesOfSample = 4, kBytesOfEstimatedVertex = 48;

// The first samples of the blocks along a side, and the side's last sample.
std::vector<int> CutSide(int samples, int block_cells) {
  const int cells = samples - 1, blocks = std::max(1, (cells + block_cells / 2) / block_cells);
  std::vector<int> cuts;
  for (int i = 0; i <= blocks; ++i) cuts.push_back(static_cast<int>(std::int64_t{cells} * i / blocks));
  return cuts;
}

// The number of vertices of a border between two corners of blocks, including one corner.
double CountBorderVertices(const HeightField& field, Corner from, Corner to, double max_error_m) {
  double count = 0;
  std::vector<Corner> ends{to};  // of the remaining edges, the nearest last
  while (!ends.empty()) {
    const Candidate worst = WorstBorderSample(field, from, ends.back(), kSharedBorder);
    if (worst.error > max_error_m) {
      const SamplePosition at = PositionOf(worst.sample);
      ends.push_back({at.x, at.y, static_cast<double>(field.At(at.x, at.y))});
      continue;
    }
    ++count;
    from = ends.back();
    ends.pop_back();
  }
  return count;
}

struct VertexEstimate {
  double shared = 0;     // on the borders between blocks, exactly
  double in_blocks = 0;  // borders included
};

// Estimates blocks as grids whose lines have as many vertices as the block's borders. For small blocks, a surface needs
// 1.5 to 3 times this number, more for coarser meshes. For larger blocks, which may have land only in a corner, the
// estimate is useless.
VertexEstimate EstimateVertices(const FieldPartition& cut, const HeightField& field, double max_error_m) {
  const auto corner = [&](int x, int y) -> Corner { return {x, y, static_cast<double>(field.VertexHeight(x, y))}; };
  const auto count = [&](const Corner& a, const Corner& b) { return CountBorderVertices(field, a, b, max_error_m); };
  VertexEstimate estimate;
  std::vector<double> far_by_column(cut.blocks_along_x());  // far border (y) of the block below
  double far_before = 0;                                    // far border (x) of the block before
  for (std::size_t i = 0; i < cut.size(); ++i) {
    const auto [x, y, width, height] = cut.block(i);
    const int last_x = x + width - 1, last_y = y + height - 1;
    const Corner a = corner(x, y), b = corner(last_x, y), c = corner(last_x, last_y), d = corner(x, last_y);
    double& below = far_by_column[i % far_by_column.size()];
    const double near_x = x > 0 ? far_before : count(a, d), far_x = count(b, c);
    const double near_y = y > 0 ? below : count(a, b), far_y = count(d, c);
    estimate.shared += (x > 0 ? near_x : 0) + (y > 0 ? near_y : 0);
    estimate.in_blocks += (near_x + far_x) / 2 * ((near_y + far_y) / 2);
    far_before = far_x;
    below = far_y;
  }
  return estimate;
}

bool IsWorthACut(const HeightField& field, double vertices) {
  const double samples = static_cast<double>(field.width()) * static_cast<double>(field.height());
  return vertices >= kMinVertices && kBytesOfSample * samples + kBytesOfEstimatedVertex * vertices >= kMinBytes;
}

// The samples of a block as a separate field. Its corners are vertices of the joined mesh and get their heights from
// it. So even a block of voids is a valid field, of two triangles.
HeightField CopyOf(const HeightField& field, const FieldBlock& block) {
  std::vector<float> heights;
  heights.reserve(static_cast<std::size_t>(block.width) * static_cast<std::size_t>(block.height));
  for (int y = block.y; y < block.y + block.height; ++y) {
    heights.insert(heights.end(), field.Row(y) + block.x, field.Row(y) + block.x + block.width);
  }
  for (const int y : {0, block.height - 1}) {
    for (const int x : {0, block.width - 1}) {
      heights[static_cast<std::size_t>(y) * static_cast<std::size_t>(block.width) + static_cast<std::size_t>(x)] =
          field.VertexHeight(block.x + x, block.y + y);
    }
  }
  Result<HeightField> copy = HeightField::Make(block.width, block.height, std::move(heights));
  TERRACE_CHECK(copy.has_value());
  return *std::move(copy);
}

std::optional<TinMesh> MeshTo(const HeightField& field, const GreedyOptions& options, double max_error_m,
                              std::stop_token stop) {
  GreedyTriangulation greedy(field, options);
  if (!greedy.Run({.max_error = max_error_m}, std::move(stop))) return std::nullopt;
  return greedy.Mesh();
}

}  // namespace

FieldPartition::FieldPartition(int width, int height, int block_cells) {
  TERRACE_CHECK(std::min(width, height) >= 2 && std::max(width, height) <= HeightField::kMaxSide && block_cells >= 1);
  columns_ = CutSide(width, block_cells);
  rows_ = CutSide(height, block_cells);
}

FieldPartition FieldPartition::For(const HeightField& field, double max_error_m) {
  int cells = kSmallestBlockCells;
  FieldPartition cut(field.width(), field.height(), cells);
  VertexEstimate estimate = EstimateVertices(cut, field, max_error_m);
  const double vertices = estimate.in_blocks;
  if (!IsWorthACut(field, vertices)) return {field.width(), field.height(), HeightField::kMaxSide};
  while (estimate.shared > kMaxSharedVertices * vertices) {  // ends at the latest when there is one block
    cells *= 2;
    cut = FieldPartition(field.width(), field.height(), cells);
    estimate = EstimateVertices(cut, field, max_error_m);
  }
  return cut;
}

FieldBlock FieldPartition::block(std::size_t i) const {
  const std::size_t column = i % blocks_along_x(), row = i / blocks_along_x();
  return {columns_[column], rows_[row], columns_[column + 1] - columns_[column] + 1, rows_[row + 1] - rows_[row] + 1};
}

std::optional<TinMesh> MeshBlock(const HeightField& field, const FieldBlock& block, double max_error_m,
                                 GreedyOptions options, std::stop_token stop) {
  if (block == FieldBlock{0, 0, field.width(), field.height()}) {
    return MeshTo(field, options, max_error_m, std::move(stop));
  }
  const auto border = [&](Side side) -> BorderOptions& { return options.borders[static_cast<std::size_t>(side)]; };
  if (block.y > 0) border(Side::kSouth) = kSharedBorder;
  if (block.x > 0) border(Side::kWest) = kSharedBorder;
  if (block.x + block.width < field.width()) border(Side::kEast) = kSharedBorder;
  if (block.y + block.height < field.height()) border(Side::kNorth) = kSharedBorder;
  return MeshTo(CopyOf(field, block), options, max_error_m, std::move(stop));
}

}  // namespace terrace::tin
