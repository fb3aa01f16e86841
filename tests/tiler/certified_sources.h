// Datasets for tests of the certified error, with all samples that count in them: single rasters, mosaics, joints.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "engine/dem/elevation_model.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/tiler/source_samples.h"
#include "tiler/mesh/mesh_options.h"

namespace terrace::tiler {

struct CertifiedSource {
  std::vector<dem::DemFile> files;
  dem::DemOptions options = {};
  std::vector<Sample> samples = {};  // in the datum of the served heights
  MeshOptions mesh_options = {};
};

struct CertifiedCase {
  std::string name;
  // Writes its files into the folder. Nothing: data is missing, and `missing` names it.
  std::function<std::optional<CertifiedSource>(const dem::TempDir& dir, std::string& missing)> make;
  double most_in_median = 3;   // certified over true error
  bool deep_and_fine = false;  // half of the tested tiles are of the deepest levels, with the smallest errors
};

// Real rasters, each alone, and real mosaics.
std::vector<CertifiedCase> RealCases();

// The Earth as an ellipsoid, in meshes of few vertices.
CertifiedSource FlatWorld(const dem::TempDir& dir);

// Synthetic rasters.
std::vector<CertifiedCase> WrittenCases();

// Rasters whose pixels are up to a hundredth of a pixel off one grid, on slopes of 80 m a pixel.
std::vector<CertifiedCase> NearlyAlignedCases();

}  // namespace terrace::tiler
