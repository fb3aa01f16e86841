// A server that listens before its datasets are open, and a server on a socket that another process holds.
#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/server/server_fixture.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

class Opening : public ServerFixture {};

TEST_F(Opening, AnswersProbesAndMetricsAndLetsOthersWait) {
  Listen();
  RawClient tile(port()), documents(port());
  tile.Send(Get("/maui/0/0/0.terrain"));
  documents.Send(Get("/datasets"));
  EXPECT_EQ(Fetch(port(), "/livez").status, 200);
  EXPECT_EQ(Fetch(port(), "/metrics").status, 200);
  const Reply probe = Fetch(port(), "/readyz");
  EXPECT_EQ(probe.status, 503);
  EXPECT_EQ(probe.body, "opening\n");
  EXPECT_NE(probe.Field("retry-after"), "");

  server_->Replace(MakeCatalog(), {});
  const auto reply = tile.Read(), list = documents.Read();
  ASSERT_TRUE(reply && list);
  EXPECT_EQ(reply->status, 200);
  EXPECT_NE(list->body.find("maui"), std::string::npos);
  EXPECT_EQ(Fetch(port(), "/readyz").body, "ready\n");
  EXPECT_NE(Fetch(port(), "/metrics").body.find("terrace_catalogs_total 0"), std::string::npos)
      << "nothing was replaced";
}

TEST_F(Opening, TellsWhoWaitsUntilItsDeadlineToAskAgain) {
  ServerOptions options;
  options.config.request_deadline = 100ms;
  Listen(options);
  const Reply reply = Fetch(port(), "/maui/0/0/0.terrain");
  EXPECT_EQ(reply.status, 503);
  EXPECT_NE(reply.Field("retry-after"), "");
}

TEST_F(Opening, MayBeStopped) {
  Listen();
  RawClient tile(port());
  tile.Send(Get("/maui/0/0/0.terrain"));
  EXPECT_EQ(Fetch(port(), "/livez").status, 200);
  server_->RequestStop();
  const auto reply = tile.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 503) << "told, not cut off";
  EXPECT_TRUE(server_->Wait());
}

class Pending : public ServerFixture {
 protected:
  CatalogPtr WithPending(std::vector<DatasetView> datasets) const {
    Catalog catalog = *MakeCatalog();
    catalog.datasets = std::move(datasets);
    catalog.pending = {"alps", "andes"};
    return std::make_shared<const Catalog>(std::move(catalog));
  }

  ServerOptions WithShares() {
    ServerOptions options;
    options.progress_of = [this](const std::string& dataset) { return dataset == "alps" ? share_.load() : 0; };
    return options;
  }

  std::atomic<double> share_{0.426};
};

TEST_F(Pending, DatasetsAreToldWhileOthersAreServed) {
  Listen(WithShares());
  server_->Replace(WithPending(MakeCatalog()->datasets), {});
  EXPECT_EQ(Fetch(port(), "/maui/0/0/0.terrain").status, 200);
  for (const char* target :
       {"/alps/0/0/0.terrain", "/alps/layer.json", "/alps/tileset.json", "/alps/heights?locations=1,1"}) {
    const Reply reply = Fetch(port(), target);
    EXPECT_EQ(reply.status, 503) << target;
    EXPECT_EQ(reply.Field("retry-after"), "5");
    EXPECT_EQ(reply.Field("cache-control"), "no-store");
    EXPECT_NE(reply.body.find("being prepared: 42 %"), std::string::npos) << reply.body;
  }
  EXPECT_EQ(Fetch(port(), "/pyrenees/layer.json").status, 404);
  const Reply ready = Fetch(port(), "/readyz");
  EXPECT_EQ(ready.status, 200);
  EXPECT_EQ(ready.body, "degraded\ndataset alps: being prepared, 42 %\ndataset andes: being prepared, 0 %\n");
  EXPECT_NE(Fetch(port(), "/metrics").body.find("\nterrace_degraded 2\n"), std::string::npos);

  const Reply first = Fetch(port(), "/datasets");
  EXPECT_NE(first.body.find(R"("preparing":[{"name":"alps","percent":42},{"name":"andes","percent":0}])"),
            std::string::npos)
      << first.body;
  EXPECT_NE(first.body.find(R"("name":"maui")"), std::string::npos);
  share_ = 1;  // something is left to do as long as the dataset is not there
  EXPECT_NE(Fetch(port(), "/datasets").body.find(R"({"name":"alps","percent":99})"), std::string::npos);
  server_->SetProblems({{"andes", "/secret/andes.tif: is no raster"}});
  EXPECT_NE(Fetch(port(), "/datasets").body.find(R"({"name":"andes","percent":0,"failed":true})"), std::string::npos);
  EXPECT_EQ(Fetch(port(), "/readyz").body,
            "degraded\ndataset andes: cannot be opened as its files are now; the log has the reason\ndataset alps: "
            "being prepared, 99 %\n");
  const Reply failed = Fetch(port(), "/andes/layer.json");
  EXPECT_EQ(failed.status, 503);
  EXPECT_NE(failed.body.find("cannot be opened"), std::string::npos);
  EXPECT_EQ(failed.body.find("secret"), std::string::npos);

  server_->Replace(MakeCatalog(), {});
  server_->SetProblems({});
  EXPECT_EQ(Fetch(port(), "/readyz").body, "ready\n");
  EXPECT_EQ(Fetch(port(), "/datasets").body.find("preparing"), std::string::npos);
  EXPECT_EQ(Fetch(port(), "/alps/layer.json").status, 404);
}

