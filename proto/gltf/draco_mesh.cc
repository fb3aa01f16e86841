#include "proto/gltf/draco_mesh.h"

#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#include <draco/mesh/mesh.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "engine/core/check.h"

namespace terrace::proto {
namespace {

using Position = std::array<std::int32_t, 3>;

// The grid as passed to Draco.
struct Quantization {
  Position origin{};  // in steps
  int bits = 1;
};

// The library passes origin and range as text with six decimals, so both must be exact in this form. The origin is in
// whole metres, and the range is at least 16 m, where floats are more than 10^-6 apart. Neither moves a grid point; the
// larger range adds bits that are always 0.
Quantization QuantizationOf(const GridMesh& mesh) {
  constexpr double kMinRangeMetres = 16;
  const auto whole = static_cast<std::int32_t>(std::max(1.0, 1 / mesh.step_m));
  Position min = mesh.positions.front(), max = min;
  for (const Position& p : mesh.positions) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      min[axis] = std::min(min[axis], p[axis]);
      max[axis] = std::max(max[axis], p[axis]);
    }
  }
  Quantization quantization;
  auto longest = static_cast<std::uint32_t>(std::ceil(kMinRangeMetres / mesh.step_m));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int32_t above = ((min[axis] % whole) + whole) % whole;
    quantization.origin[axis] = min[axis] - above;
    longest = std::max(longest, static_cast<std::uint32_t>(max[axis] - quantization.origin[axis]));
  }
  quantization.bits = static_cast<int>(std::bit_width(longest));
  return quantization;
}

int AddAttribute(draco::Mesh& mesh, draco::GeometryAttribute::Type type, std::size_t count, int components = 3) {
  draco::GeometryAttribute attribute;
  attribute.Init(type, nullptr, static_cast<std::int8_t>(components), draco::DT_FLOAT32, false,
                 components * static_cast<std::int64_t>(sizeof(float)), 0);
  return mesh.AddAttribute(attribute, /*identity_mapping=*/true,
                           static_cast<draco::AttributeValueIndex::ValueType>(count));
}

// Exact: a multiple of the step below 2^24 steps.
float Metres(std::int32_t steps, double step_m) { return static_cast<float>(steps * step_m); }

std::unique_ptr<draco::Mesh> ToDraco(const GridMesh& grid, int& position_attribute, int& normal_attribute) {
  auto mesh = std::make_unique<draco::Mesh>();
  const std::size_t count = grid.positions.size();
  mesh->set_num_points(static_cast<draco::PointIndex::ValueType>(count));
  position_attribute = AddAttribute(*mesh, draco::GeometryAttribute::POSITION, count);
  normal_attribute = AddAttribute(*mesh, draco::GeometryAttribute::NORMAL, count);
  draco::PointAttribute* const positions = mesh->attribute(position_attribute);
  draco::PointAttribute* const normals = mesh->attribute(normal_attribute);
  for (std::uint32_t k = 0; k < count; ++k) {
    const auto& [x, y, z] = grid.positions[k];
    const std::array<float, 3> p{Metres(x, grid.step_m), Metres(y, grid.step_m), Metres(z, grid.step_m)};
    positions->SetAttributeValue(draco::AttributeValueIndex(k), p.data());
    const geo::Vec3& n = grid.normals[k];
    const std::array<float, 3> unit{static_cast<float>(n.x), static_cast<float>(n.y), static_cast<float>(n.z)};
    normals->SetAttributeValue(draco::AttributeValueIndex(k), unit.data());
  }
  mesh->SetNumFaces(grid.triangles.size());
  for (std::uint32_t t = 0; t < grid.triangles.size(); ++t) {
    const auto& [a, b, c] = grid.triangles[t];
    mesh->SetFace(draco::FaceIndex(t), {draco::PointIndex(a), draco::PointIndex(b), draco::PointIndex(c)});
  }
  return mesh;
}

// Bits of each texture coordinate. A 4095th of the picture's edge is an eighth of a pixel of 512.
constexpr int kUvBits = 12;

