#include "engine/core/elapsed_time.h"
#include "proto/documents/vector_tile.h"
#include "tiler/encoders.h"
#include "tiler/map/contour_tile.h"
#include "tiler/map/map_heights.h"
#include "tiler/tile/encoded_tile.h"

namespace terrace::tiler {

// Heights are in the sources' datum, because a map's lines tell heights above the sea.
Result<void> MakeContoursTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop) {
  auto start = std::chrono::steady_clock::now();
  const MapWindow window(input.request.key, kSidesPx[0], kContourMargin);
  const auto heights = ReadMapHeights(*input.dataset.model, window, dem::HeightDatum::kSource, stop);
  if (!heights) return tl::unexpected(heights.error());
  encoded.times.read = MicrosecondsSince(start);
  start = std::chrono::steady_clock::now();
  const auto features = ContoursOf(*heights, input.request.map.interval_cm, stop);
  if (!features) return tl::unexpected(features.error());
  encoded.bytes = proto::EncodeContourTile(*features);
  encoded.times.encode = MicrosecondsSince(start);
  return {};
}

}  // namespace terrace::tiler
