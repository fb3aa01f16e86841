// Limits for one client: transfers, rates, connections, datasets.
#include <gtest/gtest.h>
#include <malloc.h>

#include <thread>
#include <vector>

#include "config/common/token_hash.h"
#include "tests/server/server_fixture.h"
#include "tests/support/resident_memory.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

constexpr const char* kAll = "all-datasets-token";
constexpr const char* kOahu = "oahu-only-token-1";

class Limits : public ServerFixture {
 protected:
  // Makes distinct tiles of a megabyte.
  void MakeTilesLarge(std::size_t bytes = std::size_t{1} << 20) {
    builder_ = [bytes](const tiler::TileRequest& request, std::stop_token) -> Result<tiler::EncodedTile> {
      tiler::EncodedTile tile;
      tile.bytes.assign(bytes, static_cast<char>('a' + request.key.x % 26));
      tile.etag = "\"" + geo::ToString(request.key) + "\"";
      return tile;
    };
  }
  static std::string Tile(int i) {
    return "/maui/3/" + std::to_string(i % 16) + "/" + std::to_string(i / 16 % 8) +
           ".terrain?fraction=" + std::to_string(0.05 * (1 << (i / 128)));
  }
  std::string Metric(const std::string& name) {
    const std::string text = "\n" + Fetch(port(), "/metrics").body;
    const std::size_t at = text.find("\n" + name + " ");
    return at == std::string::npos ? ""
                                   : text.substr(at + name.size() + 2, text.find('\n', at + 1) - at - name.size() - 2);
  }
};

// Row 12 of docs/reliability.md.
TEST_F(Limits, FiveHundredSlowReadersHoldABoundedPart) {
  MakeTilesLarge();
  ServerOptions options;
  options.config.cache_bytes = 0;
  options.config.max_connections = 2000;
  options.config.trusted_proxies = {"127.0.0.1"};
  Start(options);
  Fetch(port(), "/livez");
  const long before = test_support::ResidentKib();
  std::vector<std::unique_ptr<RawClient>> readers;
  for (int i = 0; i < 500; ++i) {
    readers.push_back(std::make_unique<RawClient>(port(), 4096));
    readers.back()->Send(Get(Tile(i)));
  }
  // Replies count, not the memory for building them: all tiles are built, and being sent or waiting for memory.
  const auto under_way = [&] {
    return std::stol(Metric("terrace_http_transfers_waiting")) +
           std::stol(Metric("terrace_http_transfer_bytes")) / (1 << 20);
  };
  ASSERT_TRUE(Eventually([&] { return under_way() >= 500; })) << under_way();
  ASSERT_GT(std::stol(Metric("terrace_http_transfers_waiting")), 400);
  EXPECT_EQ(Metric("terrace_http_transfers_refused_total"), "0");
  constexpr long kMaxGrowth = 64'000'000 / 1024;
  long grown = kMaxGrowth;
  for (int look = 0; look < 4 && grown >= kMaxGrowth; ++look) {
    std::this_thread::sleep_for(1s);
    malloc_trim(0);
    grown = test_support::ResidentKib() - before;
  }
  RecordProperty("resident_kib", static_cast<int>(grown));
  if (!test_support::kSanitized) {
    EXPECT_LT(grown, kMaxGrowth);
  }
  // The slow clients are late now, so a new client is served.
  EXPECT_EQ(Fetch(port(), "/maui/0/0/0.terrain", "X-Forwarded-For: 192.0.2.1\r\n").status, 200);
}

