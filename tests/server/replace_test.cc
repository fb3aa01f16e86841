// Datasets are replaced during requests.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "tests/server/server_fixture.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

// One dataset, "maui", whose tiles are their generation's text.
CatalogPtr CatalogOf(std::uint64_t generation, TileBuilder builder, const char* name = "maui") {
  auto catalog = std::make_shared<Catalog>();
  catalog->datasets.resize(1);
  catalog->datasets[0].name = name;
  catalog->datasets[0].generation = catalog->datasets[0].cache_generation = generation;
  catalog->datasets[0].available = {{{0, 0, 1, 0}}};
  catalog->pipeline = std::make_shared<FakePipeline>(std::move(builder));
  return catalog;
}

TileBuilder Says(std::string text) {
  return [text](const tiler::TileRequest&, std::stop_token) -> Result<tiler::EncodedTile> {
    tiler::EncodedTile tile;
    tile.bytes = text;
    return tile;
  };
}

TileBuilder FindsItsSourceChanged() {
  return [](const tiler::TileRequest&, std::stop_token) -> Result<tiler::EncodedTile> {
    return MakeError(ErrorCode::kChanged, "/secret/maui.tif was changed");
  };
}

class Replace : public testing::Test {
 protected:
  void Start(CatalogPtr catalog) {
    options_.config.listen.port = 0;
    options_.config.io_threads = 2;
    options_.metrics_age = std::chrono::milliseconds(0);
    auto server = Server::Start(options_);
    ASSERT_TRUE(server) << server.error().message;
    server_ = std::move(*server);
    server_->Replace(std::move(catalog), options_.config);
  }
  Reply Tile(const char* target = "/maui/0/0/0.terrain") { return Fetch(server_->port(), target); }

  ServerOptions options_;
  std::unique_ptr<Server> server_;
};

TEST_F(Replace, AnswersFromTheNextCatalog) {
  Start(CatalogOf(1, Says("old")));
  EXPECT_EQ(Tile().body, "old");
  server_->Replace(CatalogOf(2, Says("new")), options_.config);
  EXPECT_EQ(Tile().body, "new");
  server_->Replace(CatalogOf(2, Says("new"), "oahu"), options_.config);
  EXPECT_EQ(Tile().status, 404);
  EXPECT_EQ(Tile("/oahu/0/0/0.terrain").body, "new");
  EXPECT_EQ(Tile("/oahu/0/0/0.terrain").Field("server-timing"), "cache;desc=hit");
  const Reply metrics = Fetch(server_->port(), "/metrics");
  EXPECT_NE(metrics.body.find("terrace_catalogs_total 2"), std::string::npos);
}

TEST_F(Replace, ForgetsWhatWasCountedOfDatasetsThatAreGone) {
  Start(CatalogOf(1, Says("old")));
  const auto tells = [&](const char* text) {
    return Fetch(server_->port(), "/metrics").body.find(text) != std::string::npos;
  };
  const char* const once = R"(terrace_http_requests_total{dataset="maui",route="tile",status="200"} 1)";
  Tile();
  ASSERT_TRUE(Eventually([&] { return tells(once); })) << "a reply is counted when it is sent";
  server_->Replace(CatalogOf(2, Says("new")), options_.config);
  EXPECT_TRUE(tells(once));
  EXPECT_TRUE(tells(R"(terrace_tile_builds_total{dataset="maui")"));
  server_->Replace(CatalogOf(2, Says("new"), "oahu"), options_.config);
  EXPECT_FALSE(tells(R"(dataset="maui")"));
  server_->Replace(CatalogOf(3, Says("new")), options_.config);
  Tile();
  EXPECT_TRUE(Eventually([&] { return tells(once); }));
}

TEST_F(Replace, KeepsRequestsWithTheCatalogTheyBeganWith) {
  std::atomic<bool> begun{false}, go_on{false};
  Start(CatalogOf(1, [&](const tiler::TileRequest&, std::stop_token) -> Result<tiler::EncodedTile> {
    begun = true;
    while (!go_on) std::this_thread::sleep_for(1ms);
    tiler::EncodedTile tile;
    tile.bytes = "old";
    return tile;
  }));
  RawClient early(server_->port());
  early.Send(Get("/maui/0/0/0.terrain"));
  ASSERT_TRUE(Eventually([&] { return begun.load(); }));
  server_->Replace(CatalogOf(2, Says("new")), options_.config);
  EXPECT_EQ(Tile().body, "new");
  go_on = true;
  const auto reply = early.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->body, "old");
  EXPECT_EQ(Tile().body, "new") << "what landed late is not kept";
}

