// PNG and WebP pictures decoded by libpng, which the encoder does not use, and by libwebp's decoder.
#include "proto/documents/map_picture.h"

#include <gtest/gtest.h>
#include <png.h>
#include <webp/decode.h>

#include <array>
#include <memory>
#include <random>
#include <vector>

namespace terrace::proto {
namespace {

using PixelBytes = std::vector<std::uint8_t>;

// Random rows between smooth ones, so that every filter of PNG is used.
PixelBytes PixelSamples(int width, int height, int channels) {
  std::mt19937 random(7);
  PixelBytes samples;
  for (int y = 0; y < height; ++y) {
    for (int i = 0; i < width * channels; ++i) {
      samples.push_back(static_cast<std::uint8_t>(y % 3 == 0 ? random() : static_cast<unsigned>(i / 2 + y)));
    }
  }
  return samples;
}

// Red, green, blue and alpha.
PixelBytes DecodePngPixels(const std::string& bytes, png_uint_32 expected_format) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  EXPECT_TRUE(png_image_begin_read_from_memory(&image, bytes.data(), bytes.size())) << image.message;
  EXPECT_EQ(image.format, expected_format);
  image.format = PNG_FORMAT_RGBA;
  PixelBytes rgba(PNG_IMAGE_SIZE(image));
  EXPECT_TRUE(png_image_finish_read(&image, nullptr, rgba.data(), 0, nullptr)) << image.message;
  EXPECT_EQ(image.warning_or_error, 0u) << image.message;
  return rgba;
}

PixelBytes DecodeWebpPixels(const std::string& bytes, int width, int height) {
  int found_width = 0, found_height = 0;
  const std::unique_ptr<std::uint8_t, void (*)(void*)> rgba(
      WebPDecodeRGBA(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), &found_width, &found_height),
      WebPFree);
  EXPECT_NE(rgba, nullptr);
  EXPECT_EQ(found_width, width);
  EXPECT_EQ(found_height, height);
  return PixelBytes(rgba.get(), rgba.get() + std::size_t{4} * static_cast<std::size_t>(width * height));
}

PixelBytes RgbaOf(const PixelBytes& samples, PixelKind kind) {
  const auto channels = static_cast<std::size_t>(kind);
  PixelBytes rgba;
  for (std::size_t i = 0; i < samples.size(); i += channels) {
    const bool is_grey = channels < 3;
    for (std::size_t c = 0; c < 3; ++c) rgba.push_back(samples[i + (is_grey ? 0 : c)]);
    rgba.push_back(channels % 2 == 0 ? samples[i + channels - 1] : 255);
  }
  return rgba;
}

TEST(MapPicture, PngsOfAllKindsDecodeToTheirSamples) {
  const std::pair<PixelKind, int> kinds[] = {{PixelKind::kGrey, PNG_FORMAT_GRAY},
                                             {PixelKind::kGreyAlpha, PNG_FORMAT_GA},
                                             {PixelKind::kRgb, PNG_FORMAT_RGB},
                                             {PixelKind::kRgba, PNG_FORMAT_RGBA}};
  for (const auto& [kind, format] : kinds) {
    for (const auto& [width, height] : {std::pair(256, 256), std::pair(1, 1), std::pair(7, 300)}) {
      const PixelBytes samples = PixelSamples(width, height, static_cast<int>(kind));
      const std::string png = EncodePng({width, height, kind, samples});
      EXPECT_EQ(DecodePngPixels(png, static_cast<png_uint_32>(format)), RgbaOf(samples, kind))
          << static_cast<int>(kind);
      EXPECT_EQ(png, EncodePng({width, height, kind, samples})) << "the same bytes again";
    }
  }
}

TEST(MapPicture, PalettesDecodeToTheirColours) {
  const std::vector<std::array<std::uint8_t, 4>> palette = {
      {0, 0, 0, 0}, {10, 20, 30, 255}, {40, 50, 60, 128}, {70, 80, 90, 255}};
  PixelBytes indices, expected;
  for (int i = 0; i < 64 * 64; ++i) {
    indices.push_back(static_cast<std::uint8_t>(i * i % 4));
    const auto& color = palette[indices.back()];
    expected.insert(expected.end(), color.begin(), color.end());
  }
  const std::string png = EncodePalettePng({64, 64, PixelKind::kGrey, indices}, palette);
  EXPECT_EQ(DecodePngPixels(png, PNG_FORMAT_RGBA_COLORMAP), expected);
  EXPECT_NE(png.find("PLTE"), std::string::npos);
}

TEST(MapPicture, WebpIsLosslessForExactPictures) {
  for (const PixelKind kind : {PixelKind::kGrey, PixelKind::kGreyAlpha, PixelKind::kRgb, PixelKind::kRgba}) {
    PixelBytes samples = PixelSamples(64, 64, static_cast<int>(kind));
    // The colours of transparent pixels may change.
    const auto channels = static_cast<std::size_t>(kind);
    if (channels % 2 == 0) {
      for (std::size_t i = channels - 1; i < samples.size(); i += channels) samples[i] |= 1;
    }
    const auto webp = EncodeExactly({64, 64, kind, samples}, PictureFormat::kWebp);
    ASSERT_TRUE(webp) << webp.error().message;
    EXPECT_EQ(DecodeWebpPixels(*webp, 64, 64), RgbaOf(samples, kind));
  }
}

TEST(MapPicture, PhotosKeepAlphaAndFillItInJpeg) {
  PixelBytes rgba;
  for (int i = 0; i < 64 * 64; ++i) {
    const bool is_there = i % 64 < 32;
    for (const int sample : {200, 100, 50, 255}) rgba.push_back(static_cast<std::uint8_t>(is_there ? sample : 0));
  }
  const PixelView photo{64, 64, PixelKind::kRgba, rgba};
  const auto webp = EncodePhoto(photo, PictureFormat::kWebp, 80, {188, 188, 188});
  ASSERT_TRUE(webp);
  const PixelBytes decoded = DecodeWebpPixels(*webp, 64, 64);
  for (std::size_t i = 0; i < decoded.size(); i += 4) ASSERT_EQ(decoded[i + 3], rgba[i + 3]) << i;
  EXPECT_NEAR(decoded[0], 200, 6);

  const auto jpeg = EncodePhoto(photo, PictureFormat::kJpeg, 80, {188, 188, 188});
  ASSERT_TRUE(jpeg);
  EXPECT_TRUE(jpeg->starts_with("\xff\xd8\xff"));
  PixelBytes filled = rgba;
  for (std::size_t i = 0; i < filled.size(); i += 4) {
    if (filled[i + 3] == 0) std::fill_n(filled.begin() + static_cast<std::ptrdiff_t>(i), 3, std::uint8_t{188});
  }
  for (std::size_t i = 3; i < filled.size(); i += 4) filled[i] = 255;
  EXPECT_EQ(*jpeg, *EncodePhoto({64, 64, PixelKind::kRgba, filled}, PictureFormat::kJpeg, 80, {0, 0, 0}));
}

}  // namespace
}  // namespace terrace::proto
