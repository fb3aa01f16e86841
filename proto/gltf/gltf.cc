#include "proto/gltf/gltf.h"

#include <limits>
#include <nlohmann/json.hpp>

#include "engine/core/bytes.h"
#include "engine/core/check.h"

namespace terrace::proto {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kMeshopt = "EXT_meshopt_compression";

// Buffer 0 is the binary chunk. Compressed views belong to a second buffer that only says how large the arrays are once
// they are decoded: a fallback without data.
struct Fallback {
  std::size_t bytes = 0;
};

Json ViewJson(const GltfView& view, Fallback& fallback) {
  Json json;
  if (view.meshopt) {
    const std::size_t decoded = view.meshopt->count * view.stride;
    json["buffer"] = 1;
    json["byteOffset"] = fallback.bytes;
    json["byteLength"] = decoded;
    fallback.bytes += (decoded + 3) / 4 * 4;
  } else {
    json["buffer"] = 0;
    json["byteOffset"] = view.offset;
    json["byteLength"] = view.length;
  }
  // Only vertex attributes may state a stride.
  if (view.stride > 0 && view.target == GltfTarget::kVertices) json["byteStride"] = view.stride;
  if (view.target != GltfTarget::kNone) json["target"] = static_cast<int>(view.target);
  if (view.meshopt) {
    json["extensions"][kMeshopt] = {{"buffer", 0},
                                    {"byteOffset", view.offset},
                                    {"byteLength", view.length},
                                    {"byteStride", view.stride},
                                    {"count", view.meshopt->count},
                                    {"mode", view.meshopt->mode}};
  }
  return json;
}

Json AccessorJson(const GltfAccessor& accessor) {
  Json json;
  if (accessor.view) json["bufferView"] = *accessor.view;
  json["componentType"] = static_cast<int>(accessor.component);
  if (accessor.normalized) json["normalized"] = true;
  json["count"] = accessor.count;
  json["type"] = accessor.type;
  if (!accessor.min.empty()) json["min"] = accessor.min;
  if (!accessor.max.empty()) json["max"] = accessor.max;
  return json;
}

Json PrimitiveJson(const GltfMesh& mesh) {
  Json json;
  for (const auto& [name, accessor] : mesh.attributes) json["attributes"][std::string(name)] = accessor;
  json["indices"] = mesh.indices;
  json["mode"] = 4;
  if (mesh.material) json["material"] = 0;
  if (mesh.draco) {
    Json& extension = json["extensions"]["KHR_draco_mesh_compression"];
    extension["bufferView"] = mesh.draco->view;
    for (const auto& [name, id] : mesh.draco->attributes) extension["attributes"][std::string(name)] = id;
  }
  return json;
}

// glTF supports only JPEG and PNG without extensions.
void PutTexture(const GltfTexture& texture, Json& json) {
  constexpr int kLinear = 9729, kLinearMipmapLinear = 9987, kClampToEdge = 33071;
  Json source = {{"sampler", 0}};
  if (texture.media_type == "image/webp") {
    source["extensions"]["EXT_texture_webp"] = {{"source", 0}};
  } else {
    source["source"] = 0;
  }
  json["textures"] = Json::array({std::move(source)});
  json["images"] = Json::array({{{"bufferView", texture.view}, {"mimeType", texture.media_type}}});
  json["samplers"] = Json::array(
      {{{"magFilter", kLinear}, {"minFilter", kLinearMipmapLinear}, {"wrapS", kClampToEdge}, {"wrapT", kClampToEdge}}});
}

}  // namespace

std::string GltfJson(const GltfMesh& mesh) {
  Json json;
  json["asset"] = {{"version", "2.0"}, {"generator", mesh.generator}};
  if (!mesh.copyright.empty()) json["asset"]["copyright"] = mesh.copyright;
  if (!mesh.extensions.empty()) {
    json["extensionsUsed"] = mesh.extensions;
    json["extensionsRequired"] = mesh.extensions;
  }
  json["scene"] = 0;
  json["scenes"] = Json::array({{{"nodes", {0}}}});
  for (const auto& [name, value] : mesh.scene_extras) json["scenes"][0]["extras"]["terrain"][std::string(name)] = value;
  json["nodes"] = Json::array({{{"mesh", 0}, {"matrix", mesh.matrix}}});
  json["meshes"] = Json::array({{{"primitives", Json::array({PrimitiveJson(mesh)})}}});
  if (mesh.material) {
    Json& pbr = json["materials"][0]["pbrMetallicRoughness"];
    if (mesh.material->color != GltfMaterial{}.color) pbr["baseColorFactor"] = mesh.material->color;
    if (mesh.texture) pbr["baseColorTexture"] = {{"index", 0}};
    pbr["metallicFactor"] = 0;
    pbr["roughnessFactor"] = 1;
  }
  if (mesh.texture) PutTexture(*mesh.texture, json);
  json["accessors"] = Json::array();
  for (const GltfAccessor& accessor : mesh.accessors) json["accessors"].push_back(AccessorJson(accessor));
  Fallback fallback;
  json["bufferViews"] = Json::array();
  for (const GltfView& view : mesh.views) json["bufferViews"].push_back(ViewJson(view, fallback));
  json["buffers"] = Json::array({{{"byteLength", mesh.buffer_bytes}}});
  if (fallback.bytes > 0) {
    json["buffers"].push_back({{"byteLength", fallback.bytes}, {"extensions", {{kMeshopt, {{"fallback", true}}}}}});
  }
  // The copyright is the operator's text: invalid UTF-8 becomes U+FFFD.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string GlbHead(std::string json, std::size_t buffer_bytes) {
  constexpr std::uint32_t kGlbMagic = 0x46546C67, kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;
  constexpr std::size_t kHeadersBytes = 12 + 8 + 8;
  TERRACE_CHECK(buffer_bytes % 4 == 0);
  json.append((4 - json.size() % 4) % 4, ' ');
  const std::size_t total = kHeadersBytes + json.size() + buffer_bytes;
  if (total > std::numeric_limits<std::uint32_t>::max()) return {};
  ByteWriter head;
  head.Reserve(kHeadersBytes + json.size());
  head.Put(kGlbMagic);
  head.Put(std::uint32_t{2});
  head.Put(static_cast<std::uint32_t>(total));
  head.Put(static_cast<std::uint32_t>(json.size()));
  head.Put(kJsonChunk);
  head.PutBytes(json);
  head.Put(static_cast<std::uint32_t>(buffer_bytes));
  head.Put(kBinaryChunk);
  return head.Take();
}

}  // namespace terrace::proto
