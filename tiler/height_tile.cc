#include "tiler/height_tile.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "engine/core/check.h"
#include "proto/documents/height_png.h"
#include "tiler/strong_etag.h"

namespace terrace::tiler {
namespace {

using Clock = std::chrono::steady_clock;

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

Result<EncodedTile> BuildHeightTile(const dem::DemSource& source, const TileRequest& request, std::stop_token stop) {
  TERRACE_CHECK(request.format == TileFormat::kHeightPng);
  const int size = request.height_size;
  // A tile of 512 pixels has the pixels of the four tiles of 256 below it.
  const int depth = request.key.level + (size == 512 ? 1 : 0);
  if (depth > source.info().max_mercator_depth) {
    return MakeError(ErrorCode::kNotFound, "{}: no such tile", geo::ToString(request.key));
  }
  EncodedTile encoded;
  encoded.refinement = RefinementUse::kNone;
  Clock::time_point start = Clock::now();
  const dem::NodeWindow window{request.key.x * size, request.key.y * size, size, size};
  const Result<std::vector<float>> heights = source.ReadMercator(depth, window, std::move(stop));
  if (!heights) return tl::unexpected(heights.error());
  encoded.times.read = MicrosecondsSince(start);

  start = Clock::now();
  encoded.bytes = proto::EncodeHeightPng(*heights, size, request.height_encoding);
  encoded.times.encode = MicrosecondsSince(start);
  encoded.etag = StrongETag(encoded.bytes);
  encoded.max_error_m = LargestLoss(*heights, request.height_encoding);
  return encoded;
}

}  // namespace terrace::tiler
