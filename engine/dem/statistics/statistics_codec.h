// Statistics as bytes: what the statistics cache (statistics_cache.h) keeps of the chunks of a raster and of the whole.
// Without checksums.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "engine/dem/statistics/raster_chunk.h"
#include "engine/dem/statistics/raster_statistics.h"

namespace terrace::dem {

// A part without the averages of factors below kLargestDirect, which a record keeps apart.
std::string EncodeChunk(const ChunkStatistics& part);
// Nothing where the bytes are no part of this shape.
std::optional<ChunkStatistics> DecodeChunk(std::string_view bytes, const Chunk& chunk, const RasterLayout& layout);

std::string EncodeStatistics(const RasterStatistics& statistics);
std::optional<RasterStatistics> DecodeStatistics(std::string_view bytes, const RasterLayout& layout);

// Empty where nothing was found.
std::string EncodeDetectedNodata(const DetectedNodata& detected);
std::optional<DetectedNodata> DecodeDetectedNodata(std::string_view bytes);

}  // namespace terrace::dem
