// Names of the enumerators of picture_types.h in URLs and in files. Not installed.
#pragma once

#include "engine/core/names.h"
#include "proto/documents/picture_types.h"

namespace terrace::proto {

inline constexpr Names<HeightEncoding, 2> kHeightEncodingNames = {
    {{"mapbox", HeightEncoding::kMapbox}, {"terrarium", HeightEncoding::kTerrarium}}};

}  // namespace terrace::proto
