// A real server on a free port with one made-up dataset, "maui", levels 0 to 3, and a builder that tests steer.
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
  // Stops the server, whose workers may still be using what a derived fixture has made.
  void TearDown() override { server_.reset(); }

  // Call once, after the knobs are set.
  void Start(ServerOptions options = {});
  // The same in two steps: listening, and the datasets.
  void Listen(ServerOptions options = {});
  CatalogPtr MakeCatalog() const;
  std::uint16_t port() const { return server_->port(); }

  // What the default builder makes of a request: readable, and different wherever the request differs.
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

// One that is seen without a token.
config::DatasetConfig PublicDataset(std::string name);

// Sleeps until `done` or ten seconds have passed; then false.
bool Eventually(const std::function<bool()>& done);

}  // namespace terrace::server
