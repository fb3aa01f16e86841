#include "proto/media_type.h"

#include <gtest/gtest.h>

#include <ostream>
#include <vector>

namespace terrace::proto {

void PrintTo(const TileExtensions& e, std::ostream* out) {
  *out << "{" << e.normals << e.water_mask << e.metadata << "}";
}

namespace {

constexpr TileExtensions kNone{}, kNormals{.normals = true}, kAll{true, true, true};
constexpr TileExtensions kNormalsAndMetadata{.normals = true, .metadata = true};

struct ExtensionsCase {
  std::string_view text;
  TileExtensions expected;
};

TEST(MediaType, ExtensionNamesAreJoinedByDashes) {
  const std::vector<ExtensionsCase> cases = {
      {"", kNone},
      {"octvertexnormals", kNormals},
      {"octvertexnormals-metadata", kNormalsAndMetadata},
      {"metadata-watermask-octvertexnormals", kAll},
      {"OctVertexNormals", kNormals},
      {"vertexnormals", kNone},  // the old extension with a big-endian length
      {"lightmap-octvertexnormals", kNormals},
      {"-octvertexnormals--", kNormals},
      {"octvertexnormalsx", kNone},
      {"octvertexnormals,metadata", kNone},
  };
  for (const ExtensionsCase& c : cases) EXPECT_EQ(ParseExtensions(c.text), c.expected) << c.text;
}

TEST(MediaType, AcceptMayNameExtensionsAnywhere) {
  const std::vector<ExtensionsCase> cases = {
      {"", kNone},
      {"*/*", kNone},
      // CesiumJS
      {"application/vnd.quantized-mesh,application/octet-stream;q=0.9,*/*;q=0.01", kNone},
      {"application/vnd.quantized-mesh;extensions=octvertexnormals-watermask-metadata,application/octet-stream;q=0.9,"
       "*/*;q=0.01",
       kAll},
      // 3DTilesRendererJS
      {"application/vnd.quantized-mesh,application/octet-stream;q=0.9;extensions=octvertexnormals-metadata",
       kNormalsAndMetadata},
      {"a/b ; q=1 ; Extensions = octvertexnormals , c/d", kNormals},
      {"a/b;extensions=\"octvertexnormals\"", kNormals},
      {"a/b;extensions=octvertexnormals,c/d;extensions=metadata", kNormalsAndMetadata},
      {"a/b;x=\"1;extensions=octvertexnormals\"", kNone},
      {"extensions=octvertexnormals", kNone},  // a media type, not a parameter
      {"a/b;extensions", kNone},
      {";;,,;=,\"", kNone},
  };
  for (const ExtensionsCase& c : cases) EXPECT_EQ(ExtensionsInAccept(c.text), c.expected) << c.text;
}

TEST(QuantizedMeshContentType, NamesWhatTheTileCarries) {
  for (int bits = 0; bits < 8; ++bits) {
    const TileExtensions extensions{(bits & 1) != 0, (bits & 2) != 0, (bits & 4) != 0};
    const std::string_view type = QuantizedMeshContentType(extensions);
    EXPECT_TRUE(type.starts_with("application/vnd.quantized-mesh"));
    EXPECT_EQ(type == "application/vnd.quantized-mesh", bits == 0);
    EXPECT_EQ(ExtensionsInAccept(type), extensions) << type;
  }
}

}  // namespace
}  // namespace terrace::proto
