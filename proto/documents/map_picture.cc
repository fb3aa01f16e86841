#include "proto/documents/map_picture.h"

#include <webp/encode.h>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <vector>

#include "engine/core/check.h"
#include "proto/gltf/texture.h"

namespace terrace::proto {
namespace {

using Samples = std::vector<std::uint8_t>;

std::size_t ChannelsOf(PixelKind kind) { return static_cast<std::size_t>(kind); }
bool HasAlpha(PixelKind kind) { return kind == PixelKind::kGreyAlpha || kind == PixelKind::kRgba; }

bool IsOpaque(const PixelView& pixels) {
  if (!HasAlpha(pixels.kind)) return true;
  const std::size_t channels = ChannelsOf(pixels.kind);
  for (std::size_t i = channels - 1; i < pixels.samples.size(); i += channels) {
    if (pixels.samples[i] != 255) return false;
  }
  return true;
}

// Red, green and blue of every pixel, and alpha if `with_alpha`.
Samples Expanded(const PixelView& pixels, bool with_alpha) {
  const std::size_t channels = ChannelsOf(pixels.kind), colours = HasAlpha(pixels.kind) ? channels - 1 : channels;
  Samples out;
  out.reserve(pixels.samples.size() / channels * (with_alpha ? 4 : 3));
  for (std::size_t i = 0; i < pixels.samples.size(); i += channels) {
    for (std::size_t c = 0; c < 3; ++c) out.push_back(pixels.samples[i + (colours == 3 ? c : 0)]);
    if (with_alpha) out.push_back(HasAlpha(pixels.kind) ? pixels.samples[i + channels - 1] : 255);
  }
  return out;
}

// `quality`: 0 means lossless.
Result<std::string> EncodeWebpPixels(const PixelView& pixels, int quality) {
  const bool with_alpha = !IsOpaque(pixels);
  const Samples samples = Expanded(pixels, with_alpha);
  const int width = pixels.width, height = pixels.height;
  if (!with_alpha && quality > 0) return EncodePicture(samples, width, height, TextureFormat::kWebp, quality);
  std::uint8_t* bytes = nullptr;
  std::size_t size = 0;
  if (!with_alpha) {
    size = WebPEncodeLosslessRGB(samples.data(), width, height, 3 * width, &bytes);
  } else if (quality == 0) {
    size = WebPEncodeLosslessRGBA(samples.data(), width, height, 4 * width, &bytes);
  } else {
    size = WebPEncodeRGBA(samples.data(), width, height, 4 * width, static_cast<float>(quality), &bytes);
  }
  const std::unique_ptr<std::uint8_t, void (*)(void*)> owner(bytes, WebPFree);
  if (size == 0) return MakeError(ErrorCode::kInternal, "libwebp cannot encode {} x {} pixels", width, height);
  return std::string(reinterpret_cast<const char*>(bytes), size);
}

}  // namespace

const char* MediaTypeOf(PictureFormat format) {
  switch (format) {
    case PictureFormat::kPng:
      return "image/png";
    case PictureFormat::kWebp:
      return "image/webp";
    case PictureFormat::kJpeg:
      break;
  }
  return "image/jpeg";
}

const char* ToString(PictureFormat format) {
  switch (format) {
    case PictureFormat::kPng:
      return "png";
    case PictureFormat::kWebp:
      return "webp";
    case PictureFormat::kJpeg:
      break;
  }
  return "jpg";
}

Result<std::string> EncodeExactly(const PixelView& pixels, PictureFormat format) {
  TERRACE_CHECK(format != PictureFormat::kJpeg);
  if (format == PictureFormat::kWebp) return EncodeWebpPixels(pixels, 0);
  return EncodePng(pixels);
}

Result<std::string> EncodePhoto(const PixelView& pixels, PictureFormat format, int quality,
                                const std::array<std::uint8_t, 3>& background) {
  TERRACE_CHECK(pixels.kind == PixelKind::kRgba && quality >= 1 && quality <= 100);
  if (format == PictureFormat::kPng) return EncodePng(pixels);
  if (format == PictureFormat::kWebp) return EncodeWebpPixels(pixels, quality);
  Samples rgb = Expanded(pixels, /*with_alpha=*/false);
  for (std::size_t i = 0; i < rgb.size() / 3; ++i) {
    if (pixels.samples[4 * i + 3] == 0) std::ranges::copy(background, rgb.begin() + static_cast<std::ptrdiff_t>(3 * i));
  }
  return EncodePicture(rgb, pixels.width, pixels.height, TextureFormat::kJpeg, quality);
}

}  // namespace terrace::proto
