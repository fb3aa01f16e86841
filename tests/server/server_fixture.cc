#include "tests/server/server_fixture.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <thread>

#include "proto/compress.h"
#include "server/descriptors.h"

namespace terrace::server {

ServerFixture::ServerFixture() {
  spdlog::set_level(spdlog::level::err);
  RaiseDescriptorLimit();
  builder_ = [this](const tiler::TileRequest& request, std::stop_token stop) -> Result<tiler::EncodedTile> {
    ++builds_;
    const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(build_ms_);
    while (std::chrono::steady_clock::now() < until) {
      if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "stopped");
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    tiler::EncodedTile tile;
    tile.bytes = BodyOf(request);
    tile.etag = fmt::format("\"{:x}\"", std::hash<std::string>{}(tile.bytes));
    tile.bytes = tiler::Compress(std::move(tile.bytes), request.coding);
    tile.max_error_m = 3.871234;
    return tile;
  };
}

void ServerFixture::Start(ServerOptions options) {
  Listen(options);
  ASSERT_TRUE(server_);
  server_->Replace(MakeCatalog(), options.config);
}

void ServerFixture::Listen(ServerOptions options) {
  options.config.listen.port = 0;
  options.config.io_threads = 2;
  options.metrics_age = std::chrono::milliseconds(0);  // tests read metrics of their latest request
  if (options.config.worker_threads == 0) options.config.worker_threads = 2;
  auto server = Server::Start(options);
  ASSERT_TRUE(server) << server.error().message;
  server_ = std::move(*server);
}

CatalogPtr ServerFixture::MakeCatalog() const {
  DatasetView maui;
  maui.name = "maui";
  maui.generation = 0x0a1b2c3d4e5f6789;
  maui.available = {{{0, 0, 1, 0}}, {{0, 0, 3, 1}}, {{0, 0, 7, 3}}, {{0, 0, 15, 7}}};
  std::vector<DatasetView> datasets = more_datasets_;
  datasets.insert(datasets.begin(), maui);
  for (DatasetView& dataset : datasets) dataset.cache_generation = dataset.generation;
  return std::make_shared<const Catalog>(
      Catalog{std::move(datasets), std::make_shared<FakePipeline>(builder_, read_points_, area_mesher_)});
}

std::string ServerFixture::BodyOf(const tiler::TileRequest& request) {
  std::string body = fmt::format("tile {} step {} coding {} normals {} ", geo::ToString(request.key),
                                 request.error_step, static_cast<int>(request.coding), request.extensions.normals);
  body.append(2000, '.');
  return body;
}

config::DatasetConfig PublicDataset(std::string name) {
  config::DatasetConfig dataset;
  dataset.name = std::move(name);
  dataset.is_public = true;
  return dataset;
}

bool Eventually(const std::function<bool()>& done) {
  for (int i = 0; i < 2000; ++i) {
    if (done()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

}  // namespace terrace::server
