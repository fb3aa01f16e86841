#include "proto/documents/png.h"

#include <libdeflate.h>

#include <cstdlib>
#include <string_view>
#include <vector>

#include "engine/core/check.h"
#include "proto/compress.h"

namespace terrace::proto {
namespace {

using PngRow = std::vector<std::uint8_t>;

void PutBigEndian(std::string& out, std::uint32_t value) {
  for (const int shift : {24, 16, 8, 0}) out += static_cast<char>(value >> shift & 0xff);
}

// PNG, section 5.3: length, type, data, and the CRC of the latter two.
void PutChunk(std::string& out, std::string_view type, std::string_view data) {
  PutBigEndian(out, static_cast<std::uint32_t>(data.size()));
  const std::size_t begin = out.size();
  out.append(type).append(data);
  PutBigEndian(out, libdeflate_crc32(0, out.data() + begin, out.size() - begin));
}

// PNG, section 9.4: the Paeth predictor. Of the bytes to the left (a), above (b) and above to the left (c), returns the
// one nearest to a + b - c.
int Paeth(int a, int b, int c) {
  const int to_a = std::abs(b - c), to_b = std::abs(a - c), to_c = std::abs(a + b - 2 * c);
  if (to_a <= to_b && to_a <= to_c) return a;
  return to_b <= to_c ? b : c;
}

// PNG, section 9.2. The filter type comes first. `pixel`: its bytes.
void Filter(int type, std::span<const std::uint8_t> row, std::span<const std::uint8_t> above, std::size_t pixel,
            PngRow& out) {
  out[0] = static_cast<std::uint8_t>(type);
  for (std::size_t i = 0; i < row.size(); ++i) {
    const bool first = i < pixel;
    const int a = first ? 0 : row[i - pixel], b = above[i], c = first ? 0 : above[i - pixel];
    const std::array<int, 5> predictions = {0, a, b, (a + b) / 2, Paeth(a, b, c)};
    out[i + 1] = static_cast<std::uint8_t>(row[i] - predictions[static_cast<std::size_t>(type)]);
  }
}

// The filter with the smallest sum of absolute output values, bytes taken as signed: the heuristic of PNG, section
// 12.7.
const PngRow& BestFilter(std::span<const std::uint8_t> row, std::span<const std::uint8_t> above, std::size_t pixel,
                         std::array<PngRow, 5>& candidates) {
  std::size_t best = 0;
  std::uint64_t least = ~std::uint64_t{0};
  for (std::size_t type = 0; type < candidates.size(); ++type) {
    candidates[type].resize(row.size() + 1);
    Filter(static_cast<int>(type), row, above, pixel, candidates[type]);
    std::uint64_t sum = 0;
    for (std::size_t i = 1; i <= row.size(); ++i) {
      sum += static_cast<std::uint64_t>(std::abs(static_cast<std::int8_t>(candidates[type][i])));
    }
    if (sum < least) {
      least = sum;
      best = type;
    }
  }
  return candidates[best];
}

// PNG, section 11.2.2: colour types.
constexpr char kPaletteType = 3;
char ColourType(PixelKind kind) {
  switch (kind) {
    case PixelKind::kGrey:
      return 0;
    case PixelKind::kGreyAlpha:
      return 4;
    case PixelKind::kRgb:
      return 2;
    case PixelKind::kRgba:
      break;
  }
  return 6;
}

std::string Encode(const PixelView& pixels, char colour_type, Palette palette) {
  const auto pixel = static_cast<std::size_t>(pixels.kind);
  TERRACE_CHECK(pixels.width > 0 && pixels.height > 0);
  const std::size_t row_bytes = pixel * static_cast<std::size_t>(pixels.width);
  TERRACE_CHECK(pixels.samples.size() == row_bytes * static_cast<std::size_t>(pixels.height));
  const PngRow nothing(row_bytes);
  std::array<PngRow, 5> candidates;
  std::string filtered;
  filtered.reserve((row_bytes + 1) * static_cast<std::size_t>(pixels.height));
  std::span<const std::uint8_t> above = nothing;
  for (std::size_t at = 0; at < pixels.samples.size(); at += row_bytes) {
    const std::span<const std::uint8_t> row = pixels.samples.subspan(at, row_bytes);
    const PngRow& best = BestFilter(row, above, pixel, candidates);
    filtered.append(reinterpret_cast<const char*>(best.data()), best.size());
    above = row;
  }

  std::string header;
  PutBigEndian(header, static_cast<std::uint32_t>(pixels.width));
  PutBigEndian(header, static_cast<std::uint32_t>(pixels.height));
  header += '\x08';  // bits
  header += colour_type;
  header += std::string_view("\x00\x00\x00", 3);  // deflate, these filters, no interlace
  std::string png("\x89PNG\r\n\x1a\n");
  PutChunk(png, "IHDR", header);
  if (!palette.empty()) {
    std::string colours, alphas;
    for (const auto& [red, green, blue, alpha] : palette) {
      for (const std::uint8_t sample : {red, green, blue}) colours += static_cast<char>(sample);
      alphas += static_cast<char>(alpha);
    }
    while (alphas.ends_with('\xff')) alphas.pop_back();
    PutChunk(png, "PLTE", colours);
    if (!alphas.empty()) PutChunk(png, "tRNS", alphas);
  }
  PutChunk(png, "IDAT", Zlib(filtered));
  PutChunk(png, "IEND", "");
  return png;
}

}  // namespace

std::string EncodePng(const PixelView& pixels) { return Encode(pixels, ColourType(pixels.kind), {}); }

std::string EncodePalettePng(const PixelView& indices, Palette palette) {
  TERRACE_CHECK(indices.kind == PixelKind::kGrey && !palette.empty() && palette.size() <= 256);
  for (const std::uint8_t index : indices.samples) TERRACE_CHECK(index < palette.size());
  return Encode(indices, kPaletteType, palette);
}

}  // namespace terrace::proto
