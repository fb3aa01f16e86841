#include "tiler/tile/check_request.h"

#include <algorithm>

#include "engine/geo/error_ladder.h"
#include "engine/geo/tile_key.h"

namespace terrace::tiler {
namespace {

bool IsValidKey(const TileRequest& request) {
  const geo::TileKey& key = request.key;
  if (!IsMercator(request.format)) return geo::IsValid(key);
  // The pixels of larger tiles are those of a deeper grid.
  const int depth = key.level + (request.side_px > kSidesPx[0] ? 1 : 0);
  if (key.level < 0 || depth > geo::kMaxLevel) return false;
  const std::int64_t tiles = std::int64_t{1} << key.level;
  return key.x >= 0 && key.x < tiles && key.y >= 0 && key.y < tiles;
}

Result<void> CheckMap(const TileRequest& request) {
  const auto invalid = [](const char* what) { return MakeError(ErrorCode::kInvalidArgument, "{}", what); };
  const MapParameters& map = request.map;
  const bool is_relief = request.format == TileFormat::kHillshade || request.format == TileFormat::kSlope;
  if (request.format == TileFormat::kContours && map.interval_cm == 0) return invalid("interval_cm: contours need one");
  if (request.format == TileFormat::kHillshade && (map.azimuth_deg > 359 || map.altitude_deg > 90 ||
                                                   map.z_factor_hundredths < 1 || map.z_factor_hundredths > 10000))
    return invalid("azimuth_deg, altitude_deg or z_factor_hundredths: out of its range");
  if (is_relief && map.picture == proto::PictureFormat::kJpeg)
    return invalid("picture: hillshades and slopes are PNG or WebP");
  return {};
}

}  // namespace

Result<void> CheckRequest(const TileRequest& request) {
  if (!IsValidKey(request)) {
    return MakeError(ErrorCode::kNotFound, "{}: no level has such a tile", geo::ToString(request.key));
  }
  const bool has_mesh = request.format == TileFormat::kQuantizedMesh || request.format == TileFormat::kGlb;
  if (has_mesh) {
    if (request.error_step >= geo::kCoarsestStep && request.error_step <= geo::kFinestStep) return {};
    return MakeError(ErrorCode::kInvalidArgument, "error_step: {} is not from {} to {}", request.error_step,
                     geo::kCoarsestStep, geo::kFinestStep);
  }
  if (std::ranges::find(kSidesPx, request.side_px) == kSidesPx.end()) {
    return MakeError(ErrorCode::kInvalidArgument, "side_px: {} is not {} or {}", request.side_px, kSidesPx[0],
                     kSidesPx[1]);
  }
  return CheckMap(request);
}

}  // namespace terrace::tiler