TEST_F(Limits, SlowReadersOfOneClientAreAllServedInTheEnd) {
  MakeTilesLarge();
  ServerOptions options;
  options.config.transfer_bytes = std::size_t{8} << 20;  // two for replies of this size
  Start(options);
  std::vector<std::unique_ptr<RawClient>> readers;
  for (int i = 0; i < 30; ++i) {
    readers.push_back(std::make_unique<RawClient>(port(), 4096));
    readers.back()->Send(Get(Tile(i)));
  }
  ASSERT_TRUE(Eventually([&] { return std::stol(Metric("terrace_http_transfers_waiting")) > 20; }));
  // In any order: each reply waits for those that got memory before it.
  std::vector<std::thread> threads;
  std::atomic<int> whole{0};
  for (auto& reader : readers) {
    threads.emplace_back([&] {
      const auto reply = reader->Read();
      whole += reply && reply->status == 200 && reply->body.size() == std::size_t{1} << 20;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(whole, 30);
  EXPECT_EQ(Metric("terrace_http_transfers_refused_total"), "0");
  EXPECT_EQ(Metric("terrace_http_transfers_cut_total"), "0");
}

TEST_F(Limits, AReaderThatLeavesWhileItsReplyWaitsIsNotRefused) {
  MakeTilesLarge();
  ServerOptions options;
  options.config.transfer_bytes = std::size_t{4} << 20;  // one for replies of this size
  Start(options);
  RawClient slow(port(), 4096), waiting(port(), 4096);
  slow.Send(Get(Tile(0)));
  ASSERT_TRUE(Eventually([&] { return Metric("terrace_http_transfer_bytes") == "1048576"; }));
  waiting.Send(Get(Tile(1)));
  ASSERT_TRUE(Eventually([&] { return Metric("terrace_http_transfers_waiting") == "1"; }));
  waiting.Reset();
  EXPECT_TRUE(Eventually([&] { return Fetch(port(), "/metrics").body.find(R"(status="499")") != std::string::npos; }));
  EXPECT_EQ(Fetch(port(), "/metrics").body.find(R"(status="503")"), std::string::npos);
}

// The reply is larger than the whole budget, so it does not count in it. A client that does not read it does not block
// others.
TEST_F(Limits, AnOversizedReplyThatIsNotTakenMakesRoomForAnothers) {
  MakeTilesLarge(std::size_t{16} << 20);  // the kernel buffers some of it
  ServerOptions options;
  options.config.transfer_bytes = std::size_t{2} << 20;
  options.config.trusted_proxies = {"127.0.0.1"};
  Start(options);
  RawClient slow(port(), 4096);
  slow.Send(Get("/maui/3/0/0.terrain", "X-Forwarded-For: 192.0.2.1\r\n"));
  ASSERT_TRUE(Eventually([&] { return Metric("terrace_http_transfer_bytes") == "16777216"; }));
  EXPECT_EQ(Fetch(port(), "/maui/3/1/0.terrain", "X-Forwarded-For: 192.0.2.2\r\n").status, 200);
  EXPECT_EQ(Metric("terrace_http_transfers_cut_total"), "1");
}

TEST_F(Limits, ManyReadersOfOneTileCountOnce) {
  MakeTilesLarge();
  ServerOptions options;
  options.config.transfer_bytes = std::size_t{2} << 20;
  Start(options);
  std::vector<std::unique_ptr<RawClient>> readers;
  for (int i = 0; i < 50; ++i) {
    readers.push_back(std::make_unique<RawClient>(port(), 4096));
    readers.back()->Send(Get("/maui/0/0/0.terrain"));
  }
  EXPECT_TRUE(Eventually([&] { return Metric("terrace_http_transfer_bytes") == "1048576"; }));
  EXPECT_EQ(Metric("terrace_http_transfers_refused_total"), "0");
  for (auto& reader : readers) EXPECT_EQ(reader->Read()->body.size(), std::size_t{1} << 20);
  EXPECT_TRUE(Eventually([&] { return Metric("terrace_http_transfer_bytes") == "0"; }));
}

TEST_F(Limits, CutsReadersThatTakeTooLittleInTheLongRun) {
  MakeTilesLarge(std::size_t{8} << 20);
  ServerOptions options;
  options.config.write_timeout = 300ms;
  options.config.min_read_rate = 100'000'000;
  Start(options);
  RawClient reader(port(), 4096);
  reader.Send(Get("/maui/0/0/0.terrain"));
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_TRUE(Eventually([&] { return reader.TakeSome(1000) == 0; })) << "each byte comes in time, but not enough";
  EXPECT_LT(std::chrono::steady_clock::now() - begun, 8s);
}

TEST_F(Limits, TellsSlowSendersOfBodies) {
  ServerOptions options;
  options.config.header_timeout = 200ms;
  Start(options);
  RawClient client(port());
  client.Send(
      "POST /maui/heights HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: 20\r\n\r\n{");
  const auto reply = client.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 408);
  EXPECT_EQ(reply->Field("connection"), "close");
  EXPECT_TRUE(client.Ended());
  RawClient head(port());
  head.Send("GET /livez HTTP/1.1\r\nHo");
  ASSERT_EQ(head.Read()->status, 408);
  EXPECT_TRUE(head.Ended());
}

TEST_F(Limits, WhoAsksTooOftenWaits) {
  ServerOptions options;
  options.config.requests_per_second = 20;
  options.config.request_burst = 5;
  Start(options);
  RawClient client(port());
  const auto begun = std::chrono::steady_clock::now();
  for (int i = 0; i < 15; ++i) client.Send(Get("/maui/layer.json"));
  for (int i = 0; i < 15; ++i) EXPECT_EQ(client.Read()->status, 200);
  EXPECT_GE(std::chrono::steady_clock::now() - begun, 450ms) << "ten of them at twenty a second";
}

TEST_F(Limits, RefusesWhoAsksTooOftenToWait) {
  ServerOptions options;
  options.config.request_deadline = 100ms;
  options.config.requests_per_second = 0.5;
  options.config.request_burst = 5;
  Start(options);
  RawClient client(port());
  for (int i = 0; i < 6; ++i) client.Send(Get("/maui/layer.json"));
  for (int i = 0; i < 5; ++i) EXPECT_EQ(client.Read()->status, 200);
  const auto refused = client.Read();
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->status, 429);
  EXPECT_NE(refused->body.find("requests_per_second"), std::string::npos) << refused->body;
  EXPECT_EQ(refused->Field("retry-after"), "2");
  EXPECT_EQ(refused->Field("content-type"), "application/problem+json");
  EXPECT_EQ(Fetch(port(), "/maui/layer.json").status, 429) << "another connection is the same client";
  EXPECT_EQ(Fetch(port(), "/livez").status, 200) << "probes do not count";
  EXPECT_TRUE(Eventually([&] { return Fetch(port(), "/maui/layer.json").status == 200; }));
}

TEST_F(Limits, SlowsDownWhateverIsAsked) {
  ServerOptions options;
  options.config.requests_per_second = 0.001;
  options.config.request_burst = 3;
  Start(options);
  const auto status_of = [&](const std::string& request) { return StatusOf(port(), request); };
  EXPECT_EQ(status_of("OPTIONS /maui/layer.json HTTP/1.1\r\nHost: x\r\n\r\n"), 204);
  EXPECT_EQ(status_of("DELETE /maui/layer.json HTTP/1.1\r\nHost: x\r\n\r\n"), 405);
  EXPECT_EQ(status_of(Get("/nope")), 404);
  EXPECT_EQ(status_of("OPTIONS / HTTP/1.1\r\nHost: x\r\n\r\n"), 429);
  EXPECT_EQ(status_of(Get("/nope")), 429);
  EXPECT_EQ(status_of(Get("/datasets")), 429);
}

TEST_F(Limits, ATokensOwnRateHasABurstOfItsOwn) {
  ServerOptions options;
  options.config.request_deadline = 100ms;
  options.config.requests_per_second = 1000;
  options.config.tokens = {{"slow", config::TokenHash(kAll), {}, 2}};
  Start(options);
  const std::string bearer = std::string("Authorization: Bearer ") + kAll + "\r\n";
  int good = 0;
  for (int i = 0; i < 10; ++i) good += Fetch(port(), "/maui/layer.json", bearer).status == 200;
  EXPECT_GE(good, 4);
  EXPECT_LT(good, 10) << "the burst is twice the token's two a second";
}

TEST_F(Limits, NamesDatasetsWithProblemsToThoseWhoMaySeeThem) {
  ServerOptions options;
  options.config.tokens = {{"everybody", config::TokenHash(kAll), {}, 0}};
  Start(options);
  server_->SetProblems({{"maui", "/secret/maui.tif is gone"}});
  EXPECT_EQ(Fetch(port(), "/readyz").body,
            "degraded\ndataset: cannot be opened as its files are now; the log has the reason\n");
  EXPECT_EQ(Fetch(port(), "/readyz", std::string("Authorization: Bearer ") + kAll + "\r\n").body,
            "degraded\ndataset maui: cannot be opened as its files are now; the log has the reason\n");
  server_->SetProblems({{"maui", kReopening}});
  EXPECT_EQ(Fetch(port(), "/readyz").body, "degraded\ndataset: is being reopened; cached tiles are still served\n");
}

TEST_F(Limits, CountsTheClientsBehindAProxyEachByItself) {
  ServerOptions options;
  options.config.requests_per_second = 0.001;
  options.config.request_burst = 1;
  options.config.trusted_proxies = {"127.0.0.0/8"};
  Start(options);
  const auto from = [&](const std::string& client) {
    return Fetch(port(), "/maui/layer.json", "X-Forwarded-For: " + client + "\r\n").status;
  };
  EXPECT_EQ(from("192.0.2.1"), 200);
  EXPECT_EQ(from("192.0.2.1"), 429);
  EXPECT_EQ(from("192.0.2.2"), 200);
  EXPECT_EQ(from("198.51.100.9, 192.0.2.2"), 429) << "what the client itself put there does not count";
  EXPECT_EQ(from("2001:db8::1"), 200);
  EXPECT_EQ(from("2001:db8::2"), 429) << "one network";
}

TEST_F(Limits, RefusesTooManyConnectionsOfOneClient) {
  ServerOptions options;
  options.config.max_connections_per_client = 2;
  Start(options);
  RawClient first(port());
  auto second = std::make_unique<RawClient>(port());
  for (RawClient* client : {&first, second.get()}) {
    client->Send(Get("/livez"));
    ASSERT_EQ(client->Read()->status, 200);
  }
  const Reply refused = Fetch(port(), "/livez");
  EXPECT_EQ(refused.status, 429);
  EXPECT_EQ(refused.Field("connection"), "close");
  second.reset();
  EXPECT_TRUE(Eventually([&] { return Fetch(port(), "/livez").status == 200; }));
}

TEST_F(Limits, ShowsDatasetsToWhomTheyBelong) {
  DatasetView oahu, open;
  oahu.name = "oahu";
  open.name = "open";
  oahu.available = open.available = {{{0, 0, 1, 0}}};
  more_datasets_ = {oahu, open};
  ServerOptions options;
  options.config.tokens = {{"everybody", config::TokenHash(kAll), {}, 0},
                           {"oahu-team", config::TokenHash(kOahu), {"oahu"}, 0}};
  options.config.datasets = {PublicDataset("open")};
  Start(options);
  const auto bearer = [](const std::string& token) { return "Authorization: Bearer " + token + "\r\n"; };
  const struct {
    const char* target;
    int anonymous, oahu, all;
  } cases[] = {
      {"/maui/layer.json", 401, 403, 200},
      {"/maui/0/0/0.terrain", 401, 403, 200},
      {"/oahu/layer.json", 401, 200, 200},
      {"/oahu/0/0/0.glb", 401, 200, 200},
      {"/open/layer.json", 200, 200, 200},
      {"/open/0/0/0.terrain", 200, 200, 200},
      {"/nope/layer.json", 401, 403, 404},
      {"/metrics", 401, 403, 200},
      {"/version", 401, 403, 200},
      {"/datasets", 200, 200, 200},
      {"/", 200, 200, 200},
      {"/livez", 200, 200, 200},
      {"/maui/tileset.json", 401, 403, 200},
      {"/maui/tiles.json", 401, 403, 200},
      {"/maui/heights?locations=1,2", 401, 403, 503},
  };
  for (const auto& c : cases) {
    const std::string target = c.target;
    EXPECT_EQ(Fetch(port(), target).status, c.anonymous) << target;
    EXPECT_EQ(Fetch(port(), target, bearer(kOahu)).status, c.oahu) << target;
    EXPECT_EQ(Fetch(port(), target, bearer(kAll)).status, c.all) << target;
    const std::string in_query = target + (target.find('?') == std::string::npos ? "?" : "&") + "token=" + kOahu;
    EXPECT_EQ(Fetch(port(), in_query).status, c.oahu) << target;
    EXPECT_EQ(Fetch(port(), in_query, bearer(kAll)).status, c.all) << "the header counts: " << target;
  }
  EXPECT_EQ(Fetch(port(), "/open/layer.json", bearer("no-such-token-0001")).status, 401);
  EXPECT_EQ(Fetch(port(), "/open/layer.json?token=" + std::string(kAll) + "&token=" + kOahu).status, 401) << "which?";
  EXPECT_EQ(Fetch(port(), "/oahu/0/0/0.terrain?token=" + std::string(kOahu) + "&error=5&token=" + kOahu).status, 200);

  EXPECT_EQ(Fetch(port(), "/datasets").body.find("maui"), std::string::npos);
  EXPECT_EQ(Fetch(port(), "/").body.find("maui"), std::string::npos);
  EXPECT_NE(Fetch(port(), "/datasets").body.find("open"), std::string::npos);
  EXPECT_NE(Fetch(port(), "/datasets", bearer(kOahu)).body.find("oahu"), std::string::npos);

  const Reply denied = Fetch(port(), "/maui/layer.json");
  EXPECT_TRUE(denied.Field("www-authenticate").starts_with("Bearer")) << denied.Field("www-authenticate");
  EXPECT_EQ(denied.Field("content-type"), "application/problem+json");
  EXPECT_EQ(denied.Field("access-control-allow-origin"), "*");
  const Reply granted = Fetch(port(), "/maui/layer.json", bearer(kAll));
  EXPECT_EQ(granted.Field("cache-control"), "private, no-cache");
  EXPECT_EQ(granted.Field("vary"), "Accept-Encoding, Authorization");
  EXPECT_EQ(Fetch(port(), "/open/layer.json").Field("cache-control"), "no-cache");
  EXPECT_EQ(Fetch(port(), "/open/layer.json", bearer(kAll)).Field("cache-control"), "private, no-cache");

  const std::string tile = std::string("/maui/0/0/0.terrain?v=") + kMauiVersion, public_tile = "/open/0/0/0.terrain";
  EXPECT_EQ(Fetch(port(), tile, bearer(kAll)).Field("cache-control"), "private, max-age=31536000, immutable");
  EXPECT_EQ(Fetch(port(), public_tile).Field("cache-control"), "public, max-age=3600");
  EXPECT_EQ(Fetch(port(), public_tile, bearer(kAll)).Field("cache-control"), "private, max-age=3600");
  EXPECT_EQ(Fetch(port(), public_tile + "?v=x", bearer(kAll)).Field("cache-control"), "private, no-store");

  RawClient browser(port());
  browser.Send("OPTIONS /maui/layer.json HTTP/1.1\r\nHost: x\r\nOrigin: http://a\r\n\r\n");
  EXPECT_EQ(browser.Read()->status, 204) << "preflights carry no token";
}

TEST_F(Limits, ATokenInTheQueryGoesIntoTemplates) {
  ServerOptions options;
  options.config.tokens = {{"a", config::TokenHash(kAll), {}, 0}};
  options.config.datasets = {PublicDataset("maui")};
  Start(options);
  const std::string token = std::string("token=") + kAll, version = kMauiVersion;
  const auto contains = [](const Reply& reply, const std::string& text) {
    return reply.body.find(text) != std::string::npos;
  };
  EXPECT_TRUE(contains(Fetch(port(), "/maui/layer.json?" + token), "{y}.terrain?v=" + version + "&" + token));
  for (const char* page : {"layer.json", "tileset.json", "tiles.json"}) {
    const Reply reply = Fetch(port(), "/maui/" + std::string(page) + "?" + token);
    EXPECT_EQ(reply.Field("cache-control"), "private, no-cache") << "whatever else its reader may see: " << page;
    EXPECT_NE(reply.Field("vary").find("Authorization"), std::string::npos) << page;
  }
  EXPECT_EQ(Fetch(port(), "/maui/0/0/0.terrain?" + token).Field("cache-control"), "private, max-age=3600");
  const Reply tileset = Fetch(port(), "/maui/tileset.json?error=5&" + token);
  EXPECT_TRUE(contains(tileset, ".glb?v=" + version + "&error=5&atleast=1&" + token));
  EXPECT_TRUE(contains(tileset, ".subtree?v=" + version + "&error=5&atleast=1&" + token));
  EXPECT_TRUE(contains(Fetch(port(), "/maui/tiles.json?" + token), "{y}.png?v=" + version + "&" + token));
  EXPECT_TRUE(contains(Fetch(port(), "/maui/tiles.json?encoding=terrarium&" + token),
                       "{y}.png?v=" + version + "&encoding=terrarium&" + token));
  const std::string bearer = std::string("Authorization: Bearer ") + kAll + "\r\n";
  for (const char* target : {"/maui/layer.json", "/maui/tileset.json", "/maui/tiles.json"}) {
    EXPECT_FALSE(contains(Fetch(port(), target, bearer), "token=")) << target;
  }
}

TEST_F(Limits, ATokenChangesNoTile) {
  ServerOptions options;
  options.config.tokens = {{"a", config::TokenHash(kAll), {}, 0}, {"b", config::TokenHash(kOahu), {"maui"}, 0}};
  Start(options);
  const Reply one = Fetch(port(), "/maui/0/0/0.terrain?token=" + std::string(kAll));
  const Reply other = Fetch(port(), "/maui/0/0/0.terrain?token=" + std::string(kOahu));
  EXPECT_EQ(one.status, 200);
  EXPECT_EQ(one.body, other.body);
  EXPECT_EQ(one.Field("etag"), other.Field("etag"));
  EXPECT_EQ(builds_, 1) << "one tile for both";
}

TEST_F(Limits, TokensAreIgnoredWhereThereAreNone) {
  Start();
  EXPECT_EQ(Fetch(port(), "/maui/layer.json?token=anything").body.find("anything"), std::string::npos);
  EXPECT_EQ(Fetch(port(), "/maui/0/0/0.terrain?token=anything&error=5").status, 200);
  EXPECT_EQ(Fetch(port(), "/maui/layer.json?token=").Field("cache-control"), "private, no-cache");
}

TEST_F(Limits, LetsTheConfiguredPagesReadReplies) {
  ServerOptions options;
  options.config.cors_origins = {"https://maps.example", "http://localhost:3000"};
  Start(options);
  const Reply known = Fetch(port(), "/maui/layer.json", "Origin: https://maps.example\r\n");
  EXPECT_EQ(known.Field("access-control-allow-origin"), "https://maps.example");
  EXPECT_EQ(known.Field("timing-allow-origin"), "https://maps.example");
  EXPECT_EQ(known.Field("vary"), "Accept-Encoding, Origin");
  for (const char* origin : {"", "Origin: https://evil.example\r\n", "Origin: null\r\n"}) {
    const Reply reply = Fetch(port(), "/livez", origin);
    EXPECT_EQ(reply.status, 200);
    EXPECT_FALSE(reply.fields.contains("access-control-allow-origin")) << origin;
    EXPECT_EQ(reply.Field("vary"), "Origin") << "another page would be answered otherwise";
  }
  const std::string target = "/maui/heights?locations=" + std::string(9000, '1'),
                    page = "Origin: https://maps.example\r\n";
  for (const auto& [refused, status] :
       {std::pair(Fetch(port(), target, page), 414), std::pair(Fetch(port(), "/livez", page + "Host: a\r\n"), 400)}) {
    EXPECT_EQ(refused.status, status);
    EXPECT_EQ(refused.Field("access-control-allow-origin"), "https://maps.example") << status;
  }
  EXPECT_FALSE(Fetch(port(), target, page + page).fields.contains("access-control-allow-origin")) << "two origins";
}

TEST_F(Limits, BelievesTrustedProxiesAlone) {
  const std::string said = "X-Forwarded-Proto: https\r\nX-Forwarded-Host: maps.example\r\n";
  Start();
  EXPECT_NE(Fetch(port(), "/maui/tiles.json", said).body.find("\"http://localhost/maui/"), std::string::npos);
  server_.reset();
  ServerOptions options;
  options.config.trusted_proxies = {"127.0.0.1"};
  Start(options);
  const Reply reply = Fetch(port(), "/maui/tiles.json", said);
  EXPECT_NE(reply.body.find("\"https://maps.example/maui/"), std::string::npos) << reply.body;
  EXPECT_NE(reply.Field("vary").find("X-Forwarded-Host, X-Forwarded-Proto"), std::string::npos);
  // A reload does not change which proxies are trusted, nor what the reply varies by.
  server_->Replace(MakeCatalog(), {});
  const Reply reloaded = Fetch(port(), "/maui/tiles.json", said);
  EXPECT_EQ(reloaded.body, reply.body);
  EXPECT_EQ(reloaded.Field("vary"), reply.Field("vary"));
}

TEST_F(Limits, TheHostOfATargetCountsBeforeHost) {
  Start();
  RawClient client(port());
  const auto ask = [&](const std::string& target) {
    client.Send("GET " + target + " HTTP/1.1\r\nHost: there.example\r\n\r\n");
    const auto reply = client.Read();
    return reply ? reply->body : "";
  };
  const auto told = [](const std::string& body, const char* host) {
    return body.find("\"http://" + std::string(host) + "/maui/") != std::string::npos;
  };
  EXPECT_TRUE(told(ask("http://here.example:8080/maui/tiles.json"), "here.example:8080"));
  EXPECT_TRUE(told(ask("/maui/tiles.json"), "there.example")) << "the same lines, another host";
  EXPECT_TRUE(told(ask("http://here.example/maui/tiles.json"), "here.example"));
}

TEST_F(Limits, RefusesOptionsThatMakeNoSense) {
  ServerOptions options;
  options.config.trusted_proxies = {"proxy.example"};
  EXPECT_FALSE(Server::Start(options));
  options = {};
  options.config.tls.certificate = options.config.tls.key = "/nowhere.pem";
  const auto server = Server::Start(options);
  ASSERT_FALSE(server);
  EXPECT_NE(server.error().message.find("/nowhere.pem"), std::string::npos);
}

}  // namespace
}  // namespace terrace::server
