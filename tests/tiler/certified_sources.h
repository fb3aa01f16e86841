// Datasets whose certified error is tried, with all samples that count in them: single rasters, mosaics, joints.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "engine/dem/dem_source.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/tiler/source_samples.h"

namespace terrace::tiler {

struct CertifiedSource {
  std::vector<dem::DemFile> files;
  dem::DemOptions options = {};
  std::vector<Sample> samples = {};  // above the ellipsoid, or whatever the heights served count from
};

struct CertifiedCase {
  std::string name;
  // What it writes goes into the folder. Nothing: data is missing, and `missing` says which.
  std::function<std::optional<CertifiedSource>(const dem::TempDir& dir, std::string& missing)> make;
  double most_in_median = 3;   // certified over true error
  bool deep_and_fine = false;  // half of the tiles tried are of the deepest levels, with the smallest errors
};

// Of real rasters, each alone, and of real mosaics.
std::vector<CertifiedCase> RealCases();

// Of rasters written on the spot.
std::vector<CertifiedCase> WrittenCases();

// Rasters whose pixels lie up to a hundredth of a pixel off one grid, on slopes of 80 m a pixel.
std::vector<CertifiedCase> NearlyAlignedCases();

}  // namespace terrace::tiler
