#include "proto/documents/height_png.h"

#include <libdeflate.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "engine/core/check.h"
#include "proto/compress.h"

namespace terrace::proto {
namespace {

constexpr int kChannels = 3;
constexpr std::uint32_t kLastCode = (1u << 24) - 1;

using Row = std::vector<std::uint8_t>;

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

// PNG, section 9.2. The filter type comes first.
void Filter(int type, const Row& row, const Row& above, Row& out) {
  out[0] = static_cast<std::uint8_t>(type);
  for (std::size_t i = 0; i < row.size(); ++i) {
    const bool first = i < kChannels;
    const int a = first ? 0 : row[i - kChannels], b = above[i], c = first ? 0 : above[i - kChannels];
    const std::array<int, 5> predictions = {0, a, b, (a + b) / 2, Paeth(a, b, c)};
    out[i + 1] = static_cast<std::uint8_t>(row[i] - predictions[static_cast<std::size_t>(type)]);
  }
}

// The filter with the smallest sum of absolute output values, bytes taken as signed: the heuristic of PNG, section
// 12.7.
const Row& BestFilter(const Row& row, const Row& above, std::array<Row, 5>& candidates) {
  std::size_t best = 0;
  std::uint64_t least = ~std::uint64_t{0};
  for (std::size_t type = 0; type < candidates.size(); ++type) {
    candidates[type].resize(row.size() + 1);
    Filter(static_cast<int>(type), row, above, candidates[type]);
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

}  // namespace

std::uint32_t EncodeHeight(double metres, HeightEncoding encoding) {
  const double code = encoding == HeightEncoding::kMapbox ? (metres + 10000) * 10 : (metres + 32768) * 256;
  return static_cast<std::uint32_t>(std::clamp(std::round(code), 0.0, static_cast<double>(kLastCode)));
}

double DecodeHeight(std::uint32_t code, HeightEncoding encoding) {
  return encoding == HeightEncoding::kMapbox ? code / 10.0 - 10000 : code / 256.0 - 32768;
}

std::string EncodeHeightPng(std::span<const float> heights, int size, HeightEncoding encoding) {
  const auto width = static_cast<std::size_t>(size);
  TERRACE_CHECK(size > 0 && heights.size() == width * width);
  Row row(width * kChannels), above(row.size());
  std::array<Row, 5> candidates;
  std::string filtered;
  filtered.reserve((row.size() + 1) * width);
  for (std::size_t y = 0; y < width; ++y) {
    for (std::size_t x = 0; x < width; ++x) {
      const std::uint32_t code = EncodeHeight(heights[y * width + x], encoding);
      for (const int channel : {0, 1, 2}) {
        row[x * kChannels + static_cast<std::size_t>(channel)] = static_cast<std::uint8_t>(code >> (16 - 8 * channel));
      }
    }
    const Row& best = BestFilter(row, above, candidates);
    filtered.append(reinterpret_cast<const char*>(best.data()), best.size());
    std::swap(row, above);
  }

  std::string header;
  PutBigEndian(header, static_cast<std::uint32_t>(size));
  PutBigEndian(header, static_cast<std::uint32_t>(size));
  header +=
      std::string_view("\x08\x02\x00\x00\x00", 5);  // 8 bits, red green blue, deflate, these filters, no interlace
  std::string png("\x89PNG\r\n\x1a\n");
  PutChunk(png, "IHDR", header);
  PutChunk(png, "IDAT", Zlib(filtered));
  PutChunk(png, "IEND", "");
  return png;
}

}  // namespace terrace::proto