int AddTextureCoordinates(const GridMesh& grid, draco::Mesh& mesh) {
  const int id = AddAttribute(mesh, draco::GeometryAttribute::TEX_COORD, grid.uv.size(), 2);
  draco::PointAttribute* const coordinates = mesh.attribute(id);
  for (std::uint32_t k = 0; k < grid.uv.size(); ++k) {
    const auto cells = static_cast<float>(grid.cells);
    const std::array<float, 2> uv{static_cast<float>(grid.uv[k][0]) / cells, static_cast<float>(grid.uv[k][1]) / cells};
    coordinates->SetAttributeValue(draco::AttributeValueIndex(k), uv.data());
  }
  return id;
}

std::uint64_t Mix(std::uint64_t value) {
  value = (value ^ (value >> 30)) * 0xbf58476d1ce4e5b9;
  value = (value ^ (value >> 27)) * 0x94d049bb133111eb;
  return value ^ (value >> 31);
}

std::uint64_t HashOf(const Position& p) {
  const auto bits = [&](std::size_t axis) { return static_cast<std::uint64_t>(static_cast<std::uint32_t>(p[axis])); };
  return Mix(Mix(bits(0) << 32 | bits(1)) ^ (bits(2) + 0x9e3779b97f4a7c15));
}

std::uint64_t HashOf(const std::array<std::uint16_t, 2>& uv) { return Mix(std::uint64_t{uv[0]} << 32 | uv[1]); }

// A checksum of the triangles that does not depend on their order or first corners, but on their orientation.
class TriangleSum {
 public:
  void Add(std::uint64_t a, std::uint64_t b, std::uint64_t c) {
    sum_ += Mix(a + 2 * b) + Mix(b + 2 * c) + Mix(c + 2 * a);
    triples_ += Mix(a ^ b ^ c);
  }
  friend bool operator==(const TriangleSum&, const TriangleSum&) = default;

 private:
  std::uint64_t sum_ = 0, triples_ = 0;
};

TriangleSum SumOf(const GridMesh& grid, bool uv) {
  std::vector<std::uint64_t> hash;
  hash.reserve(grid.positions.size());
  for (const Position& p : grid.positions) hash.push_back(HashOf(p));
  for (std::size_t k = 0; uv && k < hash.size(); ++k) hash[k] ^= HashOf(grid.uv[k]);
  TriangleSum sum;
  for (const auto& [a, b, c] : grid.triangles) sum.Add(hash[a], hash[b], hash[c]);
  return sum;
}

tl::unexpected<Error> Failed(const char* what) { return MakeError(ErrorCode::kInternal, "Draco: {}", what); }

// Adds the texture coordinates of the decoded mesh to the hashes of its points.
Result<void> ReadTextureCoordinates(const draco::Mesh& mesh, std::uint32_t uv_id, int cells_of_grid,
                                    std::vector<std::uint64_t>& hash) {
  const draco::PointAttribute* const coordinates = mesh.GetAttributeByUniqueId(uv_id);
  if (!coordinates) return Failed("the texture coordinates are missing");
  for (std::uint32_t k = 0; k < hash.size(); ++k) {
    std::array<float, 2> uv{};
    coordinates->GetMappedValue(draco::PointIndex(k), uv.data());
    std::array<std::uint16_t, 2> node{};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      // Half a step of 12 bits is less than half a lattice cell.
      const double cells = std::floor(static_cast<double>(uv[axis]) * cells_of_grid + 0.5);
      if (!(cells >= 0 && cells <= cells_of_grid)) return Failed("a texture coordinate left the picture");
      node[axis] = static_cast<std::uint16_t>(cells);
    }
    hash[k] ^= HashOf(node);
  }
  return {};
}

