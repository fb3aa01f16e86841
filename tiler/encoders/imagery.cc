#include <utility>

#include "engine/core/elapsed_time.h"
#include "proto/documents/map_picture.h"
#include "tiler/encoders.h"
#include "tiler/tile/encoded_tile.h"

namespace terrace::tiler {
namespace {

Result<void> EncodeMapPicture(Result<dem::MapPicture> read, std::chrono::steady_clock::time_point start,
                              const EncoderInput& input, EncodedTile& encoded) {
  if (!read) return tl::unexpected(std::move(read.error()));
  encoded.times.read = MicrosecondsSince(start);
  start = std::chrono::steady_clock::now();
  auto bytes = proto::EncodePhoto({read->side, read->side, proto::PixelKind::kRgba, read->rgba},
                                  input.request.map.picture, input.dataset.imagery.quality, dem::Imagery::kNoPicture);
  if (!bytes) return tl::unexpected(std::move(bytes.error()));
  encoded.bytes = *std::move(bytes);
  encoded.times.encode = MicrosecondsSince(start);
  return {};
}

tl::unexpected<Error> NoImagery() { return MakeError(ErrorCode::kNotFound, "the dataset has no imagery"); }

}  // namespace

Result<void> MakeImageryTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop) {
  if (!input.dataset.imagery.image) return NoImagery();
  const auto start = std::chrono::steady_clock::now();
  const geo::TileKey& key = input.request.key;
  const int size = input.request.side_px, depth = key.level + (size == 512 ? 1 : 0);
  return EncodeMapPicture(input.dataset.imagery.image->ReadMercator(depth, key.x * size, key.y * size, size, stop),
                          start, input, encoded);
}

Result<void> MakeGeodeticImageryTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop) {
  if (!input.dataset.imagery.image) return NoImagery();
  const auto start = std::chrono::steady_clock::now();
  return EncodeMapPicture(input.dataset.imagery.image->ReadGeodetic(input.request.key, input.request.side_px, stop),
                          start, input, encoded);
}

}  // namespace terrace::tiler
