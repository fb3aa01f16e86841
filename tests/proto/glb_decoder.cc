#include "tests/proto/glb_decoder.h"

#include <draco/compression/decode.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <cstring>
#include <map>

namespace terrace::proto {
namespace {

using Json = nlohmann::json;

template <typename T>
T At(std::string_view bytes, std::size_t offset) {
  T value{};
  std::memcpy(&value, bytes.data() + offset, sizeof(T));
  return value;
}

// A view's decoded bytes and the distance between its records, 0 where tightly packed.
struct View {
  std::string bytes;
  std::size_t stride = 0;
};

std::optional<View> ReadView(const Json& view, const Json& buffers, std::string_view buffer) {
  const std::size_t stride = view.value("byteStride", std::size_t{0});
  const Json* source = &view;
  const bool compressed = view.contains("extensions");
  if (compressed) source = &view.at("extensions").at("EXT_meshopt_compression");
  const std::size_t offset = source->value("byteOffset", std::size_t{0}), length = source->at("byteLength");
  if (source->at("buffer") != 0 || offset > buffer.size() || length > buffer.size() - offset) return std::nullopt;
  const std::string_view bytes = buffer.substr(offset, length);
  if (!compressed) return View{std::string(bytes), stride};

  const std::size_t count = source->at("count"), size = source->at("byteStride");
  const Json& fallback = buffers.at(view.at("buffer").get<std::size_t>());
  if (view.at("byteLength") != count * size ||
      view.at("byteOffset").get<std::size_t>() + count * size > fallback.at("byteLength").get<std::size_t>()) {
    return std::nullopt;
  }
  View decoded{std::string(count * size, '\0'), stride};
  const auto* const in = reinterpret_cast<const unsigned char*>(bytes.data());
  const int failed = source->at("mode") == "TRIANGLES"
                         ? meshopt_decodeIndexBuffer(decoded.bytes.data(), count, size, in, bytes.size())
                         : meshopt_decodeVertexBuffer(decoded.bytes.data(), count, size, in, bytes.size());
  if (failed != 0) return std::nullopt;
  return decoded;
}

// The accessor's numbers, row by row.
std::optional<std::vector<double>> ReadAccessor(const Json& json, std::size_t index, std::string_view buffer) {
  const Json& accessor = json.at("accessors").at(index);
  const std::optional<View> view =
      ReadView(json.at("bufferViews").at(accessor.at("bufferView").get<std::size_t>()), json.at("buffers"), buffer);
  if (!view) return std::nullopt;
  const std::size_t count = accessor.at("count"), columns = accessor.at("type") == "VEC3"   ? 3
                                                            : accessor.at("type") == "VEC2" ? 2
                                                                                            : 1;
  const int component = accessor.at("componentType");
  const std::size_t size = component == 5120 ? 1 : component == 5123 ? 2 : 4;
  const std::size_t stride = view->stride > 0 ? view->stride : size * columns;
  if (view->bytes.size() != count * stride) return std::nullopt;
  std::vector<double> numbers;
  for (std::size_t row = 0; row < count; ++row) {
    for (std::size_t column = 0; column < columns; ++column) {
      const std::size_t at = row * stride + column * size;
      const std::string_view bytes = view->bytes;
      double number = 0;
      if (component == 5120) number = At<std::int8_t>(bytes, at);
      if (component == 5123) number = At<std::uint16_t>(bytes, at);
      if (component == 5125) number = At<std::uint32_t>(bytes, at);
      if (component == 5126) number = static_cast<double>(At<float>(bytes, at));
      if (accessor.value("normalized", false)) number = std::max(number / (component == 5120 ? 127 : 65535), -1.0);
      numbers.push_back(number);
    }
  }
  return numbers;
}

std::vector<double> DracoNumbers(const draco::Mesh& mesh, std::uint32_t unique_id, std::size_t columns = 3) {
  std::vector<double> numbers;
  const draco::PointAttribute* const attribute = mesh.GetAttributeByUniqueId(unique_id);
  if (!attribute) return numbers;
  for (draco::PointIndex point(0); point < mesh.num_points(); ++point) {
    std::array<float, 3> value{};
    attribute->GetMappedValue(point, value.data());
    for (std::size_t i = 0; i < columns; ++i) numbers.push_back(static_cast<double>(value[i]));
  }
  return numbers;
}

struct Numbers {
  std::vector<double> positions, normals, indices, uv;
};

std::optional<Numbers> ReadDraco(const Json& json, const Json& extension, std::string_view buffer) {
  const std::optional<View> view =
      ReadView(json.at("bufferViews").at(extension.at("bufferView").get<std::size_t>()), json.at("buffers"), buffer);
  if (!view) return std::nullopt;
  draco::DecoderBuffer in;
  in.Init(view->bytes.data(), view->bytes.size());
  draco::Decoder decoder;
  const auto decoded = decoder.DecodeMeshFromBuffer(&in);
  if (!decoded.ok()) return std::nullopt;
  const draco::Mesh& mesh = *decoded.value();
  Numbers numbers;
  numbers.positions = DracoNumbers(mesh, extension.at("attributes").at("POSITION"));
  numbers.normals = DracoNumbers(mesh, extension.at("attributes").at("NORMAL"));
  if (extension.at("attributes").contains("TEXCOORD_0")) {
    numbers.uv = DracoNumbers(mesh, extension.at("attributes").at("TEXCOORD_0"), 2);
  }
  for (draco::FaceIndex face(0); face < mesh.num_faces(); ++face) {
    for (int corner = 0; corner < 3; ++corner) numbers.indices.push_back(mesh.face(face)[corner].value());
  }
  return numbers;
}

std::optional<Numbers> ReadNumbers(const Json& json, const Json& primitive, std::string_view buffer) {
  if (primitive.contains("extensions")) {
    return ReadDraco(json, primitive.at("extensions").at("KHR_draco_mesh_compression"), buffer);
  }
  const auto positions = ReadAccessor(json, primitive.at("attributes").at("POSITION"), buffer);
  const auto normals = ReadAccessor(json, primitive.at("attributes").at("NORMAL"), buffer);
  const auto indices = ReadAccessor(json, primitive.at("indices"), buffer);
  if (!positions || !normals || !indices) return std::nullopt;
  Numbers numbers{*positions, *normals, *indices, {}};
  if (primitive.at("attributes").contains("TEXCOORD_0")) {
    const auto uv = ReadAccessor(json, primitive.at("attributes").at("TEXCOORD_0"), buffer);
    if (!uv) return std::nullopt;
    numbers.uv = *uv;
  }
  return numbers;
}

std::optional<DecodedGlb> Decode(std::string_view bytes) {
  if (bytes.size() < 28 || bytes.substr(0, 4) != "glTF" || At<std::uint32_t>(bytes, 8) != bytes.size())
    return std::nullopt;
  const std::size_t json_size = At<std::uint32_t>(bytes, 12);
  if (json_size % 4 != 0 || bytes.substr(16, 4) != "JSON" || json_size + 28 > bytes.size()) return std::nullopt;
  const std::string_view buffer = bytes.substr(28 + json_size);
  if (bytes.substr(24 + json_size, 4) != std::string_view("BIN\0", 4) ||
      At<std::uint32_t>(bytes, 20 + json_size) != buffer.size()) {
    return std::nullopt;
  }
  DecodedGlb glb;
  glb.json = Json::parse(bytes.substr(20, json_size));
  if (glb.json.at("buffers").at(0).at("byteLength") != buffer.size()) return std::nullopt;
  const Json& primitive = glb.json.at("meshes").at(0).at("primitives").at(0);
  const std::optional<Numbers> numbers = ReadNumbers(glb.json, primitive, buffer);
  if (!numbers) return std::nullopt;
  const auto count = [&](const Json& accessor) {
    return glb.json.at("accessors").at(accessor.get<std::size_t>()).at("count").get<std::size_t>();
  };
  const std::size_t vertices = count(primitive.at("attributes").at("POSITION"));
  if (numbers->positions.size() != 3 * vertices || numbers->normals.size() != 3 * vertices ||
      count(primitive.at("attributes").at("NORMAL")) != vertices ||
      numbers->indices.size() != count(primitive.at("indices")) || numbers->indices.size() % 3 != 0) {
    return std::nullopt;
  }
  if (primitive.at("attributes").contains("TEXCOORD_0") != !numbers->uv.empty() ||
      (!numbers->uv.empty() &&
       (numbers->uv.size() != 2 * vertices || count(primitive.at("attributes").at("TEXCOORD_0")) != vertices))) {
    return std::nullopt;
  }
  for (std::size_t k = 0; k < numbers->uv.size(); k += 2) glb.uv.push_back({numbers->uv[k], numbers->uv[k + 1]});
  if (glb.json.contains("images")) {
    const std::size_t index = glb.json.at("images").at(0).at("bufferView");
    const std::optional<View> view = ReadView(glb.json.at("bufferViews").at(index), glb.json.at("buffers"), buffer);
    if (!view) return std::nullopt;
    glb.image = view->bytes;
  }
  const auto m = glb.json.at("nodes").at(0).at("matrix").get<std::array<double, 16>>();
  for (std::size_t k = 0; k < vertices; ++k) {
    const double x = numbers->positions[3 * k], y = numbers->positions[3 * k + 1], z = numbers->positions[3 * k + 2];
    glb.stored.push_back({x, y, z});
    const auto row = [&](std::size_t i) { return m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i]; };
    glb.positions.push_back({row(0), -row(2), row(1)});
    glb.normals.push_back({numbers->normals[3 * k], numbers->normals[3 * k + 1], numbers->normals[3 * k + 2]});
  }
  for (std::size_t k = 0; k < numbers->indices.size(); k += 3) {
    auto& triangle = glb.triangles.emplace_back();
    for (std::size_t i = 0; i < 3; ++i) {
      if (numbers->indices[k + i] >= static_cast<double>(vertices)) return std::nullopt;
      triangle[i] = static_cast<std::uint32_t>(numbers->indices[k + i]);
    }
  }
  return glb;
}

Corner CornerOf(geo::Vec3 p) { return {p.x, p.y, p.z}; }

}  // namespace

std::optional<DecodedGlb> DecodeGlb(std::string_view bytes) {
  try {
    return Decode(bytes);
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}

std::vector<std::array<Corner, 3>> Surface(const DecodedGlb& glb) {
  std::vector<std::array<Corner, 3>> surface;
  for (const auto& [a, b, c] : glb.triangles) {
    std::array<Corner, 3> corners{CornerOf(glb.positions[a]), CornerOf(glb.positions[b]), CornerOf(glb.positions[c])};
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    surface.push_back(corners);
  }
  std::sort(surface.begin(), surface.end());
  return surface;
}

OpenSides OpenSidesOf(const DecodedGlb& glb) {
  std::map<std::array<Corner, 2>, int> count;
  for (const auto& corners : Surface(glb)) {
    for (std::size_t k = 0; k < 3; ++k) ++count[{corners[k], corners[(k + 1) % 3]}];
  }
  OpenSides open;
  for (const auto& [side, times] : count) {
    if (times > 1) ++open.doubled;
    if (!count.contains({side[1], side[0]})) open.sides.push_back(side);
  }
  return open;
}

}  // namespace terrace::proto
