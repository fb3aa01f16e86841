// Meshes of areas over HTTP: headers, refusals, load. Tests replace the functions that plan and build.
#include <gtest/gtest.h>

#include <thread>

#include "proto/compress.h"
#include "tests/server/server_fixture.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

constexpr const char* kArea = "/maui/mesh?bbox=-157,20,-156,21&error=5";

class AreaTest : public ServerFixture {
 protected:
  // Plans every area with an error of at least a metre, and builds a text with its error.
  void StartAreas(ServerOptions options = {}) {
    area_mesher_.plan = [this](std::uint32_t, const tiler::AreaRequest& area) -> Result<tiler::AreaPlan> {
      if (area.error_m < 1) return MakeError(ErrorCode::kInvalidArgument, "ask for 1 m or more");
      tiler::AreaPlan plan;
      plan.level = level_;
      plan.depends_on_limit = depends_on_limit_;
      plan.centre = {(area.west + area.east) / 2, (area.south + area.north) / 2};
      return plan;
    };
    area_mesher_.build = [this](std::uint32_t, const tiler::AreaPlan&, const tiler::AreaRequest& area,
                                std::stop_token stop) -> Result<tiler::EncodedTile> {
      ++builds_;
      while (held_ && !stop.stop_requested()) std::this_thread::sleep_for(1ms);
      if (fails_) return MakeError(ErrorCode::kUnavailable, "the disk is gone");
      if (is_in_hole_) return MakeError(ErrorCode::kInvalidArgument, "all of the area lies in a hole");
      tiler::EncodedTile mesh;
      mesh.bytes = std::string(3000, 'v');
      mesh.max_error_m = area.error_m - 0.5;
      return mesh;
    };
    Start(std::move(options));
  }

  std::atomic<bool> held_{false}, fails_{false}, is_in_hole_{false}, depends_on_limit_{false};
  std::atomic<int> level_{0};
};

TEST_F(AreaTest, TellsItsErrorAndOrigin) {
  StartAreas();
  const Reply reply = Fetch(port(), kArea);
  EXPECT_EQ(reply.status, 200);
  EXPECT_EQ(reply.body, std::string(3000, 'v'));
  EXPECT_EQ(reply.Field("content-type"), "model/gltf-binary");
  EXPECT_EQ(reply.Field("terrain-max-error"), "4.5");
  EXPECT_EQ(reply.Field("terrain-origin"), "20.5,-156.5,0");
  EXPECT_TRUE(reply.Field("server-timing").starts_with("cache;desc=miss, ")) << reply.Field("server-timing");
}

// That all of an area lies in a hole of the edits is known only when its mesh is made.
TEST_F(AreaTest, TellsTheClientWhatItsMeshShows) {
  StartAreas();
  is_in_hole_ = true;
  const Reply reply = Fetch(port(), kArea);
  EXPECT_EQ(reply.status, 400);
  EXPECT_NE(reply.body.find("all of the area lies in a hole"), std::string::npos) << reply.body;
}

TEST_F(AreaTest, AreKeptForGoodWithTheirVersion) {
  StartAreas();
  const auto kept = [&](const std::string& query) { return Fetch(port(), kArea + query).Field("cache-control"); };
  EXPECT_EQ(kept(std::string("&v=") + kMauiVersion), "public, max-age=31536000, immutable");
  EXPECT_EQ(kept("&v=0"), "no-store");
  EXPECT_EQ(kept(""), "public, max-age=3600");
  EXPECT_EQ(Fetch(port(), kArea).Field("vary"), "Accept-Encoding");
}

// max_mesh_samples may decide the level, and the version does not cover it.
TEST_F(AreaTest, OfALevelThatALimitDecidesAreNotKeptForGood) {
  StartAreas();
  depends_on_limit_ = true;
  const std::string url = std::string(kArea) + "&v=" + kMauiVersion;
  const Reply before = Fetch(port(), url);
  EXPECT_EQ(before.Field("cache-control"), "public, max-age=3600");
  const std::string has_it = "If-None-Match: " + before.Field("etag") + "\r\n";
  EXPECT_EQ(Fetch(port(), url, has_it).status, 304);
  level_ = 1;
  EXPECT_EQ(Fetch(port(), url, has_it).status, 200);
}

