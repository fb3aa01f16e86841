#include "proto/gltf/texture.h"

#include <gdal_priv.h>
#include <gtest/gtest.h>

#include <cmath>
#include <thread>
#include <vector>

namespace terrace::proto {
namespace {

constexpr int kSide = 64;

// Red to the right, green downwards.
std::vector<std::uint8_t> Ramp() {
  std::vector<std::uint8_t> rgb;
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      rgb.insert(rgb.end(), {static_cast<std::uint8_t>(4 * column), static_cast<std::uint8_t>(4 * row), 60});
    }
  }
  return rgb;
}

// Decodes with GDAL, independently of the encoder. Returns one band after the other.
std::vector<std::uint8_t> DecodeTexture(std::string bytes) {
  GDALAllRegister();
  const std::string name = "/vsimem/texture_test";
  VSILFILE* const file =
      VSIFileFromMemBuffer(name.c_str(), reinterpret_cast<GByte*>(bytes.data()), bytes.size(), FALSE);
  VSIFCloseL(file);
  std::vector<std::uint8_t> bands(std::size_t{3} * kSide * kSide);
  GDALDatasetUniquePtr dataset(GDALDataset::Open(name.c_str()));
  EXPECT_NE(dataset, nullptr);
  if (!dataset) return bands;
  EXPECT_EQ(dataset->GetRasterXSize(), kSide);
  EXPECT_EQ(dataset->GetRasterYSize(), kSide);
  EXPECT_EQ(dataset->RasterIO(GF_Read, 0, 0, kSide, kSide, bands.data(), kSide, kSide, GDT_Byte, 3, nullptr, 0, 0, 0,
                              nullptr),
            CE_None);
  return bands;
}

TEST(EncodePicture, DecodesToThePicture) {
  const std::vector<std::uint8_t> rgb = Ramp();
  for (const TextureFormat format : {TextureFormat::kJpeg, TextureFormat::kWebp}) {
    const auto bytes = EncodePicture(rgb, kSide, kSide, format, 90);
    ASSERT_TRUE(bytes.has_value());
    const std::vector<std::uint8_t> bands = DecodeTexture(*bytes);
    double worst = 0;
    for (std::size_t i = 0; i < rgb.size(); ++i) {
      const std::size_t pixel = i / 3, band = i % 3;
      worst = std::max(worst, std::abs(double{static_cast<double>(bands[band * kSide * kSide + pixel])} - rgb[i]));
    }
    EXPECT_LT(worst, 20) << MediaTypeOf(format);
  }
}

TEST(EncodePicture, BeginsLikeItsMediaTypeAndIsBaseline) {
  const auto jpeg = EncodePicture(Ramp(), kSide, kSide, TextureFormat::kJpeg, 80);
  const auto webp = EncodePicture(Ramp(), kSide, kSide, TextureFormat::kWebp, 80);
  ASSERT_TRUE(jpeg.has_value() && webp.has_value());
  EXPECT_EQ(jpeg->substr(0, 3), "\xff\xd8\xff");
  EXPECT_NE(jpeg->find("\xff\xc0"), std::string::npos) << "SOF0";
  EXPECT_EQ(webp->substr(0, 4) + webp->substr(8, 4), "RIFFWEBP");
  EXPECT_EQ(MediaTypeOf(TextureFormat::kJpeg), "image/jpeg");
  EXPECT_EQ(MediaTypeOf(TextureFormat::kWebp), "image/webp");
}

TEST(EncodePicture, QualityDecidesTheSize) {
  for (const TextureFormat format : {TextureFormat::kJpeg, TextureFormat::kWebp}) {
    std::size_t previous = 0;
    for (const int quality : {1, 50, 100}) {
      const auto bytes = EncodePicture(Ramp(), kSide, kSide, format, quality);
      ASSERT_TRUE(bytes.has_value());
      EXPECT_GT(bytes->size(), previous) << quality;
      previous = bytes->size();
    }
  }
}

TEST(EncodePicture, GivesTheSameBytesOnEveryThread) {
  for (const TextureFormat format : {TextureFormat::kJpeg, TextureFormat::kWebp}) {
    const auto expected = EncodePicture(Ramp(), kSide, kSide, format, 80);
    ASSERT_TRUE(expected.has_value());
    std::vector<std::thread> threads;
    for (int k = 0; k < 4; ++k) {
      threads.emplace_back([&] { EXPECT_EQ(EncodePicture(Ramp(), kSide, kSide, format, 80).value(), *expected); });
    }
    for (std::thread& thread : threads) thread.join();
  }
}

TEST(EncodePicture, TakesPicturesOfAnyShape) {
  const std::vector<std::uint8_t> rgb(std::size_t{3} * 7 * 1, 200);
  for (const TextureFormat format : {TextureFormat::kJpeg, TextureFormat::kWebp}) {
    EXPECT_TRUE(EncodePicture(rgb, 7, 1, format, 80).has_value());
    EXPECT_TRUE(EncodePicture(rgb, 1, 7, format, 80).has_value());
  }
}

TEST(EncodePictureDeathTest, AWrongNumberOfBytesIsAMistake) {
  EXPECT_DEATH(static_cast<void>(EncodePicture(Ramp(), kSide, kSide + 1, TextureFormat::kJpeg, 80)), "check failed");
  EXPECT_DEATH(static_cast<void>(EncodePicture(Ramp(), kSide, kSide, TextureFormat::kNone, 80)), "check failed");
}

}  // namespace
}  // namespace terrace::proto
