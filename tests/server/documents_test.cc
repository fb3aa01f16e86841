// Documents with parameters: on which thread they are made, and that they are equal to documents made in advance.
#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "config/common/token_hash.h"
#include "proto/compress.h"
#include "server/documents/document.h"
#include "tests/server/server_fixture.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

class DocumentsTest : public ServerFixture {
 protected:
  // Builds block until the test opens the gate.
  DocumentsTest() {
    builder_ = [this](const tiler::TileRequest&, const std::stop_token&) -> Result<tiler::EncodedTile> {
      ++builds_;
      std::unique_lock lock(mutex_);
      opened_.wait(lock, [this] { return is_open_; });
      tiler::EncodedTile tile;
      tile.bytes = "tile";
      return tile;
    };
  }
  void TearDown() override {
    Open(true);
    ServerFixture::TearDown();
  }

  static ServerOptions OneWorker() {
    ServerOptions options;
    options.config.worker_threads = 1;
    options.config.request_deadline = 400ms;
    return options;
  }
  // "blocks" has long documents, "maui" short ones.
  void StartWithOneWorker() {
    DatasetView blocks;
    blocks.name = "blocks";
    blocks.available = {{{0, 0, 1, 0}}, {{0, 0, 3, 1}}, {{0, 0, 7, 3}}};
    blocks.available.emplace_back();
    for (int i = 0; i < 100; ++i) blocks.available.back().push_back({i % 16, i / 16, i % 16, i / 16});
    more_datasets_ = {blocks};
    Start(OneWorker());
  }
  void Open(bool is_open) {
    const std::lock_guard lock(mutex_);
    is_open_ = is_open;
    opened_.notify_all();
  }

  std::mutex mutex_;
  std::condition_variable opened_;
  bool is_open_ = false;  // guarded by mutex_
};

TEST_F(DocumentsTest, AreMadeOnWorkersAndKept) {
  StartWithOneWorker();
  RawClient holder(port());
  ASSERT_TRUE(holder.Send(Get("/maui/2/0/0.terrain")));
  ASSERT_TRUE(Eventually([this] { return builds_ > 0; }));
  const Reply refused = Fetch(port(), "/blocks/layer.json?fraction=0.5");
  EXPECT_EQ(refused.status, 503);
  EXPECT_EQ(refused.Field("retry-after"), "5") << "not ready in time";
  EXPECT_EQ(Fetch(port(), "/blocks/layer.json").status, 200) << "made when the server started";
  EXPECT_EQ(Fetch(port(), "/maui/layer.json?fraction=0.5").status, 503) << "short, and on a worker all the same";
  EXPECT_EQ(Fetch(port(), "/blocks/layer.json?fraction=wide").status, 400);

  Open(true);
  const Reply made = Fetch(port(), "/blocks/layer.json?fraction=0.5");
  EXPECT_EQ(made.status, 200);
  EXPECT_EQ(made.Field("content-type"), "application/json");
  Open(false);
  const int before = builds_;
  RawClient again(port());
  ASSERT_TRUE(again.Send(Get("/maui/2/1/0.terrain")));
  ASSERT_TRUE(Eventually([&] { return builds_ > before; }));
  const Reply kept = Fetch(port(), "/blocks/layer.json?v=2&fraction=.50");
  EXPECT_EQ(kept.status, 200) << "the same error";
  EXPECT_EQ(kept.body, made.body);
  EXPECT_EQ(Fetch(port(), "/blocks/layer.json?fraction=0.5", "If-None-Match: " + made.Field("etag") + "\r\n").status,
            304);
  EXPECT_EQ(Fetch(port(), "/blocks/layer.json?fraction=0.25").status, 503) << "another error";
  Open(true);
}

// They contain the heights of up to 5,461 tiles, and each needs the source's tables: too much work for an io thread,
// although the reply is short.
TEST_F(DocumentsTest, SubtreesAreMadeOnWorkersAndKept) {
  DatasetView tall;
  tall.name = "tall";
  for (int level = 0; level <= 7; ++level) tall.available.push_back({{0, 0, (2 << level) - 1, (1 << level) - 1}});
  std::atomic<int> asked = 0;
  std::atomic<bool> is_readable = false;
  tall.range_bound = [&](const geo::TileKey&) -> Result<dem::HeightRange> {
    ++asked;
    if (!is_readable) return MakeError(ErrorCode::kUnavailable, "cannot be read now");
    return dem::HeightRange{-100, 100};
  };
  more_datasets_ = {tall};
  Start(OneWorker());
  const int at_start = asked;
  RawClient holder(port());
  ASSERT_TRUE(holder.Send(Get("/tall/2/0/0.terrain")));
  ASSERT_TRUE(Eventually([this] { return builds_ > 0; }));
  const std::string target = "/tall/3dtiles/1-0-0/0/0/0.7.subtree";
  for (const std::string& waiting : {target, std::string("/tall/3dtiles/1-0-0/0/0/0.3.subtree")}) {
    EXPECT_EQ(Fetch(port(), waiting).status, 503);
    EXPECT_EQ(asked, at_start);
  }

  Open(true);
  EXPECT_EQ(Fetch(port(), target).Field("cache-control"), "no-cache");
  is_readable = true;
  asked = at_start;
  const Reply made = Fetch(port(), target);
  EXPECT_EQ(made.status, 200);
  EXPECT_NE(made.Field("cache-control"), "no-cache");
  EXPECT_EQ(asked, at_start + 5461) << "a reply without the ranges was kept";
  EXPECT_EQ(Fetch(port(), target + "?compression=none&v=3").body, made.body);
  EXPECT_EQ(asked, at_start + 5461) << "kept";
  EXPECT_NE(Fetch(port(), target + "?fraction=0.1").body, made.body) << "shorter skirts";
}

