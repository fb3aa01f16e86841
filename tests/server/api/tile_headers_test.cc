#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>

#include "server/api/tile_formats.h"

namespace terrace::server {
namespace {

tiler::EncodedTile HeadTile() {
  tiler::EncodedTile tile;
  tile.bytes = "12345";
  tile.etag = "\"e\"";
  tile.max_error_m = 3.87;
  return tile;
}

TEST(TileHead, SaysWhatTheTileIs) {
  tiler::TileRequest request;
  request.format = tiler::TileFormat::kGlb;
  request.coding = tiler::Coding::kGzip;
  tiler::EncodedTile tile = HeadTile();
  tile.certified_error_m = 9.5;
  EXPECT_EQ(MakeTileHeaders(request, tile).text,
            "Content-Type: model/gltf-binary\r\nContent-Encoding: gzip\r\nContent-Length: 5\r\n"
            "ETag: \"e\"\r\nTerrain-Max-Error: 3.87\r\nTerrain-Certified-Error: 9.5\r\n");
}

TEST(TileHead, NamesTheFormatWithItsExtensions) {
  tiler::TileRequest request;
  request.extensions.normals = true;
  EXPECT_TRUE(MakeTileHeaders(request, HeadTile())
                  .text.starts_with("Content-Type: application/vnd.quantized-mesh;extensions=octvertexnormals\r\n"))
      << MakeTileHeaders(request, HeadTile()).text;
  request.format = tiler::TileFormat::kHeightPng;
  EXPECT_TRUE(
      MakeTileHeaders(request, HeadTile()).text.starts_with("Content-Type: image/png\r\nContent-Length: 5\r\n"));
}

TEST(TileHead, PutsWhatDescribesTheBodyFirst) {
  const tiler::HeaderLines head = MakeTileHeaders({}, HeadTile());
  EXPECT_EQ(head.text.substr(head.bytes_about_body), "ETag: \"e\"\r\nTerrain-Max-Error: 3.87\r\n");
}

// A tile has such an error if the error of a source is unknown.
TEST(TileHead, LeavesAnErrorWithoutBoundUnsaid) {
  tiler::EncodedTile tile = HeadTile();
  tile.certified_error_m = std::numeric_limits<double>::infinity();
  EXPECT_EQ(MakeTileHeaders({}, tile).text.find("Certified"), std::string::npos);
}

TEST(TileHead, CountsAmongATilesBytes) {
  tiler::EncodedTile tile = HeadTile();
  EXPECT_EQ(tiler::BytesOf(tile), 5u);
  tile.header_lines = MakeTileHeaders({}, tile);
  EXPECT_EQ(tiler::BytesOf(tile), 5u + tile.header_lines.text.size());
}

}  // namespace
}  // namespace terrace::server
