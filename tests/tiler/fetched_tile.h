// Tiles as clients get them: built by the pipeline, then decoded by an independent decoder.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <tuple>
#include <vector>

#include "tests/proto/quantized_mesh_decoder.h"
#include "tiler/tile_pipeline.h"
#include "tiler/tile_request.h"

namespace terrace::tiler {

// A dataset by plain rules. A failed expectation and no source where the raster cannot be opened.
Dataset OpenDataset(const std::string& name, const std::string& path);

// config/samples/NAME.tif
Dataset OpenSample(const std::string& name);

// "etopo5" and "jacksboro", opened once.
const TilePipeline& SamplePipeline();

struct FetchedTile {
  proto::DecodedTile mesh;
  EncodedTile encoded;
};

// With normals, whatever the request says. An empty tile and a failed expectation where there is none.
FetchedTile FetchTile(const TilePipeline& pipeline, TileRequest request);

// What neighbours share: position along the edge, decoded height and the normal's two bytes of every vertex on it.
using Edge = std::vector<std::tuple<int, double, int, int>>;

// The vertices with u (vertical) or v equal to `fixed`, 0 or 32767, from the south or the west.
Edge EdgeOf(const FetchedTile& tile, bool vertical, int fixed);

}  // namespace terrace::tiler
