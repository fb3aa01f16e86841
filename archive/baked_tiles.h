// The archives of a dataset as the tiler sees them.
#pragma once

#include <memory>
#include <vector>

#include "archive/archive.h"
#include "tiler/store/baked_tiles.h"

namespace terrace::archive {

// One archive for each format, as Archive::OpenAll returns them. All must have the same generation.
std::shared_ptr<const tiler::BakedTiles> MakeBakedTiles(std::vector<std::shared_ptr<const Archive>> archives);

}  // namespace terrace::archive
