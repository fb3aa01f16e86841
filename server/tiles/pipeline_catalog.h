// Makes a catalog from a tile pipeline.
#pragma once

#include <cstddef>
#include <memory>

#include "server/tiles/catalog.h"
#include "tiler/tile_pipeline.h"

namespace terrace::server {

// `max_mesh_samples`: limit for one mesh of an area.
CatalogPtr MakeCatalog(std::shared_ptr<const tiler::TilePipeline> pipeline, std::size_t max_mesh_samples);

}  // namespace terrace::server
