#include "proto/gltf/mesh_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <stop_token>
#include <streambuf>

namespace terrace::proto {
namespace {

using Json = nlohmann::json;
using Triangles = std::vector<std::array<std::uint32_t, 3>>;

const std::vector<MeshVertex> kSquare = {
    {500000.1, 4000000.2, 10}, {500010.1, 4000000.2, 1.0 / 3}, {500010.1, 4000020.2, -7.5}, {500000.1, 4000020.2, 12}};
const Triangles kTwo = {{0, 1, 2}, {0, 2, 3}};
const std::vector<Rgb> kColors = {{0, 127, 255}, {1, 2, 3}, {254, 100, 50}, {255, 255, 255}};

std::string Written(MeshFileFormat format, const std::vector<MeshVertex>& vertices, const Triangles& triangles,
                    const std::vector<Rgb>& colors = {}, const std::optional<GridPlacement>& placement = {}) {
  std::ostringstream out;
  const Result<void> result = WriteMesh(out, format, vertices, triangles, colors, placement);
  EXPECT_TRUE(result.has_value()) << (result ? "" : result.error().message);
  return out.str();
}

template <typename T>
T At(const std::string& bytes, std::size_t offset) {
  T value{};
  EXPECT_LE(offset + sizeof(T), bytes.size());
  if (offset + sizeof(T) <= bytes.size()) std::memcpy(&value, bytes.data() + offset, sizeof(T));
  return value;
}

struct Glb {
  Json json;
  std::string buffer;
};

Glb ParseGlb(const std::string& bytes) {
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(At<std::uint32_t>(bytes, 4), 2u);
  EXPECT_EQ(At<std::uint32_t>(bytes, 8), bytes.size());
  const std::uint32_t json_size = At<std::uint32_t>(bytes, 12);
  EXPECT_EQ(json_size % 4, 0u);
  EXPECT_EQ(bytes.substr(16, 4), "JSON");
  const std::uint32_t buffer_size = At<std::uint32_t>(bytes, 20 + json_size);
  EXPECT_EQ(bytes.substr(24 + json_size, 4), std::string("BIN\0", 4));
  EXPECT_EQ(28 + json_size + buffer_size, bytes.size());
  EXPECT_EQ(buffer_size % 4, 0u);
  return {Json::parse(bytes.substr(20, json_size)), bytes.substr(28 + json_size)};
}

std::array<double, 3> StoredVertex(const Glb& glb, std::size_t i) {
  std::array<double, 3> p{};
  for (std::size_t axis = 0; axis < 3; ++axis) p[axis] = At<float>(glb.buffer, (3 * i + axis) * 4);
  return p;
}

// The position of a vertex in the axes of the mesh: applies the node matrix, then rotates y-up to z-up.
MeshVertex GlbVertex(const Glb& glb, std::size_t i) {
  const auto m = glb.json.at("nodes").at(0).at("matrix").get<std::array<double, 16>>();
  const std::array<double, 3> stored = StoredVertex(glb, i);
  std::array<double, 3> p{};
  for (std::size_t row = 0; row < 3; ++row) {
    p[row] = m[12 + row];
    for (std::size_t k = 0; k < 3; ++k) p[row] += m[4 * k + row] * stored[k];
  }
  return {p[0], -p[2], p[1]};
}

TEST(MeshFile, FormatFollowsTheExtension) {
  EXPECT_EQ(MeshFileFormatOf("out/a.obj").value(), MeshFileFormat::kObj);
  EXPECT_EQ(MeshFileFormatOf("a.b.PLY").value(), MeshFileFormat::kPly);
  EXPECT_EQ(MeshFileFormatOf("a.Glb").value(), MeshFileFormat::kGlb);
  for (const char* name : {"a.stl", "a", "", "obj", "a.obj/b", "a.gltf"}) {
    const Result<MeshFileFormat> format = MeshFileFormatOf(name);
    ASSERT_FALSE(format.has_value()) << name;
    EXPECT_EQ(format.error().code, ErrorCode::kInvalidArgument);
    EXPECT_NE(format.error().message.find(".obj, .ply or .glb"), std::string::npos);
  }
}

TEST(MeshFile, ObjReadsBackToTheSameDoubles) {
  std::istringstream in(Written(MeshFileFormat::kObj, kSquare, kTwo));
  std::vector<std::array<double, 3>> vertices;
  Triangles triangles;
  for (std::string line; std::getline(in, line);) {
    std::array<double, 3> p{};
    std::array<std::uint32_t, 3> t{};
    if (std::sscanf(line.c_str(), "v %lf %lf %lf", &p[0], &p[1], &p[2]) == 3) vertices.push_back(p);
    if (std::sscanf(line.c_str(), "f %u %u %u", &t[0], &t[1], &t[2]) == 3) {
      triangles.push_back({t[0] - 1, t[1] - 1, t[2] - 1});
    }
  }
  ASSERT_EQ(vertices.size(), kSquare.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    EXPECT_EQ(vertices[i], (std::array<double, 3>{kSquare[i].x, kSquare[i].y, kSquare[i].z}));
  }
  EXPECT_EQ(triangles, kTwo);
}

TEST(MeshFile, PlyHoldsDoublesAndIndicesBehindItsHeader) {
  const std::string bytes = Written(MeshFileFormat::kPly, kSquare, kTwo);
  const std::string end = "end_header\n";
  const std::size_t data = bytes.find(end) + end.size();
  EXPECT_EQ(
      bytes.substr(0, data),
      "ply\nformat binary_little_endian 1.0\ncomment terrace\nelement vertex 4\nproperty double x\n"
      "property double y\nproperty double z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n");
  ASSERT_EQ(bytes.size(), data + 4 * 24 + 2 * 13);
  for (std::size_t i = 0; i < kSquare.size(); ++i) {
    EXPECT_EQ(At<double>(bytes, data + 24 * i), kSquare[i].x);
    EXPECT_EQ(At<double>(bytes, data + 24 * i + 8), kSquare[i].y);
    EXPECT_EQ(At<double>(bytes, data + 24 * i + 16), kSquare[i].z);
  }
  for (std::size_t i = 0; i < kTwo.size(); ++i) {
    EXPECT_EQ(bytes[data + 96 + 13 * i], 3);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(At<std::uint32_t>(bytes, data + 97 + 13 * i + 4 * k), kTwo[i][k]);
  }
}

TEST(MeshFile, GlbPutsLargeCoordinatesIntoTheNode) {
  const Glb glb = ParseGlb(Written(MeshFileFormat::kGlb, kSquare, kTwo));
  EXPECT_EQ(glb.json.at("asset"), (Json{{"version", "2.0"}, {"generator", "terrace"}}));
  for (std::size_t i = 0; i < kSquare.size(); ++i) {
    const MeshVertex v = GlbVertex(glb, i);
    EXPECT_NEAR(v.x, kSquare[i].x, 1e-6);
    EXPECT_NEAR(v.y, kSquare[i].y, 1e-6);
    EXPECT_NEAR(v.z, kSquare[i].z, 1e-6);
  }
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(At<std::uint16_t>(glb.buffer, 48 + 2 * i), kTwo[i / 3][i % 3]);
}

// Steps of 1/3600 degree do not fit into 32-bit floats; columns and rows do.
TEST(MeshFile, GlbHoldsTheGridOfARasterItself) {
  const double step = 1 / 3600.0, cosine = std::cos(0.3), sine = std::sin(0.3);
  const std::vector<MeshVertex> grid = {
      {0.5, 0.5, 8848.86F}, {32767.5, 0.5, -413.1F}, {32767.5, 20001.5, 0.1F}, {1234.5, 19999.5, 1e-3F}};
  const std::vector<GridPlacement> placements = {
      {10.003, step, 0, 46.5, 0, -step},                                   // north up
      {10.003, step, 0, 46.5, 0, step},                                    // south up
      {500000.1, 10 * cosine, 10 * sine, 5.1e6, 10 * sine, -10 * cosine},  // turned
      {500000.1, 0, 30, 5.1e6, 30, 0},                                     // rows are columns
      {0, 1, 0, 0, 0, 1}};                                                 // no georeference
  for (const GridPlacement& t : placements) {
    SCOPED_TRACE(testing::PrintToString(t));
    const Glb glb = ParseGlb(Written(MeshFileFormat::kGlb, grid, kTwo, {}, t));
    const double to_south = t[1] * t[5] - t[2] * t[4] < 0 ? 1 : -1;
    for (std::size_t i = 0; i < grid.size(); ++i) {
      const MeshVertex& g = grid[i];
      EXPECT_EQ(StoredVertex(glb, i), (std::array<double, 3>{g.x, g.z, to_south * g.y}));
      const MeshVertex v = GlbVertex(glb, i);
      EXPECT_NEAR(v.x, t[0] + g.x * t[1] + g.y * t[2], 1e-15 * 6e6);
      EXPECT_NEAR(v.y, t[3] + g.x * t[4] + g.y * t[5], 1e-15 * 6e6);
      EXPECT_EQ(v.z, g.z);
    }
    // The accessor's bounds are those of the stored values, and the matrix does not mirror.
    const Json& accessor = glb.json.at("accessors").at(0);
    EXPECT_EQ(accessor.at("max").at(0), 32767.5);
    EXPECT_EQ(accessor.at("max").at(1), 8848.86F);
    const auto m = glb.json.at("nodes").at(0).at("matrix").get<std::array<double, 16>>();
    EXPECT_GT(m[0] * m[10] - m[2] * m[8], 0);
    EXPECT_NEAR(m[0] * m[8] + m[2] * m[10], 0, 1e-12);
  }
}

// A glTF node cannot be sheared, so positions are rounded, as those of other meshes.
TEST(MeshFile, GlbOfAShearedRasterHasItsCoordinates) {
  const GridPlacement sheared = {100, 2, 1, 200, 0, -2};
  const std::vector<MeshVertex> grid = {{0.5, 0.5, 1}, {9.5, 0.5, 2}, {9.5, 7.5, 3}, {0.5, 7.5, 4}};
  const Glb glb = ParseGlb(Written(MeshFileFormat::kGlb, grid, kTwo, {}, sheared));
  const auto m = glb.json.at("nodes").at(0).at("matrix").get<std::vector<double>>();
  EXPECT_EQ(std::vector(m.begin(), m.begin() + 12), (std::vector<double>{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}));
  for (std::size_t i = 0; i < grid.size(); ++i) {
    const MeshVertex v = GlbVertex(glb, i);
    EXPECT_NEAR(v.x, 100 + 2 * grid[i].x + grid[i].y, 1e-6);
    EXPECT_NEAR(v.y, 200 - 2 * grid[i].y, 1e-6);
    EXPECT_NEAR(v.z, grid[i].z, 1e-6);
  }
}

TEST(MeshFile, TextAndPlyHoldThePlacedCoordinates) {
  const GridPlacement t = {10.003, 1 / 3600.0, 0, 46.5, 0, -1 / 3600.0};
  const std::string ply =
      Written(MeshFileFormat::kPly, {{0.5, 2.5, 7}, {9.5, 2.5, 7}, {0.5, 8.5, 7}}, {{0, 1, 2}}, {}, t);
  const std::size_t data = ply.find("end_header\n") + 11;
  EXPECT_EQ(At<double>(ply, data), 10.003 + 0.5 * t[1]);
  EXPECT_EQ(At<double>(ply, data + 8), 46.5 + 2.5 * t[5]);
  EXPECT_EQ(At<double>(ply, data + 16), 7);
}

TEST(MeshFile, GlbBoundsAreThoseOfTheStoredFloats) {
  const Glb glb = ParseGlb(Written(MeshFileFormat::kGlb, kSquare, kTwo));
  const Json& accessor = glb.json.at("accessors").at(0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    float min = std::numeric_limits<float>::infinity(), max = -min;
    for (std::size_t i = 0; i < kSquare.size(); ++i) {
      min = std::min(min, At<float>(glb.buffer, (3 * i + axis) * 4));
      max = std::max(max, At<float>(glb.buffer, (3 * i + axis) * 4));
    }
    EXPECT_EQ(accessor.at("min").at(axis).get<double>(), min);
    EXPECT_EQ(accessor.at("max").at(axis).get<double>(), max);
  }
}

TEST(MeshFile, GlbWidensIndicesPast65535Vertices) {
  for (std::uint32_t count : {65535u, 65536u}) {
    const std::vector<MeshVertex> vertices(count);
    const Glb glb = ParseGlb(Written(MeshFileFormat::kGlb, vertices, {{0, 1, count - 1}}));
    const Json& accessor = glb.json.at("accessors").at(1);
    const std::size_t offset = glb.json.at("bufferViews").at(1).at("byteOffset");
    if (count == 65535) {
      EXPECT_EQ(accessor.at("componentType"), 5123);
      EXPECT_EQ(At<std::uint16_t>(glb.buffer, offset + 4), 65534);
    } else {
      EXPECT_EQ(accessor.at("componentType"), 5125);
      EXPECT_EQ(At<std::uint32_t>(glb.buffer, offset + 8), 65535u);
    }
    EXPECT_EQ(glb.json.at("buffers").at(0).at("byteLength"), glb.buffer.size());
  }
}

TEST(MeshFile, ObjColorsReadBackToTheSameBytes) {
  std::vector<MeshVertex> vertices(256);
  std::vector<Rgb> colors;
  for (int i = 0; i < 256; ++i) {
    colors.push_back(
        {static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(255 - i), static_cast<std::uint8_t>(7 * i)});
  }
  std::istringstream in(Written(MeshFileFormat::kObj, vertices, {{0, 1, 2}}, colors));
  std::size_t count = 0;
  for (std::string line; std::getline(in, line);) {
    std::array<double, 6> p{};
    if (std::sscanf(line.c_str(), "v %lf %lf %lf %lf %lf %lf", &p[0], &p[1], &p[2], &p[3], &p[4], &p[5]) != 6) continue;
    ASSERT_LT(count, colors.size());
    for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(std::lround(255 * p[3 + k]), colors[count][k]);
    ++count;
  }
  EXPECT_EQ(count, colors.size());
}

TEST(MeshFile, PlyHoldsColorsAsBytesBehindEachPosition) {
  const std::string bytes = Written(MeshFileFormat::kPly, kSquare, kTwo, kColors);
  EXPECT_NE(
      bytes.find("property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 2"),
      std::string::npos);
  const std::string end = "end_header\n";
  const std::size_t data = bytes.find(end) + end.size();
  ASSERT_EQ(bytes.size(), data + 4 * 27 + 2 * 13);
  for (std::size_t i = 0; i < kSquare.size(); ++i) {
    EXPECT_EQ(At<double>(bytes, data + 27 * i + 16), kSquare[i].z);
    EXPECT_EQ(At<Rgb>(bytes, data + 27 * i + 24), kColors[i]);
  }
  EXPECT_EQ(bytes[data + 108], 3);
}

// Without one, clients draw the metal of glTF's default material: nearly black.
TEST(MeshFile, GlbHasAMaterialThatIsNoMetal) {
  const Glb glb = ParseGlb(Written(MeshFileFormat::kGlb, kSquare, kTwo, {}));
  const Json& primitive = glb.json.at("meshes").at(0).at("primitives").at(0);
  const Json& material = glb.json.at("materials").at(primitive.at("material").get<std::size_t>());
  EXPECT_EQ(material.at("pbrMetallicRoughness").at("metallicFactor"), 0);
}

TEST(MeshFile, GlbColorsAreLinearAndAligned) {
  const Triangles odd = {{0, 1, 2}};  // 6 bytes of indices
  for (const Triangles& triangles : {kTwo, odd}) {
    const Glb glb = ParseGlb(Written(MeshFileFormat::kGlb, kSquare, triangles, kColors));
    const Json& primitive = glb.json.at("meshes").at(0).at("primitives").at(0);
    EXPECT_EQ(glb.json.at("materials")
                  .at(primitive.at("material").get<std::size_t>())
                  .at("pbrMetallicRoughness")
                  .at("metallicFactor"),
              0);
    const Json& accessor = glb.json.at("accessors").at(primitive.at("attributes").at("COLOR_0").get<std::size_t>());
    EXPECT_EQ(accessor,
              (Json{{"bufferView", 2}, {"componentType", 5123}, {"normalized", true}, {"count", 4}, {"type", "VEC3"}}));
    const Json& view = glb.json.at("bufferViews").at(2);
    const std::size_t offset = view.at("byteOffset"), stride = view.at("byteStride");
    EXPECT_EQ(offset % 4 + stride % 4, 0u);
    EXPECT_EQ(offset + view.at("byteLength").get<std::size_t>(), glb.buffer.size());
    EXPECT_EQ(glb.json.at("buffers").at(0).at("byteLength"), glb.buffer.size());
    for (std::size_t i = 0; i < kColors.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        const double linear = At<std::uint16_t>(glb.buffer, offset + i * stride + 2 * k) / 65535.0;
        const double srgb = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
        EXPECT_NEAR(255 * srgb, kColors[i][k], 0.03);
      }
    }
  }
}

TEST(MeshFile, GlbColorsHaveTheSameBytesOnEveryMachine) {
  std::vector<Rgb> greys;
  for (int i = 0; i < 256; ++i) greys.push_back({static_cast<std::uint8_t>(i), 0, 0});
  const Glb glb = ParseGlb(Written(MeshFileFormat::kGlb, std::vector<MeshVertex>(256), {{0, 1, 2}}, greys));
  const std::size_t offset = glb.json.at("bufferViews").at(2).at("byteOffset");
  std::uint32_t sum = 0;
  for (std::uint32_t i = 0; i < 256; ++i) sum = sum * 31 + At<std::uint16_t>(glb.buffer, offset + 8 * i);
  EXPECT_EQ(sum, 2981720753u);
  EXPECT_EQ(At<std::uint16_t>(glb.buffer, offset + 8 * 128), 14146);
}

TEST(MeshFile, RefusesWhatNoFileCanHold) {
  for (MeshFileFormat format : {MeshFileFormat::kObj, MeshFileFormat::kPly, MeshFileFormat::kGlb}) {
    std::ostringstream out;
    EXPECT_EQ(WriteMesh(out, format, kSquare, {}).error().code, ErrorCode::kInvalidArgument);
    std::vector<MeshVertex> vertices = kSquare;
    vertices[2].z = std::nan("");
    const Result<void> result = WriteMesh(out, format, vertices, kTwo);
    EXPECT_NE(result.error().message.find("vertex 2"), std::string::npos);
    const GridPlacement nowhere = {std::nan(""), 1, 0, 0, 0, -1};
    EXPECT_EQ(WriteMesh(out, format, kSquare, kTwo, {}, nowhere).error().code, ErrorCode::kInvalidArgument);
    EXPECT_TRUE(out.str().empty());
  }
}

TEST(MeshFile, ReportsAFailingStream) {
  for (MeshFileFormat format : {MeshFileFormat::kObj, MeshFileFormat::kPly, MeshFileFormat::kGlb}) {
    std::ostream broken(nullptr);
    EXPECT_EQ(WriteMesh(broken, format, kSquare, kTwo).error().code, ErrorCode::kUnavailable);
  }
}

// Requests a stop when the first bytes are written, and counts later bytes.
class StopAtFirstWrite : public std::streambuf {
 public:
  std::stop_source source;
  std::streamsize first = 0, after = 0;

 protected:
  std::streamsize xsputn(const char*, std::streamsize count) override {
    (first == 0 ? first : after) += count;
    source.request_stop();
    return count;
  }
  int overflow(int c) override { return xsputn(nullptr, 1) == 1 ? c : 0; }
};

TEST(WriteMesh, EndsSoonAfterAStop) {
  const std::vector<MeshVertex> vertices(100'000, MeshVertex{1.5, 2.25, 3.125});
  const Triangles triangles(200'000, {0, 1, 2});
  for (const MeshFileFormat format : {MeshFileFormat::kObj, MeshFileFormat::kPly, MeshFileFormat::kGlb}) {
    StopAtFirstWrite buffer;
    std::ostream out(&buffer);
    if (format == MeshFileFormat::kGlb) buffer.source.request_stop();  // a GLB is made completely before it is written
    const Result<void> written = WriteMesh(out, format, vertices, triangles, {}, {}, buffer.source.get_token());
    ASSERT_FALSE(written);
    EXPECT_EQ(written.error().code, ErrorCode::kCancelled);
    EXPECT_LE(buffer.after, std::streamsize{200'000}) << "of 2 MB and more";
  }
}

}  // namespace
}  // namespace terrace::proto
