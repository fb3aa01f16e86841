// Hillshades and slopes.
#include "tiler/map/relief.h"

#include <cstdint>
#include <utility>
#include <vector>

#include "engine/core/elapsed_time.h"
#include "proto/documents/map_picture.h"
#include "tiler/encoders.h"
#include "tiler/map/map_heights.h"
#include "tiler/tile/encoded_tile.h"

namespace terrace::tiler {
namespace {

Result<std::vector<Gradient>> ReadGradients(const EncoderInput& input, EncodedTile& encoded,
                                            const std::stop_token& stop) {
  const auto start = std::chrono::steady_clock::now();
  const MapWindow window(input.request.key, input.request.side_px, kReliefMargin);
  const auto heights = ReadMapHeights(*input.dataset.model, window, dem::HeightDatum::kEllipsoid, stop);
  if (!heights) return tl::unexpected(heights.error());
  encoded.times.read = MicrosecondsSince(start);
  return GradientsOf(*heights, window);
}

// Grey pixels; `values` below 0 are transparent. Without transparent pixels there is no alpha.
Result<std::string> EncodeGrey(const std::vector<int>& values, int size, proto::PictureFormat format) {
  bool has_gaps = false;
  for (const int value : values) has_gaps = has_gaps || value < 0;
  std::vector<std::uint8_t> samples;
  samples.reserve(2 * values.size());
  for (const int value : values) {
    samples.push_back(static_cast<std::uint8_t>(value < 0 ? 0 : value));
    if (has_gaps) samples.push_back(value < 0 ? 0 : 255);
  }
  return proto::EncodeExactly({size, size, has_gaps ? proto::PixelKind::kGreyAlpha : proto::PixelKind::kGrey, samples},
                              format);
}

// PNG: a palette whose first entry is transparent.
Result<std::string> EncodeSlopeColors(const std::vector<int>& steps, int size, proto::PictureFormat format) {
  std::vector<std::array<std::uint8_t, 4>> palette = {{0, 0, 0, 0}};
  for (const auto& [red, green, blue] : SlopeColors()) palette.push_back({red, green, blue, 255});
  std::vector<std::uint8_t> samples;
  if (format == proto::PictureFormat::kPng) {
    samples.reserve(steps.size());
    for (const int step : steps) samples.push_back(static_cast<std::uint8_t>(step + 1));
    return proto::EncodePalettePng({size, size, proto::PixelKind::kGrey, samples}, palette);
  }
  samples.reserve(4 * steps.size());
  for (const int step : steps) {
    const auto& color = palette[static_cast<std::size_t>(step + 1)];
    samples.insert(samples.end(), color.begin(), color.end());
  }
  return proto::EncodeExactly({size, size, proto::PixelKind::kRgba, samples}, format);
}

Result<void> StoreBytes(Result<std::string> bytes, EncodedTile& encoded, std::chrono::steady_clock::time_point start) {
  if (!bytes) return tl::unexpected(std::move(bytes.error()));
  encoded.bytes = *std::move(bytes);
  encoded.times.encode = MicrosecondsSince(start);
  return {};
}

}  // namespace

Result<void> MakeHillshadeTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop) {
  const auto gradients = ReadGradients(input, encoded, stop);
  if (!gradients) return tl::unexpected(gradients.error());
  const auto start = std::chrono::steady_clock::now();
  const Hillshade hillshade(input.request.map);
  std::vector<int> values;
  values.reserve(gradients->size());
  for (const Gradient& gradient : *gradients) {
    const int shade = hillshade.Of(gradient);
    values.push_back(shade == 0 ? -1 : shade);
  }
  return StoreBytes(EncodeGrey(values, input.request.side_px, input.request.map.picture), encoded, start);
}

Result<void> MakeSlopeTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop) {
  const auto gradients = ReadGradients(input, encoded, stop);
  if (!gradients) return tl::unexpected(gradients.error());
  const auto start = std::chrono::steady_clock::now();
  std::vector<int> steps;
  steps.reserve(gradients->size());
  for (const Gradient& gradient : *gradients) steps.push_back(SlopeStep(gradient));
  const auto encode = input.request.map.slope_style == SlopeStyle::kColors ? EncodeSlopeColors : EncodeGrey;
  return StoreBytes(encode(steps, input.request.side_px, input.request.map.picture), encoded, start);
}

}  // namespace terrace::tiler
