// Tiles as clients get them: built by the pipeline, then decoded by an independent decoder.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <tuple>
#include <vector>

#include "tests/proto/quantized_mesh_decoder.h"
#include "tiler/tile/tile_request.h"
#include "tiler/tile_pipeline.h"

namespace terrace::tiler {

// A dataset with default options. If the raster cannot be opened, an expectation fails and there is no source.
Dataset OpenDataset(const std::string& name, const std::string& path);

// config/samples/NAME.tif
Dataset OpenSample(const std::string& name);

// "etopo5" and "jacksboro", opened once.
const TilePipeline& SamplePipeline();

struct FetchedTile {
  proto::DecodedTile mesh;
  EncodedTile encoded;
};

// Always with normals. If there is no tile, an expectation fails and the result is empty.
FetchedTile FetchTile(const TilePipeline& pipeline, TileRequest request);

// The data that neighbours share: for every vertex of an edge the position along it, decoded height and two bytes of
// the normal.
using Edge = std::vector<std::tuple<int, double, int, int>>;

// The vertices with u (vertical) or v equal to `fixed`, 0 or 32767, from the south or the west.
Edge EdgeOf(const FetchedTile& tile, bool vertical, int fixed);

}  // namespace terrace::tiler
