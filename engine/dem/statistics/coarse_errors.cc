#include "engine/dem/statistics/coarse_errors.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace terrace::dem {
namespace {

// The lines of both grids along one axis, and the averages of each grid around each line.
struct Line {
  double position = 0;
  GridAxis::Location fine, coarse;
};

std::vector<Line> LinesOf(const GridAxis& fine, const GridAxis& coarse) {
  std::vector<double> positions;
  const std::int64_t around = fine.wraps() ? 1 : 0;
  for (std::int64_t i = -around; i < fine.count() + around; ++i) positions.push_back(fine.Center(i));
  for (std::int64_t i = -around; i < coarse.count() + around; ++i) positions.push_back(coarse.Center(i));
  std::ranges::sort(positions);
  positions.erase(std::unique(positions.begin(), positions.end()), positions.end());
  std::vector<Line> lines;
  for (const double position : positions) lines.push_back({position, fine.Locate(position), coarse.Locate(position)});
  return lines;
}

// The surface between averages, with weights renormalized over valid averages, and the extremes of the averages around.
class Surface {
 public:
  Surface(const CoarseAverages::Grid& grid, bool wraps) : grid_(grid), wraps_(wraps) {}

  struct Corners {
    float lowest = std::numeric_limits<float>::infinity(), highest = -std::numeric_limits<float>::infinity();
    bool has_voids = false;
    bool empty() const { return lowest > highest; }
  };

  double At(const GridAxis::Location& x, const GridAxis::Location& y) const {
    const double upper = Along(x, y.index);
    return y.weight > 0 ? upper + y.weight * (Along(x, y.index + 1) - upper) : upper;
  }

  // Extremes of the averages around the cell of lines that begins here.
  Corners Around(const GridAxis::Location& x, const GridAxis::Location& y) const {
    Corners corners;
    for (const std::int64_t row : {y.index, std::min(y.index + 1, grid_.rows - 1)}) {
      for (const std::int64_t column : {x.index, wraps_ ? x.index + 1 : std::min(x.index + 1, grid_.columns - 1)}) {
        const float height = Height(column, row);
        corners.has_voids |= std::isnan(height);
        if (std::isnan(height)) continue;
        corners.lowest = std::min(corners.lowest, height);
        corners.highest = std::max(corners.highest, height);
      }
    }
    return corners;
  }

 private:
  float Height(std::int64_t column, std::int64_t row) const {
    const std::int64_t wrapped = (column % grid_.columns + grid_.columns) % grid_.columns;
    return grid_.heights[static_cast<std::size_t>(row * grid_.columns + wrapped)];
  }
  double Along(const GridAxis::Location& x, std::int64_t row) const {
    const double first = Height(x.index, row);
    return x.weight > 0 ? first + x.weight * (Height(x.index + 1, row) - first) : first;
  }

  const CoarseAverages::Grid& grid_;
  const bool wraps_;
};

// The largest difference within the cell between two lines of each axis.
double CellError(const Surface& fine, const Surface& coarse, const Line* x, const Line* y) {
  const Surface::Corners near = fine.Around(x->fine, y->fine), far = coarse.Around(x->coarse, y->coarse);
  if (near.empty()) return 0;  // no samples
  if (far.empty()) return std::numeric_limits<double>::infinity();
  if (near.has_voids || far.has_voids) {
    return std::max(double{far.highest} - near.lowest, double{near.highest} - far.lowest);
  }
  double worst = 0;
  for (const Line* row : {y, y + 1}) {
    for (const Line* column : {x, x + 1}) {
      worst = std::max(worst, std::abs(fine.At(column->fine, row->fine) - coarse.At(column->coarse, row->coarse)));
    }
  }
  return worst;
}

void AddFactor(const RasterLayout& layout, const CoarseAverages& coarse, int factor, AveragingErrors& errors) {
  const auto grid = [&](int of) -> const CoarseAverages::Grid& {
    std::size_t index = 0;
    while ((kLargestDirect << index) < of) ++index;
    return coarse.grids[index];
  };
  const Surface near(grid(kLargestDirect), layout.wraps), far(grid(factor), layout.wraps);
  const auto columns =
      LinesOf(GridAxis(layout.columns, kLargestDirect, layout.wraps), GridAxis(layout.columns, factor, layout.wraps));
  const auto rows = LinesOf(GridAxis(layout.height, kLargestDirect, false), GridAxis(layout.height, factor, false));
  const int pixels = AveragingErrors::BlockPixels(factor);
  AveragingErrors::Level differences{errors.level(factor).columns, errors.level(factor).rows, {}};
  differences.errors.resize(errors.level(factor).errors.size());
  const auto block = [&](double position, int count) {
    return std::clamp(static_cast<int>(std::floor(position / pixels)), 0, count - 1);
  };
  // With a single line, the surfaces are constant along this axis.
  const auto steps = [](const std::vector<Line>& lines) { return std::max<std::size_t>(lines.size() - 1, 1); };
  const auto padded = [](std::vector<Line> lines) {
    if (lines.size() == 1) lines.push_back(lines.front());
    return lines;
  };
  const std::vector<Line> xs = padded(columns), ys = padded(rows);
  for (std::size_t j = 0; j < steps(rows); ++j) {
    for (std::size_t i = 0; i < steps(columns); ++i) {
      const double error = CellError(near, far, &xs[i], &ys[j]);
      for (int y = block(ys[j].position, differences.rows); y <= block(ys[j + 1].position, differences.rows); ++y) {
        for (int x = block(xs[i].position, differences.columns); x <= block(xs[i + 1].position, differences.columns);
             ++x) {
          float& known = differences.errors[static_cast<std::size_t>(y * differences.columns + x)];
          known = std::max(known, std::nextafter(static_cast<float>(error), std::numeric_limits<float>::infinity()));
        }
      }
    }
  }
  for (int y = 0; y < differences.rows; ++y) {
    for (int x = 0; x < differences.columns; ++x) {
      const double side = pixels, west = side * x, north = side * y;
      const float own = errors.Largest(kLargestDirect, west, north, west + side - 0.5, north + side - 0.5);
      errors.Raise(factor, x, y, differences.errors[static_cast<std::size_t>(y * differences.columns + x)] + own);
    }
  }
}

}  // namespace

void AddCoarseErrors(const RasterLayout& layout, const CoarseAverages& coarse, AveragingErrors& errors) {
  for (int factor = 2 * kLargestDirect; factor <= errors.largest_factor(); factor *= 2) {
    AddFactor(layout, coarse, factor, errors);
  }
}

}  // namespace terrace::dem
