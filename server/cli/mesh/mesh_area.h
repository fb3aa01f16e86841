// `terrace mesh` of a DEM with edits, or of an area of it: the mesh of `/{dataset}/mesh`, in a file.
#pragma once

#include <map>
#include <string>

namespace CLI {
class App;
}

namespace terrace::cli {

struct AreaOptions {
  std::map<std::string, std::string> dataset;  // options of a dataset, by key
  std::string box;                             // west,south,east,north in degrees; empty: all of the DEM

  bool IsUsed() const { return !box.empty() || !dataset.empty(); }
};

// Adds --edits, --vertical and --bbox to the command.
void AddAreaOptions(CLI::App& command, AreaOptions& options);

// The values of --coordinates for it.
bool IsOfAreas(const std::string& coordinates);

struct AreaMeshArguments {
  std::string dem, nodata, out, coordinates;  // as given; `coordinates` empty: enu
  double max_error_m = 1;
  AreaOptions area;
  bool json = false;
};

// Reads, meshes, writes and prints the statistics; returns the exit code.
int MeshArea(const AreaMeshArguments& arguments);

}  // namespace terrace::cli
