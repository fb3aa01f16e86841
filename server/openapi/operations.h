// The operations that /openapi.json describes.
#pragma once

#include "server/openapi/operation.h"

namespace terrace::server {

extern const Operation kTerrainTileOperation, kGlbTileOperation, kHeightTileOperation, kImplicitTileOperation,
    kSubtreeOperation;
extern const Operation kDatasetsOperation, kLayerOperation, kTilesetOperation, kTileJsonOperation, kEditsOperation,
    kOpenApiOperation, kViewerOperation, kViewerFileOperation;
extern const Operation kHeightsOperation, kGridOperation, kSightOperation, kAreaOperation;
extern const Operation kHillshadePngOperation, kHillshadeWebpOperation, kHillshadeTileJsonOperation, kSlopePngOperation,
    kSlopeWebpOperation, kSlopeTileJsonOperation, kContoursOperation, kContoursTileJsonOperation, kImageryWebpOperation,
    kImageryJpegOperation, kImageryTileJsonOperation, kGeodeticImageryWebpOperation, kGeodeticImageryJpegOperation;
extern const Operation kLiveOperation, kReadyOperation, kMetricsOperation, kVersionOperation;

}  // namespace terrace::server
