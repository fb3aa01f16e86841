#include "fly/content/glb.h"

#include <draco/compression/decode.h>

#include <cstddef>
#include <cstdint>
#include <exception>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "engine/core/bytes.h"

namespace terrace::fly {
namespace {

using Json = nlohmann::json;

constexpr std::uint32_t kMagic = 0x46546C67;      // "glTF"
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;  // "JSON"
constexpr std::uint32_t kBinaryChunk = 0x004E4942;
// Component types of accessors.
constexpr int kUint16 = 5123, kUint32 = 5125, kFloat32 = 5126;

template <typename... Args>
tl::unexpected<Error> Damaged(fmt::format_string<Args...> format, Args&&... args) {
  return MakeError(ErrorCode::kInvalidArgument, "GLB: {}", fmt::format(format, std::forward<Args>(args)...));
}

struct Chunks {
  std::string_view json, binary;
};

std::optional<Chunks> SplitChunks(std::string_view bytes) {
  ByteReader reader(bytes);
  if (reader.Get<std::uint32_t>() != kMagic || reader.Get<std::uint32_t>() != 2) return std::nullopt;
  if (reader.Get<std::uint32_t>() != bytes.size()) return std::nullopt;
  Chunks chunks;
  while (reader.ok() && reader.remaining() > 0) {
    const auto length = reader.Get<std::uint32_t>();
    const auto kind = reader.Get<std::uint32_t>();
    const std::string_view body = reader.GetBytes(length);
    if (kind == kJsonChunk) chunks.json = body;
    if (kind == kBinaryChunk) chunks.binary = body;
  }
  if (!reader.ok() || chunks.json.empty()) return std::nullopt;
  return chunks;
}

// The bytes of a view in the binary chunk; nothing if it leaves the chunk.
std::optional<std::string_view> BytesOf(const Json& document, std::size_t view, std::string_view binary) {
  const Json& entry = document.at("bufferViews").at(view);
  const auto offset = entry.value("byteOffset", std::size_t{0}), length = entry.at("byteLength").get<std::size_t>();
  if (offset > binary.size() || binary.size() - offset < length) return std::nullopt;
  return binary.substr(offset, length);
}

Result<TileContent> DecodeDraco(std::string_view bytes, const Json& accessor_of_positions) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  draco::Decoder decoder;
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) return Damaged("Draco: {}", decoded.status().error_msg_string());
  const draco::Mesh& mesh = *decoded.value();
  if (mesh.num_points() != accessor_of_positions.at("count").get<std::uint32_t>()) {
    return Damaged("Draco decodes to {} vertices, the accessor has {}", mesh.num_points(),
                   accessor_of_positions.at("count").get<std::uint32_t>());
  }
  TileContent content;
  content.vertices = mesh.num_points();
  content.triangles = mesh.num_faces();
  for (std::uint32_t i = 0; i < mesh.num_faces(); ++i) {
    for (const draco::PointIndex& index : mesh.face(draco::FaceIndex(i))) {
      if (index.value() >= mesh.num_points()) return Damaged("Draco: an index names no vertex");
    }
  }
  return content;
}

std::size_t IndexBytes(int component_type) { return component_type == kUint32 ? 4 : component_type == kUint16 ? 2 : 1; }

std::uint32_t IndexAt(std::string_view bytes, int component_type, std::size_t i) {
  ByteReader reader(bytes.substr(i * IndexBytes(component_type)));
  if (component_type == kUint32) return reader.Get<std::uint32_t>();
  return component_type == kUint16 ? reader.Get<std::uint16_t>() : reader.Get<std::uint8_t>();
}

Result<TileContent> DecodePlain(const Json& document, const Json& primitive, std::string_view binary) {
  const Json& accessors = document.at("accessors");
  const Json& positions = accessors.at(primitive.at("attributes").at("POSITION").get<std::size_t>());
  TileContent content;
  content.vertices = positions.at("count").get<std::uint32_t>();
  content.triangles = content.vertices / 3;
  // The only extension of buffer views is EXT_meshopt_compression.
  const auto is_meshopt = [&](const Json& accessor) {
    const Json& view = document.at("bufferViews").at(accessor.at("bufferView").get<std::size_t>());
    return view.contains("extensions");
  };
  if (!is_meshopt(positions)) {
    const auto bytes = BytesOf(document, positions.at("bufferView").get<std::size_t>(), binary);
    const std::size_t vertex_bytes = positions.at("componentType").get<int>() == kFloat32 ? 12 : 6;
    if (!bytes || bytes->size() / vertex_bytes < content.vertices) return Damaged("cut off in its positions");
  }
  if (!primitive.contains("indices")) return content;
  const Json& indices = accessors.at(primitive.at("indices").get<std::size_t>());
  const auto count = indices.at("count").get<std::size_t>();
  content.triangles = static_cast<std::uint32_t>(count / 3);
  if (is_meshopt(indices)) return content;
  const auto bytes = BytesOf(document, indices.at("bufferView").get<std::size_t>(), binary);
  const int type = indices.at("componentType").get<int>();
  const auto offset = indices.value("byteOffset", std::size_t{0});
  if (!bytes || offset > bytes->size() || (bytes->size() - offset) / IndexBytes(type) < count) {
    return Damaged("cut off in its indices");
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (IndexAt(bytes->substr(offset), type, i) >= content.vertices) return Damaged("an index names no vertex");
  }
  return content;
}

Result<TileContent> DecodePrimitive(const Json& document, const Json& primitive, std::string_view binary) {
  if (!primitive.contains("extensions") || !primitive.at("extensions").contains("KHR_draco_mesh_compression")) {
    return DecodePlain(document, primitive, binary);
  }
  const Json& draco = primitive.at("extensions").at("KHR_draco_mesh_compression");
  const auto bytes = BytesOf(document, draco.at("bufferView").get<std::size_t>(), binary);
  if (!bytes) return Damaged("its Draco data are cut off");
  const auto position = primitive.at("attributes").at("POSITION").get<std::size_t>();
  return DecodeDraco(*bytes, document.at("accessors").at(position));
}

}  // namespace

Result<TileContent> DecodeGlb(std::string_view bytes) {
  const std::optional<Chunks> chunks = SplitChunks(bytes);
  if (!chunks) {
    for (const std::string_view form : {"b3dm", "i3dm", "pnts", "cmpt", "{"}) {
      if (!bytes.starts_with(form)) continue;
      return MakeError(ErrorCode::kNotFound, "{} is not supported; fly reads GLB", form == "{" ? "JSON" : form);
    }
    return Damaged("no binary glTF 2.0, or cut off");
  }
  try {
    const Json document = Json::parse(chunks->json);
    TileContent sum;
    for (const Json& mesh : document.at("meshes")) {
      for (const Json& primitive : mesh.at("primitives")) {
        Result<TileContent> part = DecodePrimitive(document, primitive, chunks->binary);
        if (!part) return part;
        sum.vertices += part->vertices;
        sum.triangles += part->triangles;
      }
    }
    sum.bytes = std::uint64_t{sum.vertices} * 24 + std::uint64_t{sum.triangles} * 12;
    return sum;
  } catch (const std::exception& error) {
    return Damaged("its JSON is not as glTF 2.0 has it: {}", error.what());
  }
}

}  // namespace terrace::fly
