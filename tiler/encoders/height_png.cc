#include "proto/documents/height_png.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/core/elapsed_time.h"
#include "tiler/encoders.h"
#include "tiler/map/map_heights.h"
#include "tiler/tile/encoded_tile.h"

namespace terrace::tiler {
namespace {

// Heights beyond the code's range are clamped, so their error is larger than rounding.
double LargestLoss(const std::vector<float>& heights, proto::HeightEncoding encoding) {
  double largest = 0;
  for (const double height : heights) {
    largest =
        std::max(largest, std::abs(proto::DecodeHeight(proto::EncodeHeight(height, encoding), encoding) - height));
  }
  return largest;
}

}  // namespace

// One pixel for each node of the Web Mercator grid. Tiles share no pixels with neighbours. EncodedTile::max_error_m is
// the measured rounding error of the colours.
Result<void> MakeHeightPngTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop) {
  const Dataset& dataset = input.dataset;
  const TileRequest& request = input.request;
  const MapWindow window(request.key, request.side_px, /*margin=*/0);
  if (window.depth > dataset.model->info().max_mercator_depth) {
    return MakeError(ErrorCode::kNotFound, "{}: no such tile", geo::ToString(request.key));
  }
  auto start = std::chrono::steady_clock::now();
  const Result<std::vector<float>> heights = dataset.model->ReadMercator(window.depth, window.nodes, stop);
  if (!heights) return tl::unexpected(heights.error());
  encoded.times.read = MicrosecondsSince(start);

  start = std::chrono::steady_clock::now();
  encoded.bytes = proto::EncodeHeightPng(*heights, window.size, request.height_encoding);
  encoded.times.encode = MicrosecondsSince(start);
  encoded.max_error_m = LargestLoss(*heights, request.height_encoding);
  return {};
}

}  // namespace terrace::tiler
