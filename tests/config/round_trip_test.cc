#include <gtest/gtest.h>

#include <string>

#include "config/file/parse.h"
#include "config/options/option_table.h"

namespace terrace::config {
namespace {

DatasetConfig Dataset(const std::string& name) {
  DatasetConfig dataset;
  dataset.name = name;
  dataset.sources = {"/data/" + name + ".tif"};
  return dataset;
}

void ExpectComesBack(const Config& config) {
  const std::string text = ToJson(config);
  const ConfigResult again = ParseConfig(text, "/elsewhere");
  ASSERT_TRUE(again) << again.error().front().path << ": " << again.error().front().message;
  EXPECT_EQ(*again, config) << text;
  EXPECT_EQ(ToJson(*again), text);
}

TEST(ToJson, ComesBackAsTheDefaults) { ExpectComesBack(Config{}); }

TEST(ToJson, ComesBackWithEveryOptionSet) {
  Config config;
  config.listen = {"2001:db8::1", 0};
  config.admin_listen = ListenAddress{{}, 0, "/run/terrace/admin.sock"};
  config.admin_socket_mode = 0660;
  DatasetConfig dataset = Dataset("a");
  dataset.sources = {"/data/a.tif"};
  dataset.vertical = "egm96";
  dataset.nodata = {false, {-9999, 0.5}};
  dataset.attribution = "© \"ét\\é\"";
  dataset.error_fraction = 0.1;
  dataset.edits = {"/data/runway.geojson", "/data/roads.geojson"};
  dataset.finest_error = 1e-3;
  dataset.floor = -0.3;
  dataset.max_void_gap = 7;
  dataset.voids = dem::HoleFill::kFloor;
  dataset.feather = 12.5;
  dataset.criterion = tin::Criterion::kDataDependent;
  dataset.compact = true;
  dataset.sources.front().vertical = "EPSG:5703";
  dataset.sources.front().nodata = NodataConfig{false, {}};
  dataset.water.sea_level = -1.25;
  dataset.metadata_availability = 7;
  dataset.is_public = true;
  config.datasets = {dataset, Dataset("b")};
  config.datasets[1].water.mask = "/data/water.tif";
  config.datasets[1].imagery = {"/data/photo.tif", "© \"é\"", proto::TextureFormat::kWebp, 64, 99};
  config.viewer = {true, "/srv/page"};
  config.cache_control = "no-cache";
  config.io_threads = 64;
  config.worker_threads = 5;
  config.queue_length = 1;
  config.cache_bytes = std::size_t{1} << 40;
  config.refinement_cache_bytes = 12'345'678;
  config.disk_cache = {"/srv/cache", std::size_t{1} << 40, 0};
  config.shared_cache = {"rediss://terrace@redis.example:6380/1",
                         "/run/password",
                         "/etc/ca.pem",
                         7,
                         0.5,
                         0,
                         std::chrono::milliseconds(1'500),
                         250};
  config.gdal_cache_bytes = 1'000'000;
  config.data_roots = {"/data", "/srv/dems"};
  config.allowed_prefixes = {"/vsis3/bucket/"};
  config.allowed_drivers = {"GTiff", "VRT"};
  config.max_open_sources = 0;
  config.max_connections = 7;
  config.max_connections_per_client = 3;
  config.transfer_bytes = 5;
  config.requests_per_second = 0.25;
  config.request_burst = 7;
  config.tokens = {{"a", std::string(64, '0'), {"a", "b"}, 2.5}, {"b", std::string(64, 'f'), {}, 0}};
  config.cors_origins = {"https://maps.example"};
  config.trusted_proxies = {"10.0.0.0/8", "::1"};
  config.forwarded_header = ForwardedHeader::kForwarded;
  config.tls = {"/etc/server.pem", "/etc/server.key"};
  config.min_read_rate = 0;
  config.max_locations = 1'000'000;
  config.max_mesh_samples = 4;
  config.request_deadline = std::chrono::milliseconds(100);
  config.header_timeout = std::chrono::milliseconds(1'234);
  config.idle_timeout = std::chrono::milliseconds(3'600'000);
  config.write_timeout = std::chrono::milliseconds(999);
  config.drain_delay = std::chrono::milliseconds(1'500);
  config.drain_timeout = std::chrono::milliseconds(0);
  config.log_level = LogLevel::kOff;
  config.log_format = LogFormat::kJson;
  config.access_log = AccessLogForm::kCombined;
  config.access_log_file = "/var/log/terrace/access.log";
  config.watch = false;
  ExpectComesBack(config);
}

TEST(ToJson, NamesEveryOption) {
  Config config;
  config.admin_listen = ListenAddress{"127.0.0.1", 9090};
  config.access_log_file = "/var/log/terrace/access.log";
  DatasetConfig dataset = Dataset("a");
  dataset.edits = {"/data/runway.geojson"};
  dataset.finest_error = 1;
  dataset.floor = 0;
  dataset.water.sea_level = 0;
  dataset.imagery.image = "/data/photo.tif";
  dataset.baked = "/data/baked";
  config.disk_cache.directory = "/srv/cache";
  config.shared_cache.url = "redis://redis.example";
  config.datasets = {dataset};
  config.tls = {"/etc/server.pem", "/etc/server.key"};
  config.data_roots = {"/data"};
  config.allowed_prefixes = {"/vsis3/bucket/"};
  config.allowed_drivers = {"GTiff"};
  const Json json = Json::parse(ToJson(config));
  EXPECT_EQ(json.size(), ServerOptionTable().size());
  EXPECT_EQ(json.at("datasets").at(0).size(), DatasetOptionTable().size());
  EXPECT_EQ(ToJson(config).back(), '\n');
}

TEST(ToJson, KeepsEveryMillisecondOfATime) {
  for (int ms = 100; ms < 3'600'000; ms += 7'919) {
    Config config;
    config.idle_timeout = std::chrono::milliseconds(ms);
    const ConfigResult again = ParseConfig(ToJson(config), "/");
    ASSERT_TRUE(again && again->idle_timeout == config.idle_timeout) << ms;
  }
}

}  // namespace
}  // namespace terrace::config
