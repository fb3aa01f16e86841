// Results of Scape 1.2, the program of the paper's authors, on the paper's elevation models, built on the same machine
// as ours. RMS errors are in the units of the elevation models (metres).
#pragma once

#include <array>
#include <cstddef>

namespace terrace::bench::reference {

// Crater, by number of vertices. Data-dependent triangulations have the shape threshold 1/2, those named pure have
// none.
struct CraterRow {
  std::size_t points;
  double delaunay_rms, delaunay_max;
  double sum_max_rms, sum_max_max, sum_of_squares_rms, max_max_rms, normals_rms, pure_sum_max_rms;
  double uniform_rms, uniform_max;
};
inline constexpr std::array<CraterRow, 7> kCrater = {{
    {100, 42.862, 144.0, 38.379, 146.9, 43.387, 43.621, 43.420, 41.878, 44.791, 370},
    {500, 14.588, 50.1, 13.737, 47.0, 13.055, 14.186, 16.178, 16.988, 22.281, 236},
    {1542, 7.0780, 24.3, 6.2564, 29.6, 6.3631, 6.6430, 7.4442, 8.1296, 12.750, 159},
    {5000, 2.8660, 9.5, 2.5224, 11.5, 2.5081, 2.6140, 3.0737, 3.3829, 7.0488, 133},
    {7711, 2.0087, 11.5, 1.7434, 11.5, 1.7445, 1.8270, 2.1425, 2.3310, 5.5641, 94},
    {20000, 0.86030, 2.5, 0.76026, 5, 0.74759, 0.77380, 0.91195, 0.99676, 3.3172, 87},
    {50000, 0.36749, 1.0, 0.29590, 5, 0.28940, 0.29874, 0.37578, 0.47556, 2.0292, 62.5},
}};

// Crater, insertion of many samples per pass: RMS after the pass that reached 1542, 5000 and 7711 vertices; 0: unknown.
struct ParallelRow {
  double alpha, epsilon;  // one of them is -1
  std::array<double, 3> rms;
};
inline constexpr std::array<std::size_t, 3> kParallelPoints = {1542, 5000, 7711};
inline constexpr std::array<ParallelRow, 6> kParallel = {{
    {0.8, -1, {8.79, 3.65, 2.32}},
    {0.5, -1, {10.7, 3.62, 2.45}},
    {0, -1, {43.6, 11.6, 0}},
    {-1, 20, {12.9, 0, 0}},
    {-1, 5, {23.3, 11.3, 8.17}},
    {-1, 1, {36.8, 11.3, 0}},
}};

// Ashby: RMS of Delaunay, data-dependent, uniform grid.
struct AshbyRow {
  std::size_t points;
  double delaunay_rms, data_dependent_rms, uniform_rms;
};
inline constexpr std::array<AshbyRow, 4> kAshby = {{
    {500, 11.10, 9.91, 14.94},
    {1564, 5.774, 5.313, 8.653},
    {7820, 2.012, 1.778, 3.844},
    {50000, 0.4441, 0.3873, 1.277},
}};

}  // namespace terrace::bench::reference
