// `terrace mesh` with colours: of a DEM with an image that covers it, or of an image alone.
#pragma once

#include <string>

#include "engine/tin/extended/extended_greedy.h"

namespace CLI {
class App;
}

namespace terrace::cli {

struct ColorArguments {
  std::string image;      // covers the DEM; empty: none
  double weight = 0.1;    // of colour against height, 0 to 1
  bool is_image = false;  // the raster is an image without heights

  bool IsUsed() const { return is_image || !image.empty(); }
};

// Adds --color, --color-weight and --image to the command.
void AddColorOptions(CLI::App& command, ColorArguments& arguments);

struct ColoredMeshArguments {
  std::string raster, nodata, out, coordinates;  // as given; `coordinates` empty: the raster's default
  tin::ExtendedGoal goal;
  ColorArguments color;
  bool json = false;
};

// Reads, meshes, writes and prints the statistics; returns the exit code.
int MeshColored(const ColoredMeshArguments& arguments);

}  // namespace terrace::cli
