#include <gtest/gtest.h>

#include "server/api/tile_formats.h"
#include "server/http/text.h"
#include "server/query/tile_query.h"

namespace terrace::server {
namespace {

TEST(Query, DecodesPairsInOrder) {
  const Result<QueryParameters> parameters = ParseQuery("a=1&&b&c=x%3Dy=z&d=+&e");
  ASSERT_TRUE(parameters);
  EXPECT_EQ(*parameters, (QueryParameters{{"a", "1"}, {"b", ""}, {"c", "x=y=z"}, {"d", "+"}, {"e", ""}}));
}

TEST(Query, RefusesEncodedNames) {
  for (const char* query : {"%65rror=5", "error=5&%74oken=x", "token%3Dx", "%2574oken=x", "a%=1", "%"}) {
    const Result<QueryParameters> refused = ParseQuery(query);
    ASSERT_FALSE(refused) << query;
    EXPECT_NE(refused.error().message.find("name has a percent sign"), std::string::npos) << query;
  }
}

TEST(Query, TakesGoodTileParameters) {
  for (const char* query : {"", "v=1", "v=1.0.0&v=2", "extensions=a-b&extensions=c", "error=5", "error=5&atleast=1",
                            "error=5&atleast=0", "atleast=0", "error=0.001", "error=1e3", "error=1e-300", "error=%35",
                            "fraction=0.5", "fraction=1e300", "&error=5&", "error=5&v=1&extensions=octvertexnormals"}) {
    EXPECT_TRUE(ParseTileParameters(query, true)) << query;
  }
  const Result<TileParameters> parameters = ParseTileParameters("error=2.5&atleast=1&extensions=a-b", true);
  EXPECT_EQ(parameters->requested.error_m, 2.5);
  EXPECT_TRUE(parameters->requested.at_least);
  EXPECT_EQ(parameters->extensions, std::vector<std::string>{"a-b"});
}

TEST(Query, RefusesBadTileParameters) {
  for (const char* query : {"error=",
                            "error",
                            "error=abc",
                            "error=0",
                            "error=-1",
                            "error=-0",
                            "error=nan",
                            "error=NaN",
                            "error=inf",
                            "error=-inf",
                            "error=infinity",
                            "error=1e999",
                            "error=1e-999",
                            "error=0x10",
                            "error=5m",
                            "error=%205",
                            "error=5%20",
                            "error=+5",
                            "error=1,5",
                            "error=5&error=5",
                            "fraction=0",
                            "fraction=",
                            "fraction=1&fraction=1",
                            "error=5&fraction=1",
                            "atleast=1",
                            "atleast=1&fraction=1",
                            "error=5&atleast=2",
                            "error=5&atleast=",
                            "error=5&atleast=1&atleast=1",
                            "Error=5",
                            "x=1",
                            "=",
                            "=5",
                            "error=%",
                            "error=%4",
                            "v=%zz",
                            "error=5%00",
                            "error=99999999999999999999999999999999999999999999999999999999999999999999x"}) {
    const Result<TileParameters> parameters = ParseTileParameters(query, true);
    ASSERT_FALSE(parameters) << query;
    EXPECT_EQ(parameters.error().code, ErrorCode::kInvalidArgument) << query;
  }
}

TEST(Query, TakesACompressionWhereItIsOffered) {
  const std::pair<const char*, proto::GlbCompression> cases[] = {
      {"compression=draco", proto::GlbCompression::kDraco},
      {"error=5&compression=none", proto::GlbCompression::kNone},
      {"compression=quantized&v=1", proto::GlbCompression::kQuantized},
      {"compression=meshopt", proto::GlbCompression::kMeshopt}};
  for (const auto& [query, compression] : cases) {
    EXPECT_EQ(ParseTileParameters(query, true, true)->compression, compression) << query;
    EXPECT_FALSE(ParseTileParameters(query, true)) << query;
  }
  EXPECT_EQ(ParseTileParameters("", true, true)->compression, std::nullopt);
  for (const char* query :
       {"compression=", "compression=Draco", "compression=gzip", "compression=none&compression=draco"}) {
    EXPECT_FALSE(ParseTileParameters(query, true, true)) << query;
  }
}

TEST(Query, RefusesAtLeastWhereItIsNotOffered) { EXPECT_FALSE(ParseTileParameters("error=5&atleast=1", false)); }

// deck.gl appends the query of tileset.json to the URLs in it, which already have it.
TEST(Query, TakesAnEqualValueAgainOn3dTilesUrls) {
  const auto accepts = [](const char* query) {
    return ParseTileParameters(query, /*allow_at_least=*/true, /*allow_compression=*/true).has_value();
  };
  EXPECT_TRUE(accepts("error=5&atleast=1&error=5.00"));
  EXPECT_TRUE(accepts("fraction=0.25&compression=none&fraction=0.25&compression=none"));
  EXPECT_FALSE(accepts("error=5&error=6"));
  EXPECT_FALSE(accepts("compression=none&compression=draco"));
  EXPECT_FALSE(accepts("error=5&error=x"));
}

TEST(Query, ReadsTheTextureOf3dTilesUrls) {
  EXPECT_EQ(ParseTileParameters("", true, true)->texture, std::nullopt);
  EXPECT_EQ(ParseTileParameters("texture=jpeg", true, true)->texture, proto::TextureFormat::kJpeg);
  EXPECT_EQ(ParseTileParameters("texture=webp&texture=webp", true, true)->texture, proto::TextureFormat::kWebp);
  EXPECT_EQ(ParseTileParameters("texture=none", true, true)->texture, proto::TextureFormat::kNone);
  for (const char* query : {"texture=", "texture=JPEG", "texture=png", "texture=jpeg&texture=none"}) {
    EXPECT_FALSE(ParseTileParameters(query, true, true)) << query;
  }
  EXPECT_FALSE(ParseTileParameters("texture=jpeg", true));
}

TEST(Query, ReadsWhatHeightTilesTake) {
  const Result<HeightTileParameters> plain = ParseHeightTileParameters("v=1&v=2");
  ASSERT_TRUE(plain);
  EXPECT_EQ(plain->encoding, proto::HeightEncoding::kMapbox);
  EXPECT_EQ(plain->size, 256);
  const Result<HeightTileParameters> all = ParseHeightTileParameters("encoding=terrarium&size=512");
  ASSERT_TRUE(all);
  EXPECT_EQ(all->encoding, proto::HeightEncoding::kTerrarium);
  EXPECT_EQ(all->size, 512);
  for (const char* bad :
       {"encoding=rgb", "encoding=", "encoding=Mapbox", "size=0", "size=1024", "size=256.0", "size=+256",
        "size=256&size=256", "encoding=mapbox&encoding=mapbox", "error=5", "encoding=%0a"}) {
    EXPECT_FALSE(ParseHeightTileParameters(bad)) << bad;
  }
}

TEST(Query, RefusesParametersWhereThereAreNone) {
  EXPECT_TRUE(RefuseParameters(""));
  EXPECT_TRUE(RefuseParameters("v=1"));
  EXPECT_FALSE(RefuseParameters("error=1"));
}

}  // namespace
}  // namespace terrace::server
