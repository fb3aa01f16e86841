// The experiments of the paper, repeated; docs/engine.md shows them.
#pragma once

#include <string>
#include <vector>

#include "tests/bench/figure.h"
#include "tests/bench/table.h"

namespace terrace::bench {

struct Findings {
  std::vector<Figure> figures;
  std::vector<Table> tables;
};

void TimeOverVertices(Findings& findings);      // figure 3: time(m, n), on windows of West US
void ParallelInsertions(Findings& findings);    // figure 12: many insertions per pass, on Crater
void CraterQuality(Findings& findings);         // RMS and maximum error over m, beside Scape's
void DataDependentQuality(Findings& findings);  // figures 13 and 14, and the measures of section 3.4.1, on Crater
void QualityOverVertices(Findings& findings);   // figure 15: greedy insertion and uniform grids, all five models

// Figures 4 to 11: Crater and its approximations; and one area from 1 % to 50 % of its samples.
void DrawPictures(const std::string& folder);

}  // namespace terrace::bench
