// A chunked archive of invented tiles.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "archive/manifest.h"
#include "archive/unit_writer.h"
#include "engine/geo/tile_key.h"
#include "tiler/tile/encoded_tile.h"

namespace terrace::archive {

tiler::EncodedTile InventedTile(const geo::TileKey& key);
dem::HeightRange InventedRange(const geo::TileKey& key);

// All tiles of levels 0 .. 3, and some of levels 7 to 9 in two units.
std::vector<geo::TileKey> InventedKeys();

// Writes the units of these tiles, and returns a manifest that describes them. Does not write the manifest.
Manifest WriteUnits(const std::string& place, const std::vector<geo::TileKey>& keys, std::uint64_t unit_key = 7);

std::string FileText(const std::string& path);
void WriteText(const std::string& path, const std::string& text);

}  // namespace terrace::archive
