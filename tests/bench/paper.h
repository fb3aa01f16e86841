// The experiments of the paper, repeated; docs/engine.md shows them.
#pragma once

#include <string>
#include <vector>

#include "tests/bench/figure.h"
#include "tests/bench/table.h"

namespace terrace::bench {

struct Results {
  std::vector<Figure> figures;
  std::vector<Table> tables;
};

void TimeOverVertices(Results& results);      // figure 3: time(m, n), on windows of West US
void ParallelInsertions(Results& results);    // figure 12: many insertions per pass, on Crater
void CraterQuality(Results& results);         // RMS and maximum error over m, compared with Scape's
void DataDependentQuality(Results& results);  // figures 13 and 14, and the measures of section 3.4.1, on Crater
void QualityOverVertices(Results& results);   // figure 15: greedy insertion and uniform grids, all five models

// Figures 4 to 11: Crater and its approximations. Also one area with 1 % to 50 % of its samples.
void DrawPictures(const std::string& folder);

}  // namespace terrace::bench
