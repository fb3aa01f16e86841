// Height images decoded by libpng, which the encoder does not use.
#include "proto/documents/height_png.h"

#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <cstring>
#include <random>
#include <set>
#include <vector>

namespace terrace::proto {
namespace {

struct Picture {
  png_uint_32 width = 0, height = 0;
  std::vector<png_byte> bytes;  // red, green, blue
};

Picture DecodePng(const std::string& png) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  Picture picture;
  EXPECT_TRUE(png_image_begin_read_from_memory(&image, png.data(), png.size())) << image.message;
  EXPECT_EQ(image.format, static_cast<png_uint_32>(PNG_FORMAT_RGB));
  picture.width = image.width;
  picture.height = image.height;
  picture.bytes.resize(PNG_IMAGE_SIZE(image));
  EXPECT_TRUE(png_image_finish_read(&image, nullptr, picture.bytes.data(), 0, nullptr)) << image.message;
  EXPECT_EQ(image.warning_or_error, 0u) << image.message;
  return picture;
}

std::uint32_t CodeAt(const Picture& picture, std::size_t pixel) {
  return static_cast<std::uint32_t>(picture.bytes[3 * pixel] << 16 | picture.bytes[3 * pixel + 1] << 8 |
                                    picture.bytes[3 * pixel + 2]);
}

std::vector<float> Noise(int size, float scale) {
  std::mt19937 random(3);
  std::vector<float> heights(static_cast<std::size_t>(size * size));
  for (float& height : heights) height = scale * (static_cast<float>(random()) / 4294967296.0f - 0.5f);
  return heights;
}

std::vector<float> Hills(int size) {
  std::vector<float> heights;
  for (int i = 0; i < size * size; ++i) {
    heights.push_back(1000.0f * std::sin(static_cast<float>(i % size) / 20) *
                      std::cos(static_cast<float>(i / size) / 30));
  }
  return heights;
}

TEST(HeightPng, DecodesToTheHeights) {
  for (const HeightEncoding encoding : {HeightEncoding::kMapbox, HeightEncoding::kTerrarium}) {
    const double half = encoding == HeightEncoding::kMapbox ? 0.05 : 1.0 / 512;
    for (const std::vector<float>& heights :
         {Noise(256, 18'000), Hills(256), std::vector<float>(256 * 256, -431.5f), Noise(1, 9), Noise(512, 3)}) {
      const int size = static_cast<int>(std::lround(std::sqrt(static_cast<double>(heights.size()))));
      const Picture picture = DecodePng(EncodeHeightPng(heights, size, encoding));
      ASSERT_EQ(picture.width, static_cast<png_uint_32>(size));
      ASSERT_EQ(picture.height, static_cast<png_uint_32>(size));
      for (std::size_t i = 0; i < heights.size(); ++i) {
        ASSERT_NEAR(DecodeHeight(CodeAt(picture, i), encoding), heights[i], half + 1e-9) << i;
      }
    }
  }
}

// The examples of the formats' own documents.
TEST(HeightPng, CodesAreThoseOfTheFormats) {
  EXPECT_EQ(EncodeHeight(0, HeightEncoding::kMapbox), 100'000u);
  EXPECT_EQ(EncodeHeight(-10'000, HeightEncoding::kMapbox), 0u);
  EXPECT_NEAR(DecodeHeight(0x01'86'a1, HeightEncoding::kMapbox), 0.1, 1e-9);
  EXPECT_EQ(EncodeHeight(0, HeightEncoding::kTerrarium), 0x80'00'00u);
  EXPECT_EQ(EncodeHeight(-1.5, HeightEncoding::kTerrarium), 0x7f'fe'80u);
  EXPECT_DOUBLE_EQ(DecodeHeight(0x80'01'40, HeightEncoding::kTerrarium), 1.25);
}

TEST(HeightPng, ClampsWhatNoCodeReaches) {
  EXPECT_EQ(EncodeHeight(-10'935, HeightEncoding::kMapbox), 0u);
  EXPECT_EQ(EncodeHeight(-40'000, HeightEncoding::kTerrarium), 0u);
  EXPECT_EQ(EncodeHeight(40'000, HeightEncoding::kTerrarium), 0xff'ff'ffu);
}

// A colour profile or transparency makes browsers change the bytes.
TEST(HeightPng, HasOnlyTheChunksItNeeds) {
  const std::string png = EncodeHeightPng(Hills(64), 64, HeightEncoding::kMapbox);
  std::multiset<std::string> chunks;
  for (std::size_t at = 8; at + 12 <= png.size();) {
    std::uint32_t length = 0;
    for (std::size_t i = 0; i < 4; ++i) length = length << 8 | static_cast<unsigned char>(png[at + i]);
    chunks.insert(png.substr(at + 4, 4));
    at += 12 + length;
  }
  EXPECT_EQ(chunks, (std::multiset<std::string>{"IDAT", "IEND", "IHDR"}));
}

TEST(HeightPng, IsSmallWhereHeightsAreSmooth) {
  EXPECT_LT(EncodeHeightPng(std::vector<float>(256 * 256, 12), 256, HeightEncoding::kMapbox).size(), 1500u);
  EXPECT_LT(EncodeHeightPng(Hills(256), 256, HeightEncoding::kMapbox).size(), 100'000u);
}

}  // namespace
}  // namespace terrace::proto
