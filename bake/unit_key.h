// The keys of units: equal keys mean equal files.
#pragma once

#include <cstdint>

#include "archive/manifest.h"
#include "bake/units.h"
#include "tiler/tile_pipeline.h"

namespace terrace::bake {

// Hashes everything that the bytes of a unit's file depend on: the contents of the sources within reach of its tiles
// (dem::ContentBelow), the program and its libraries, the kind of tiles, the options of the dataset that
// this kind depends on, the errors of the tiles, and which tiles there are. The top unit depends on all sources.
std::uint64_t UnitKey(const tiler::Dataset& dataset, const archive::Manifest& manifest, const Unit& unit);

}  // namespace terrace::bake