TEST_F(Pending, AServerWithoutAnythingElseIsNotReady) {
  Listen(WithShares());
  server_->Replace(WithPending({}), {});
  const Reply ready = Fetch(port(), "/readyz");
  EXPECT_EQ(ready.status, 503);
  EXPECT_EQ(ready.Field("retry-after"), "5");
  EXPECT_EQ(ready.body, "opening\ndataset alps: being prepared, 42 %\ndataset andes: being prepared, 0 %\n");
  EXPECT_EQ(Fetch(port(), "/datasets").status, 200);
  const Reply page = Fetch(port(), "/");
  EXPECT_EQ(page.status, 200);
  EXPECT_NE(page.body.find("alps: being prepared, 42 %"), std::string::npos) << page.body;
  EXPECT_NE(page.body.find("http-equiv=\"refresh\""), std::string::npos);
}

TEST_F(Pending, DatasetsAreHiddenFromTokensThatMayNotSeeThem) {
  ServerOptions options = WithShares();
  options.config.datasets = {PublicDataset("maui"), PublicDataset("andes")};
  options.config.tokens = {{"everybody", config::TokenHash("secret-of-all"), {}, 0}};
  Listen(options);
  server_->Replace(WithPending(MakeCatalog()->datasets), options.config);
  const Reply list = Fetch(port(), "/datasets");
  EXPECT_NE(list.body.find(R"("preparing":[{"name":"andes","percent":0}])"), std::string::npos) << list.body;
  EXPECT_EQ(list.body.find("alps"), std::string::npos);
  EXPECT_NE(Fetch(port(), "/alps/layer.json").status, 503) << "tells nothing of it";
  const Reply ready = Fetch(port(), "/readyz");
  EXPECT_EQ(ready.body.find("alps"), std::string::npos) << ready.body;
  EXPECT_NE(ready.body.find("being prepared, 42 %"), std::string::npos);
}

// A listening socket that the test holds, as systemd does.
class HeldSocket : public ServerFixture {
 protected:
  HeldSocket() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = ::htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(socket_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(socket_, 100), 0);
    EXPECT_EQ(::getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    held_port_ = ::ntohs(address.sin_port);
  }
  ~HeldSocket() override { ::close(socket_); }

  ServerOptions OnIt() const {
    ServerOptions options;
    options.listen_socket = ::fcntl(socket_, F_DUPFD_CLOEXEC, 3);
    return options;
  }

  const int socket_;
  std::uint16_t held_port_ = 0;
};

TEST_F(HeldSocket, KeepsThoseWhoComeBetweenTwoServers) {
  Start(OnIt());
  EXPECT_EQ(port(), held_port_);
  EXPECT_NE(server_->url().find("http://127.0.0.1:"), std::string::npos);
  EXPECT_EQ(Fetch(held_port_, "/livez").status, 200);
  server_->RequestStop();
  EXPECT_TRUE(server_->Wait());
  server_.reset();

  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 20; ++i) {
    clients.push_back(std::make_unique<RawClient>(held_port_));
    ASSERT_TRUE(clients.back()->Send(Get("/maui/0/0/0.terrain")));
  }
  Start(OnIt());
  for (const auto& client : clients) {
    const auto reply = client->Read();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->status, 200);
  }
}

TEST_F(HeldSocket, LeavesWhomItDoesNotAcceptToTheNextServer) {
  Start(OnIt());
  server_->RequestStop();
  EXPECT_TRUE(server_->Wait());
  RawClient late(held_port_);
  ASSERT_TRUE(late.Send(Get("/livez")));
  server_.reset();
  Start(OnIt());
  const auto reply = late.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 200);
}

TEST_F(HeldSocket, IsNotAcceptedFromBeforeThereIsSomethingToServe) {
  Listen(OnIt());
  RawClient early(held_port_);
  ASSERT_TRUE(early.Send(Get("/maui/0/0/0.terrain")));
  server_->RequestStop();
  EXPECT_TRUE(server_->Wait());
  server_.reset();
  Listen(OnIt());
  server_->Replace(MakeCatalog(), {});
  const auto reply = early.Read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 200);
}

}  // namespace
}  // namespace terrace::server
