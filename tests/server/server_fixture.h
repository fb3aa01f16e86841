// A real server on a free port with one fake dataset, "maui", levels 0 to 3, and a builder that tests replace.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/server.h"
#include "tests/server/fake_pipeline.h"
#include "tests/server/raw_client.h"

namespace terrace::server {

class ServerFixture : public testing::Test {
 protected:
  ServerFixture();
  // Stops the server, because its workers may still use members of a derived fixture.
  void TearDown() override { server_.reset(); }

  // Call once, after the knobs are set.
  void Start(ServerOptions options = {});
  // The same in two steps: listening, and the datasets.
  void Listen(ServerOptions options = {});
  CatalogPtr MakeCatalog() const;
  std::uint16_t port() const { return server_->port(); }

  // The tile of the default builder: readable, and different for different requests.
  static std::string BodyOf(const tiler::TileRequest& request);

  PointReader read_points_;     // default: none
  AreaMesher area_mesher_;      // default: none
  TileBuilder builder_;         // default: counts and returns BodyOf, compressed when asked for
  std::atomic<int> builds_{0};  // by the default builder
  std::atomic<int> build_ms_{0};
  std::vector<DatasetView> more_datasets_;  // beside "maui"
  std::unique_ptr<Server> server_;
};

// Of "maui", as it stands in URLs.
inline constexpr const char* kMauiVersion = "0a1b2c3d4e5f";

// A dataset that is visible without a token.
config::DatasetConfig PublicDataset(std::string name);

// Sleeps until `done`. Returns false if ten seconds pass before.
bool Eventually(const std::function<bool()>& done);

}  // namespace terrace::server
