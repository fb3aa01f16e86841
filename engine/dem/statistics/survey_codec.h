// Surveys as bytes: what a record (survey_record.h) keeps of a raster's parts and of the whole. No checksums here.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "engine/dem/statistics/raster_chunk.h"
#include "engine/dem/statistics/raster_survey.h"

namespace terrace::dem {

// A part without the averages of factors below kLargestDirect, which a record keeps apart.
std::string EncodePart(const ChunkSurvey& part);
// Nothing where the bytes are no part of this shape.
std::optional<ChunkSurvey> DecodePart(std::string_view bytes, const Chunk& chunk, const RasterLayout& layout);

std::string EncodeSurvey(const RasterSurvey& survey);
std::optional<RasterSurvey> DecodeSurvey(std::string_view bytes, const RasterLayout& layout);

// Empty where nothing was found.
std::string EncodeFindings(const VoidFindings& findings);
std::optional<VoidFindings> DecodeFindings(std::string_view bytes);

}  // namespace terrace::dem