// A copy of a source has the same generation, so the two catalogs have the same keys.
TEST_F(Replace, BuildsATileAgainIfABuildOfTheCatalogBeforeFoundItsSourceChanged) {
  std::atomic<bool> begun{false}, go_on{false};
  options_.on_source_changed = [] {};
  Start(CatalogOf(1, [&](const tiler::TileRequest&, std::stop_token) -> Result<tiler::EncodedTile> {
    begun = true;
    while (!go_on) std::this_thread::sleep_for(1ms);
    return MakeError(ErrorCode::kChanged, "maui.tif was changed");
  }));
  RawClient early(server_->port()), late(server_->port());
  early.Send(Get("/maui/0/0/0.terrain"));
  ASSERT_TRUE(Eventually([&] { return begun.load(); }));
  server_->Replace(CatalogOf(1, Says("copy")), options_.config);
  late.Send(Get("/maui/0/0/0.terrain"));
  ASSERT_TRUE(Eventually([&] {
    return Fetch(server_->port(), "/metrics").body.find("terrace_flights_joined_total 1") != std::string::npos;
  }));
  go_on = true;
  for (RawClient* client : {&early, &late}) {
    const auto reply = client->Read();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->status, 200);
    EXPECT_EQ(reply->body, "copy");
  }
}

TEST_F(Replace, WaitsForTheNextCatalogWhereTheSourceHasChanged) {
  std::atomic<int> told{0};
  options_.on_source_changed = [&] { ++told; };
  Start(CatalogOf(1, FindsItsSourceChanged()));
  std::thread reopening([&] {
    EXPECT_TRUE(Eventually([&] { return told > 0; }));
    server_->Replace(CatalogOf(2, Says("new")), options_.config);
  });
  EXPECT_EQ(Tile().body, "new");
  reopening.join();
}

TEST_F(Replace, DoesNotWaitWhereNobodyOpensItAnew) {
  Start(CatalogOf(1, FindsItsSourceChanged()));
  const Reply reply = Tile();
  EXPECT_EQ(reply.status, 503);
  EXPECT_EQ(reply.Field("retry-after"), "1");
  EXPECT_EQ(reply.body.find("secret"), std::string::npos);
}

// A source that is replaced again while it is being opened.
TEST_F(Replace, WaitsOutAProblemThatPasses) {
  std::atomic<int> told{0};
  options_.on_source_changed = [&] { ++told; };
  Start(CatalogOf(1, FindsItsSourceChanged()));
  server_->SetProblems({{"maui", "/secret/maui.tif has changed while it was opened"}});
  std::thread reopening([&] {
    EXPECT_TRUE(Eventually([&] { return told > 0; }));
    std::this_thread::sleep_for(100ms);
    server_->Replace(CatalogOf(2, Says("new")), options_.config);
  });
  EXPECT_EQ(Tile().body, "new");
  reopening.join();
}

TEST_F(Replace, DoesNotWaitForADatasetWithAProblem) {
  std::atomic<int> told{0};
  options_.on_source_changed = [&] { ++told; };
  Start(CatalogOf(1, FindsItsSourceChanged()));
  EXPECT_EQ(Fetch(server_->port(), "/readyz").body, "ready\n");
  server_->SetProblems({{"maui", "/secret/maui.tif is gone"}});
  std::this_thread::sleep_for(1600ms);  // the error persists
  server_->SetProblems({{"maui", "/secret/maui.tif is still gone"}});
  std::thread reopening([&] {  // a waiting request would see this
    EXPECT_TRUE(Eventually([&] { return told > 0; }));
    std::this_thread::sleep_for(1500ms);
    server_->Replace(CatalogOf(2, Says("new")), options_.config);
  });
  EXPECT_EQ(Tile().status, 503);
  reopening.join();
  EXPECT_EQ(told, 1) << "it may be mended meanwhile";
  const Reply ready = Fetch(server_->port(), "/readyz");
  EXPECT_EQ(ready.status, 200);
  EXPECT_EQ(ready.body, "degraded\ndataset maui: cannot be opened as its files are now; the log has the reason\n");
}

TEST_F(Replace, TakesOverTheOptionsThatMayChange) {
  Start(CatalogOf(1, Says("old")));
  EXPECT_EQ(Tile().Field("cache-control"), "public, max-age=3600");
  options_.config.cache_control = "no-cache";
  options_.config.cache_bytes = 0;
  server_->Replace(CatalogOf(1, Says("old")), options_.config);
  EXPECT_EQ(Tile().Field("cache-control"), "no-cache");
  EXPECT_TRUE(Tile().Field("server-timing").starts_with("cache;desc=miss")) << "the cache is off now";
}

}  // namespace
}  // namespace terrace::server