TEST_F(DocumentsTest, AreMadeOnceForAllWhoWait) {
  DatasetView tall;
  tall.name = "tall";
  for (int level = 0; level <= 3; ++level) tall.available.push_back({{0, 0, (2 << level) - 1, (1 << level) - 1}});
  std::atomic<int> asked = 0;
  tall.range_bound = [&](const geo::TileKey&) -> Result<dem::HeightRange> {
    ++asked;
    return dem::HeightRange{-100, 100};
  };
  more_datasets_ = {tall};
  ServerOptions options;
  options.config.worker_threads = 1;
  Start(std::move(options));
  const int at_start = asked;
  RawClient holder(port());
  ASSERT_TRUE(holder.Send(Get("/tall/2/0/0.terrain")));
  ASSERT_TRUE(Eventually([this] { return builds_ > 0; }));
  constexpr int kClients = 10;
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < kClients; ++i) {
    clients.push_back(std::make_unique<RawClient>(port()));
    ASSERT_TRUE(clients.back()->Send(Get("/tall/3dtiles/1-0-0/0/0/0.3.subtree")));
  }
  const std::string waiting = "terrace_flights_joined_total " + std::to_string(kClients - 1) + "\n";
  EXPECT_TRUE(Eventually([&] { return Fetch(port(), "/metrics").body.find(waiting) != std::string::npos; }));
  Open(true);
  std::optional<std::string> first;
  for (auto& client : clients) {
    const std::optional<Reply> reply = client->Read();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->status, 200);
    if (!first) first = reply->body;
    EXPECT_EQ(reply->body, *first);
  }
  EXPECT_EQ(asked, at_start + 21) << "the tiles of three levels, once";
}

TEST_F(DocumentsTest, AreTheSameWhereverTheyAreMade) {
  StartWithOneWorker();
  Open(true);
  for (const char* target :
       {"/blocks/layer.json?error=5", "/blocks/tileset.json?fraction=0.5", "/maui/layer.json?error=5"}) {
    for (int i = 0; i < 2; ++i) {
      const Reply plain = Fetch(port(), target), gzip = Fetch(port(), target, "Accept-Encoding: gzip\r\n");
      const Document expected = Document::Make(plain.body, "application/json");
      EXPECT_EQ(plain.Field("etag"), expected.identity_etag) << target;
      EXPECT_EQ(plain.Field("content-encoding"), "");
      ASSERT_NE(expected.gzip, nullptr);
      EXPECT_EQ(gzip.body, *expected.gzip) << target;
      EXPECT_EQ(gzip.Field("etag"), expected.gzip_etag) << target;
      EXPECT_EQ(gzip.Field("content-encoding"), "gzip");
      for (const Reply* reply : {&plain, &gzip}) {
        EXPECT_EQ(reply->Field("vary"), Fetch(port(), "/blocks/layer.json").Field("vary"));
        EXPECT_EQ(reply->Field("cache-control"), "no-cache");
      }
    }
  }
}

TEST_F(DocumentsTest, ListsOfWhatATokenSeesAreMadeOnWorkers) {
  for (int i = 0; i < 100; ++i) {
    DatasetView view;
    view.name = "dataset" + std::to_string(i);
    view.available = {{{0, 0, 1, 0}}};
    more_datasets_.push_back(view);
  }
  ServerOptions options = OneWorker();
  options.config.tokens = {{"one", config::TokenHash("secret-of-one"), {"dataset7"}, 0}};
  options.config.datasets = {PublicDataset("maui")};
  Start(std::move(options));
  const std::string token = "Authorization: Bearer secret-of-one\r\n";
  const Reply list = Fetch(port(), "/datasets", token), page = Fetch(port(), "/", token);
  EXPECT_NE(list.body.find("dataset7"), std::string::npos);
  EXPECT_EQ(list.body.find("dataset8"), std::string::npos);
  EXPECT_NE(page.body.find("dataset7"), std::string::npos);
  EXPECT_EQ(Fetch(port(), "/datasets").body.find("dataset7"), std::string::npos) << "without the token";
  for (const Reply* reply : {&list, &page}) {
    EXPECT_EQ(reply->Field("cache-control"), "private, no-cache");
    EXPECT_NE(reply->Field("vary").find("Authorization"), std::string::npos);
  }
  RawClient holder(port());
  ASSERT_TRUE(holder.Send(Get("/maui/2/0/0.terrain")));
  ASSERT_TRUE(Eventually([this] { return builds_ > 0; }));
  EXPECT_EQ(Fetch(port(), "/datasets", token).body, list.body) << "kept";
  EXPECT_EQ(Fetch(port(), "/datasets", token + "Accept-Encoding: gzip\r\n").status, 503) << "in another coding";
}

}  // namespace
}  // namespace terrace::server