TEST_F(AreaTest, TypesAreThoseOfFormats) {
  StartAreas();
  EXPECT_EQ(Fetch(port(), std::string(kArea) + "&format=obj").Field("content-type"), "model/obj");
  const Reply ply = Fetch(port(), std::string(kArea) + "&format=ply&coordinates=ecef");
  EXPECT_EQ(ply.Field("content-type"), "application/octet-stream");
  EXPECT_EQ(ply.Field("terrain-origin"), "") << "ECEF counts from the Earth's centre";
}

TEST_F(AreaTest, OriginsBeyondTheAntimeridianAreLongitudesAgain) {
  StartAreas();
  const Reply reply = Fetch(port(), "/maui/mesh?bbox=179,-1,-177,1&error=5");
  EXPECT_EQ(reply.Field("terrain-origin"), "0,-179,0");
}

TEST_F(AreaTest, CompressesForThoseWhoTakeIt) {
  StartAreas();
  const Reply reply = Fetch(port(), kArea, "Accept-Encoding: gzip\r\n");
  EXPECT_EQ(reply.Field("content-encoding"), "gzip");
  EXPECT_EQ(reply.body, tiler::Compress(std::string(3000, 'v'), tiler::Coding::kGzip));
}

TEST_F(AreaTest, WhatTheClientHasIsNotMadeAgain) {
  StartAreas();
  const std::string etag = Fetch(port(), kArea).Field("etag");
  ASSERT_NE(etag, "");
  EXPECT_EQ(Fetch(port(), kArea, "If-None-Match: " + etag + "\r\n").status, 304);
  EXPECT_EQ(builds_, 1);
}

TEST_F(AreaTest, RefusesBeforeBuilding) {
  StartAreas();
  EXPECT_EQ(Fetch(port(), "/nope/mesh?bbox=0,0,1,1&error=5").status, 404);
  EXPECT_EQ(Fetch(port(), "/maui/mesh?bbox=0,0,1&error=5").status, 400);
  const Reply reply = Fetch(port(), "/maui/mesh?bbox=0,0,1,1&error=0.1");
  EXPECT_EQ(reply.status, 400);
  EXPECT_NE(reply.body.find("ask for 1 m or more"), std::string::npos) << reply.body;
  EXPECT_EQ(builds_, 0);
}

TEST_F(AreaTest, AFailureIsTriedAgain) {
  StartAreas();
  fails_ = true;
  const Reply reply = Fetch(port(), kArea);
  EXPECT_EQ(reply.status, 503);
  EXPECT_NE(reply.Field("retry-after"), "");
  EXPECT_EQ(reply.body.find("disk"), std::string::npos) << "the log tells why, not the reply";
  fails_ = false;
  EXPECT_EQ(Fetch(port(), kArea).status, 200);
}

TEST_F(AreaTest, WhoHasItsAnswerMayAskAgainAtOnce) {
  StartAreas();
  RawClient client(port());
  for (int i = 0; i < 500; ++i) {
    client.Send(Get(kArea));
    const auto reply = client.Read();
    ASSERT_TRUE(reply);
    ASSERT_EQ(reply->status, 200) << i;
  }
}

TEST_F(AreaTest, LeavesAWorkerForTiles) {
  StartAreas();  // two workers
  held_ = true;
  RawClient first(port());
  first.Send(Get(kArea));
  ASSERT_TRUE(Eventually([this] { return builds_ == 1; }));
  RawClient second(port());
  second.Send(Get(kArea));
  EXPECT_EQ(Fetch(port(), "/maui/0/0/0.terrain").status, 200);
  EXPECT_EQ(builds_, 2) << "of a mesh and a tile";
  held_ = false;
  EXPECT_EQ(first.Read()->status, 200);
  EXPECT_EQ(second.Read()->status, 200) << "it has waited";
}

}  // namespace
}  // namespace terrace::server
