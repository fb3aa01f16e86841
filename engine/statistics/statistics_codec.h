// Serialization of statistics for the statistics cache (statistics_cache.h), of chunks and of whole rasters. No
// checksums.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "engine/statistics/raster_chunk.h"
#include "engine/statistics/raster_statistics.h"

namespace terrace::dem {

// Without averages of factors below kLargestMeasuredFactor, which the cache stores separately.
std::string EncodeChunk(const ChunkStatistics& chunk_statistics);
// Nothing if the bytes are not a chunk of this shape.
std::optional<ChunkStatistics> DecodeChunk(std::string_view bytes, const Chunk& chunk, const RasterLayout& layout);

std::string EncodeStatistics(const RasterStatistics& statistics);
std::optional<RasterStatistics> DecodeStatistics(std::string_view bytes, const RasterLayout& layout);

// Empty if nothing was detected.
std::string EncodeDetectedNodata(const DetectedNodata& detected);
std::optional<DetectedNodata> DecodeDetectedNodata(std::string_view bytes);

}  // namespace terrace::dem
