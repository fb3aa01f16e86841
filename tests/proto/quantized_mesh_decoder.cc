#include "tests/proto/quantized_mesh_decoder.h"

#include <bit>
#include <cmath>

namespace terrace::proto {
namespace {

// Assembles little-endian values byte by byte. After the first read past the end all values are zero.
class Cursor {
 public:
  explicit Cursor(std::string_view bytes) : bytes_(bytes) {}

  std::uint64_t Unsigned(int width) {
    std::uint64_t value = 0;
    if (left() < static_cast<std::size_t>(width)) {
      failed_ = true;
      at_ = bytes_.size();
      return 0;
    }
    for (int i = 0; i < width; ++i) {
      value |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes_[at_++])) << (8 * i);
    }
    return value;
  }
  std::uint32_t U32() { return static_cast<std::uint32_t>(Unsigned(4)); }
  float F32() { return std::bit_cast<float>(U32()); }
  double F64() { return std::bit_cast<double>(Unsigned(8)); }
  std::array<double, 3> Vector() {
    const double x = F64(), y = F64(), z = F64();
    return {x, y, z};
  }
  void AlignTo(std::size_t width) { Bytes((width - at_ % width) % width); }
  // Fails and returns false if fewer than `count` items of `width` bytes are left, so no allocation is larger than the
  // input.
  bool Holds(std::uint64_t count, std::uint64_t width) {
    if (count * width > left()) failed_ = true;
    return !failed_;
  }
  std::string Bytes(std::size_t count) {
    if (!Holds(count, 1)) return {};
    at_ += count;
    return std::string(bytes_.substr(at_ - count, count));
  }
  std::size_t left() const { return bytes_.size() - at_; }
  bool failed() const { return failed_; }
  void Fail() { failed_ = true; }

 private:
  std::string_view bytes_;
  std::size_t at_ = 0;
  bool failed_ = false;
};

std::vector<int> ZigZagDeltas(Cursor& in, std::uint32_t count) {
  std::vector<int> values;
  if (!in.Holds(count, 2)) return values;
  int value = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const int code = static_cast<int>(in.Unsigned(2));
    value += code % 2 == 0 ? code / 2 : -(code + 1) / 2;
    if (value < 0 || value > 32767) in.Fail();
    values.push_back(value);
  }
  return values;
}

std::vector<std::array<std::uint32_t, 3>> Triangles(Cursor& in, int width, std::uint32_t vertex_count) {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  const std::uint32_t count = in.U32();
  if (!in.Holds(count, 3 * static_cast<std::uint64_t>(width))) return triangles;
  std::uint32_t highest = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    std::array<std::uint32_t, 3> triangle{};
    for (std::uint32_t& index : triangle) {
      const std::uint32_t code = static_cast<std::uint32_t>(in.Unsigned(width));
      index = highest - code;
      if (code == 0) ++highest;
      if (code > highest || index >= vertex_count) in.Fail();
    }
    triangles.push_back(triangle);
  }
  return triangles;
}

std::vector<std::uint32_t> Edge(Cursor& in, int width, std::uint32_t vertex_count) {
  std::vector<std::uint32_t> indices;
  const std::uint32_t count = in.U32();
  if (!in.Holds(count, static_cast<std::uint64_t>(width))) return indices;
  for (std::uint32_t i = 0; i < count; ++i) {
    indices.push_back(static_cast<std::uint32_t>(in.Unsigned(width)));
    if (indices.back() >= vertex_count) in.Fail();
  }
  return indices;
}

}  // namespace

std::optional<DecodedTile> DecodeQuantizedMesh(std::string_view bytes) {
  Cursor in(bytes);
  DecodedTile tile;
  tile.center = in.Vector();
  tile.min_height = in.F32();
  tile.max_height = in.F32();
  tile.sphere_center = in.Vector();
  tile.sphere_radius = in.F64();
  tile.horizon_point = in.Vector();
  const std::uint32_t vertex_count = in.U32();
  tile.u = ZigZagDeltas(in, vertex_count);
  tile.v = ZigZagDeltas(in, vertex_count);
  tile.h = ZigZagDeltas(in, vertex_count);
  const int width = vertex_count > 65536 ? 4 : 2;
  in.AlignTo(static_cast<std::size_t>(width));
  tile.triangles = Triangles(in, width, vertex_count);
  for (auto* edge : {&tile.west, &tile.south, &tile.east, &tile.north}) *edge = Edge(in, width, vertex_count);
  while (!in.failed() && in.left() > 0) {
    const std::uint8_t id = static_cast<std::uint8_t>(in.Unsigned(1));
    const std::uint32_t length = in.U32();
    tile.extensions.push_back({id, in.Bytes(length)});
  }
  if (in.failed()) return std::nullopt;
  return tile;
}

std::array<double, 3> DecodeOctNormal(std::uint8_t x_byte, std::uint8_t y_byte) {
  double x = x_byte / 255.0 * 2 - 1, y = y_byte / 255.0 * 2 - 1;
  const double z = 1 - std::abs(x) - std::abs(y);
  if (z < 0) {
    const double old_x = x;
    x = (1 - std::abs(y)) * (old_x < 0 ? -1 : 1);
    y = (1 - std::abs(old_x)) * (y < 0 ? -1 : 1);
  }
  const double length = std::sqrt(x * x + y * y + z * z);
  return {x / length, y / length, z / length};
}

}  // namespace terrace::proto
