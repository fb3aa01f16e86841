#include "tiler/encoder_version.h"

#include <fmt/format.h>

#include <array>

#include "engine/dem/gdal/gdal_runtime.h"
#include "proto/library_versions.h"

namespace terrace::tiler {
namespace {

constexpr std::size_t kDigits = 12;

std::array<char, kDigits> DigitsOf(std::uint64_t generation) {
  constexpr std::string_view kHexDigits = "0123456789abcdef";
  std::array<char, kDigits> digits{};
  for (std::size_t i = 0; i < kDigits; ++i) digits[i] = kHexDigits[generation >> (60 - 4 * i) & 15];
  return digits;
}

}  // namespace

std::string EncoderText() {
  return fmt::format("encoder {}, {}, {}", kEncoderVersion, dem::LibraryVersions(), proto::LibraryVersions());
}

std::string VersionText(std::uint64_t generation) {
  const std::array<char, kDigits> digits = DigitsOf(generation);
  return {digits.data(), digits.size()};
}

bool IsVersionOf(std::string_view text, std::uint64_t generation) {
  const std::array<char, kDigits> digits = DigitsOf(generation);
  return text == std::string_view(digits.data(), digits.size());
}

}  // namespace terrace::tiler
