// The engine's targets, one table each; docs/performance.md defines them and has the results.
#pragma once

#include <vector>

#include "tests/bench/environment.h"
#include "tests/bench/table.h"

namespace terrace::bench {

// Cases that the filter excludes, or whose elevation model is missing, do not run; tables may be empty.
Table MeasureTiles(Environment& environment);            // T1: Delaunay, 257 x 257 samples, at an error
Table MeasureTilesEverywhere(Environment& environment);  // T1: the same on elevation models of all kinds
Table MeasureVertexGoals(Environment& environment);      // T2: Delaunay, 1024 x 1024 samples, at a number of vertices
Table MeasureLargeRasters(Environment& environment);     // T3: Delaunay, 2401 x 2401 samples and more, at an error
Table MeasureReplay(Environment& environment);           // T4: a further threshold of a refined tile
Table MeasureSweep(Environment& environment);            // T4: many thresholds of one tile
Table MeasureDataDependent(Environment& environment);    // T5: time and vertices against Delaunay, at an error
Table MeasureDataDependentQuality(Environment& environment);  // T5: RMS against Delaunay, at a number of vertices
Table MeasureDropPass(Environment& environment);              // T6: fewer vertices at the same bound
Table MeasureMemory(Environment& environment);                // T7: the heap's peak
Table MeasureVertices(Environment& environment);  // T8: tiles and rasters in blocks against one exact greedy run

}  // namespace terrace::bench
