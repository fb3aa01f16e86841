// The decoders of the client read what the encoders write, and refuse everything else.
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "fly/content/glb.h"
#include "fly/content/gunzip.h"
#include "fly/content/quantized_mesh.h"
#include "tests/proto/grid_tile.h"

namespace terrace::fly {
namespace {

std::string EncodedGrid(int columns, int rows) {
  proto::QuantizedTile tile = proto::GridTile({9, 530, 388}, columns, rows, -12.5F, 873.25F, proto::Rugged());
  proto::TileExtensions options;
  options.normals = true;
  return proto::EncodeQuantizedMesh(tile, options);
}

TEST(QuantizedMeshOfClient, ReadsWhatTheEncoderWrites) {
  const Result<TileContent> content = DecodeQuantizedMesh(EncodedGrid(20, 13));
  ASSERT_TRUE(content) << content.error().message;
  EXPECT_EQ(content->vertices, 21U * 14);
  EXPECT_EQ(content->triangles, 2U * 20 * 13);
  ASSERT_TRUE(content->heights);
  EXPECT_FLOAT_EQ(static_cast<float>(content->heights->min_m), -12.5F);
  EXPECT_FLOAT_EQ(static_cast<float>(content->heights->max_m), 873.25F);
  EXPECT_DOUBLE_EQ(content->covered, 1);
}

TEST(QuantizedMeshOfClient, MeasuresWhatTrianglesLeaveOpen) {
  proto::QuantizedTile tile = proto::GridTile({9, 530, 388}, 8, 8, 0, 1, proto::Rugged());
  tile.triangles.erase(tile.triangles.begin() + 60);
  const Result<TileContent> content = DecodeQuantizedMesh(proto::EncodeQuantizedMesh(tile, {}));
  ASSERT_TRUE(content);
  EXPECT_NEAR(content->covered, 1 - 1.0 / 128, 1e-3);
}

TEST(QuantizedMeshOfClient, RefusesEveryTruncation) {
  const std::string whole = EncodedGrid(6, 5);
  proto::QuantizedTile tile = proto::GridTile({9, 530, 388}, 6, 5, -12.5F, 873.25F, proto::Rugged());
  const std::size_t without_extension = proto::EncodeQuantizedMesh(tile, {}).size();
  for (std::size_t bytes = 0; bytes < whole.size(); ++bytes) {
    if (bytes == without_extension) continue;  // complete without its extension
    EXPECT_FALSE(DecodeQuantizedMesh(std::string_view(whole).substr(0, bytes))) << bytes;
  }
}

TEST(QuantizedMeshOfClient, SurvivesDamage) {
  const std::string whole = EncodedGrid(9, 9);
  std::mt19937 random(3);
  int refused = 0;
  for (int i = 0; i < 3000; ++i) {
    std::string damaged = whole;
    for (int flips = 0; flips <= i % 4; ++flips) {
      damaged[random() % damaged.size()] ^= static_cast<char>(1 << random() % 8);
    }
    refused += DecodeQuantizedMesh(damaged) ? 0 : 1;
  }
  EXPECT_GT(refused, 300);
}

TEST(GunzipOfClient, ReadsWholeStreamsOnly) {
  EXPECT_FALSE(Gunzip("\x1f\x8b garbage"));
  // Of RFC 1952: an empty stream, written by gzip.
  const std::string empty("\x1f\x8b\x08\0\0\0\0\0\0\x03\x03\0\0\0\0\0\0\0\0\0", 20);
  ASSERT_TRUE(Gunzip(empty));
  EXPECT_EQ(*Gunzip(empty), "");
  EXPECT_FALSE(Gunzip(std::string_view(empty).substr(0, 15)));
  EXPECT_FALSE(Gunzip(empty + "x"));
  EXPECT_FALSE(Gunzip(empty + empty));
  EXPECT_TRUE(IsGzip(empty));
  EXPECT_FALSE(IsGzip("glTF"));
}

TEST(GlbOfClient, RefusesWhatIsNone) {
  for (const std::string& bytes : {std::string(), std::string("glTF"), std::string("<html>not found</html>"),
                                   std::string("glTF\x02\0\0\0\x0c\0\0\0", 12)}) {
    EXPECT_FALSE(DecodeGlb(bytes));
  }
  EXPECT_EQ(DecodeGlb("b3dm\x01").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(DecodeGlb(R"({"asset":{}})").error().message, "JSON is not supported; fly reads GLB");
  const std::string json = R"({"meshes":[{"primitives":[{"attributes":{"POSITION":7}}]}],"accessors":[]} )";
  std::string glb("glTF\x02\0\0\0", 8);
  const auto put = [&glb](std::uint32_t value) { glb.append(reinterpret_cast<const char*>(&value), 4); };
  put(static_cast<std::uint32_t>(20 + json.size()));
  put(static_cast<std::uint32_t>(json.size()));
  glb += "JSON" + json;
  const Result<TileContent> content = DecodeGlb(glb);
  ASSERT_FALSE(content);
  EXPECT_NE(content.error().message.find("its JSON is not as glTF 2.0 has it"), std::string::npos);
}

}  // namespace
}  // namespace terrace::fly