// Sets the members that describe the decoded mesh.
Result<void> ReadBack(const GridMesh& grid, const DracoOptions& options, DracoMesh& encoded) {
  draco::DecoderBuffer buffer;
  buffer.Init(encoded.bytes.data(), encoded.bytes.size());
  draco::Decoder decoder;
  const auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) return Failed(decoded.status().error_msg());
  const draco::Mesh& mesh = *decoded.value();
  const draco::PointAttribute* const positions = mesh.GetAttributeByUniqueId(encoded.position_id);
  if (!positions || !mesh.GetAttributeByUniqueId(encoded.normal_id)) return Failed("an attribute is missing");
  encoded.points = mesh.num_points();
  encoded.triangles = mesh.num_faces();
  if (encoded.points == 0 || encoded.triangles != grid.triangles.size()) return Failed("triangles are missing");

  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  encoded.min.fill(kInfinity);
  encoded.max.fill(-kInfinity);
  std::vector<std::uint64_t> hash;
  hash.reserve(encoded.points);
  for (std::uint32_t k = 0; k < encoded.points; ++k) {
    std::array<float, 3> p{};
    positions->GetMappedValue(draco::PointIndex(k), p.data());
    Position steps{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double metres = static_cast<double>(p[axis]);
      encoded.min[axis] = std::min(encoded.min[axis], metres);
      encoded.max[axis] = std::max(encoded.max[axis], metres);
      const double count = metres / grid.step_m;
      if (!(std::abs(count) < 0x1p24) || count != std::floor(count)) return Failed("a position left the grid");
      steps[axis] = static_cast<std::int32_t>(count);
    }
    hash.push_back(HashOf(steps));
  }
  if (options.uv) {
    if (Result<void> read = ReadTextureCoordinates(mesh, encoded.uv_id, grid.cells, hash); !read) return read;
  }
  TriangleSum sum;
  for (std::uint32_t t = 0; t < mesh.num_faces(); ++t) {
    const draco::Mesh::Face& face = mesh.face(draco::FaceIndex(t));
    sum.Add(hash[face[0].value()], hash[face[1].value()], hash[face[2].value()]);
  }
  if (!(sum == SumOf(grid, options.uv))) return Failed("a triangle came back changed");
  return {};
}

}  // namespace

Result<DracoMesh> EncodeDraco(const GridMesh& grid, const DracoOptions& options) {
  TERRACE_CHECK(!grid.triangles.empty());
  constexpr int kMaxBits = 24;  // FitsFloats has a margin for the origin's rounding
  const Quantization quantization = QuantizationOf(grid);
  if (quantization.bits > kMaxBits) return Failed("the grid is too fine for 32-bit floats");
  // The quotient by the range is exactly 1 / step in floats: the range is a power of two times 2^bits - 1, which a
  // float represents exactly.
  std::array<float, 3> origin{};
  for (std::size_t axis = 0; axis < 3; ++axis) origin[axis] = Metres(quantization.origin[axis], grid.step_m);
  const auto range = static_cast<float>(std::ldexp(1.0, quantization.bits) - 1) * static_cast<float>(grid.step_m);

  int position_attribute = 0, normal_attribute = 0;
  const std::unique_ptr<draco::Mesh> mesh = ToDraco(grid, position_attribute, normal_attribute);
  const int uv_attribute = options.uv ? AddTextureCoordinates(grid, *mesh) : -1;
  draco::ExpertEncoder encoder(*mesh);
  encoder.SetSpeedOptions(options.speed, options.speed);
  encoder.SetAttributeExplicitQuantization(position_attribute, quantization.bits, 3, origin.data(), range);
  encoder.SetAttributeQuantization(normal_attribute, options.normal_bits);
  if (options.uv) {
    constexpr std::array<float, 2> kCorner{0, 0};
    encoder.SetAttributeExplicitQuantization(uv_attribute, kUvBits, 2, kCorner.data(), 1);
  }
  draco::EncoderBuffer buffer;
  if (const draco::Status status = encoder.EncodeToBuffer(&buffer); !status.ok()) return Failed(status.error_msg());

  DracoMesh encoded;
  encoded.bytes.assign(buffer.data(), buffer.size());
  encoded.position_id = mesh->attribute(position_attribute)->unique_id();
  encoded.normal_id = mesh->attribute(normal_attribute)->unique_id();
  if (options.uv) encoded.uv_id = mesh->attribute(uv_attribute)->unique_id();
  if (const Result<void> same = ReadBack(grid, options, encoded); !same) return tl::unexpected(same.error());
  return encoded;
}

}  // namespace terrace::proto
