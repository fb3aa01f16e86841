#include "config/options/options.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/common/cache_place.h"
#include "config/common/working_directory.h"
#include "tests/config/errors.h"

namespace terrace::config {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

std::vector<ConfigError> Set(std::string_view key, const std::string& text, Config& config) {
  std::vector<ConfigError> errors;
  SetServerOption(key, text, "/start", config, errors);
  return errors;
}

TEST(ServerOptions, TakeTheirDefaultsAsFlags) {
  for (const OptionInfo& option : ServerOptionInfos()) {
    if (!option.has_flag || option.default_value.empty()) continue;
    std::string text = option.default_value;
    if (text.front() == '"') text = text.substr(1, text.size() - 2);
    Config config;
    EXPECT_THAT(Set(option.key, text, config), IsEmpty()) << option.key;
    EXPECT_EQ(config, Config{}) << option.key;
  }
}

TEST(ServerOptions, NameEveryFlagAfterItsKey) {
  for (const OptionInfo& option : ServerOptionInfos()) {
    EXPECT_EQ(option.Flag().find('_'), std::string::npos);
    EXPECT_EQ(option.has_flag, option.key != "datasets" && option.key != "tokens");
    EXPECT_FALSE(option.help.empty());
  }
  EXPECT_EQ(ServerOptionInfos().front().Flag(), "--listen");
}

TEST(SetServerOption, TakesListsWithCommas) {
  Config config;
  EXPECT_THAT(Set("cors_origins", "https://a.example,http://b.example:81", config), IsEmpty());
  EXPECT_THAT(config.cors_origins, ElementsAre("https://a.example", "http://b.example:81"));
  EXPECT_THAT(Set("cors_origins", "", config), IsEmpty());
  EXPECT_THAT(config.cors_origins, IsEmpty());
  EXPECT_THAT(Set("trusted_proxies", "[::1],10.0.0.0/8", config),
              ElementsAre(IsError("--trusted-proxies", "must be an address")));
  for (const char* range : {"::ffff:10.0.0.0/104", "::ffff:10.0.0.0/8"}) {
    EXPECT_THAT(Set("trusted_proxies", range, config),
                ElementsAre(IsError("--trusted-proxies", "must be written as an IPv4 range")));
  }
  EXPECT_THAT(Set("trusted_proxies", "::1,10.0.0.0/8", config), IsEmpty());
  EXPECT_THAT(Set("tls", "/a.pem,/b.key", config), IsEmpty());
  EXPECT_EQ(config.tls, (TlsConfig{"/a.pem", "/b.key"}));
  EXPECT_THAT(Set("tls", "/a.pem", config), ElementsAre(IsError("--tls", "two PEM files")));
}

TEST(SetServerOption, WritesOriginsAsBrowsersSendThem) {
  Config config;
  EXPECT_THAT(Set("cors_origins",
                  "https://Maps.EXAMPLE:443,http://B.example:80,https://c.example:80,http://[::AB]:443,http://d:8080,*",
                  config),
              IsEmpty());
  EXPECT_THAT(config.cors_origins, ElementsAre("https://maps.example", "http://b.example", "https://c.example:80",
                                               "http://[::ab]:443", "http://d:8080", "*"));
}

TEST(SetServerOption, ReportsTheFlag) {
  Config config;
  EXPECT_THAT(Set("cache_bytes", "lots", config), ElementsAre(IsError("--cache-bytes", "such as \"512MB\"")));
  EXPECT_THAT(Set("io_threads", "", config), ElementsAre(IsError("--io-threads", "from 1 to 64")));
  EXPECT_THAT(Set("io_threads", "2x", config), ElementsAre(IsError("--io-threads", "from 1 to 64")));
  EXPECT_THAT(Set("request_deadline_s", "nan", config),
              ElementsAre(IsError("--request-deadline-s", "a number of seconds")));
  EXPECT_THAT(Set("viewer", "", config), ElementsAre(IsError("--viewer", "the folder of a viewer")));
  EXPECT_EQ(config, Config{});
}

TEST(SetServerOption, ReadsNumbersSwitchesAndText) {
  Config config;
  EXPECT_THAT(Set("queue_length", "1e3", config), IsEmpty());
  EXPECT_THAT(Set("idle_timeout_s", "0.25", config), IsEmpty());
  EXPECT_THAT(Set("viewer", "false", config), IsEmpty());
  EXPECT_THAT(Set("cache_control", "123", config), IsEmpty());  // text that looks like a number stays text
  EXPECT_EQ(config.queue_length, 1000u);
  EXPECT_EQ(config.idle_timeout, std::chrono::milliseconds(250));
  EXPECT_FALSE(config.viewer.enabled);
  EXPECT_EQ(config.cache_control, "123");
}

TEST(SetServerOption, ResolvesPathsAgainstTheDirectoryItIsGiven) {
  Config config;
  EXPECT_THAT(Set("viewer", "page", config), IsEmpty());
  EXPECT_THAT(Set("cache_dir", "cache", config), IsEmpty());
  EXPECT_THAT(Set("disk_cache", "../tiles", config), IsEmpty());
  EXPECT_THAT(Set("access_log_file", "a.log", config), IsEmpty());
  EXPECT_THAT(Set("tls", "a.pem,/b.key", config), IsEmpty());
  EXPECT_THAT(Set("data_roots", "/dems,more", config), IsEmpty());
  EXPECT_THAT(Set("allowed_prefixes", "/vsis3/bucket/", config), IsEmpty());
  EXPECT_EQ(config.viewer.directory, "/start/page");
  EXPECT_EQ(config.cache_dir, "/start/cache");
  EXPECT_EQ(config.disk_cache.directory, "/tiles");
  EXPECT_EQ(config.access_log_file, "/start/a.log");
  EXPECT_EQ(config.tls, (TlsConfig{"/start/a.pem", "/b.key"}));
  EXPECT_THAT(config.data_roots, ElementsAre("/dems", "/start/more"));
  DatasetConfig dataset;
  std::vector<ConfigError> errors;
  SetDatasetOption("water", "sea.tif", "/start", dataset, errors);
  SetDatasetOption("imagery", "photo.tif", "/start", dataset, errors);
  SetDatasetOption("vertical", "grid.gtx", "/start", dataset, errors);
  EXPECT_THAT(errors, IsEmpty());
  EXPECT_EQ(dataset.water.mask, "/start/sea.tif");
  EXPECT_EQ(dataset.imagery.image, "/start/photo.tif");
  EXPECT_EQ(dataset.vertical, "/start/grid.gtx");
}

TEST(SetServerOption, KnowsTheWordsOfCacheDir) {
  Config config;
  EXPECT_EQ(config.cache_dir, kDefaultCacheDir);
  for (const char* off : {"none", ""}) {
    EXPECT_THAT(Set("cache_dir", "cache", config), IsEmpty());
    EXPECT_THAT(Set("cache_dir", off, config), IsEmpty());
    EXPECT_EQ(config.cache_dir, "");
  }
  EXPECT_THAT(Set("cache_dir", "./none", config), IsEmpty());
  EXPECT_EQ(config.cache_dir, "/start/none");
  EXPECT_THAT(Set("cache_dir", "default", config), IsEmpty());
  EXPECT_EQ(config.cache_dir, kDefaultCacheDir);
  EXPECT_THAT(Set("cache_dir_bytes", "1GiB", config), IsEmpty());
  EXPECT_EQ(config.cache_dir_bytes, std::size_t{1} << 30);
}

// Sets variables of the environment for the lifetime of the object.
class Environment {
 public:
  Environment() {
    for (const char* name : kNames) {
      const char* const value = std::getenv(name);
      before_.emplace_back(name, value != nullptr ? std::optional<std::string>(value) : std::nullopt);
      ::unsetenv(name);
    }
  }
  ~Environment() {
    for (const auto& [name, value] : before_) value ? ::setenv(name, value->c_str(), 1) : ::unsetenv(name);
  }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  static constexpr const char* kNames[] = {"CACHE_DIRECTORY", "XDG_CACHE_HOME", "HOME"};
  std::vector<std::pair<const char*, std::optional<std::string>>> before_;
};

TEST(CacheDirFromEnvironment, IsTheFirstThatTheEnvironmentNames) {
  const Environment environment;
  EXPECT_EQ(CacheDirFromEnvironment(), "");
  ::setenv("HOME", "/users/me", 1);
  EXPECT_EQ(CacheDirFromEnvironment(), "/users/me/.cache/terrace");
  ::setenv("XDG_CACHE_HOME", "/caches", 1);
  EXPECT_EQ(CacheDirFromEnvironment(), "/caches/terrace");
  ::setenv("XDG_CACHE_HOME", "relative", 1);
  EXPECT_EQ(CacheDirFromEnvironment(), "/users/me/.cache/terrace") << "as the XDG specification says";
  ::setenv("CACHE_DIRECTORY", "/var/cache/terrace", 1);
  EXPECT_EQ(CacheDirFromEnvironment(), "/var/cache/terrace");
  ::setenv("CACHE_DIRECTORY", "/var/cache/terrace:/var/cache/other", 1);
  EXPECT_EQ(CacheDirFromEnvironment(), "/var/cache/terrace");
  ::setenv("CACHE_DIRECTORY", "", 1);
  EXPECT_EQ(CacheDirFromEnvironment(), "/users/me/.cache/terrace");
}

TEST(FromWorkingDirectory, TakesOffWhatAPathGoesUp) {
  EXPECT_EQ(FromWorkingDirectory("/a/b", "c/d"), "/a/b/c/d");
  EXPECT_EQ(FromWorkingDirectory("/a/b", ".././../c/"), "/c/");
  EXPECT_EQ(FromWorkingDirectory("/a/b", ".."), "/a");
  EXPECT_EQ(FromWorkingDirectory("/a/b", "../../../.."), "/");
  EXPECT_EQ(FromWorkingDirectory("/a/b", "link/../c"), "/a/b/link/../c") << "a link may lead elsewhere";
  EXPECT_EQ(FromWorkingDirectory("/a/b", "/c"), "/c");
  EXPECT_EQ(FromWorkingDirectory("", "../c"), "../c");
}

TEST(SetServerOption, RefusesRelativePathsWhereThereIsNoDirectory) {
  Config config;
  std::vector<ConfigError> errors;
  SetServerOption("cache_dir", "/cache", "", config, errors);
  SetServerOption("io_threads", "3", "", config, errors);
  EXPECT_THAT(errors, IsEmpty());
  SetServerOption("cache_dir", "cache", "", config, errors);
  EXPECT_THAT(errors, ElementsAre(IsError("--cache-dir", "cannot be named; give the path in full")));
}

TEST(SetDatasetOption, SetsOneDataset) {
  DatasetConfig dataset;
  std::vector<ConfigError> errors;
  SetDatasetOption("floor", "-3.5", "/start", dataset, errors);
  SetDatasetOption("name", "2024", "/start", dataset, errors);
  EXPECT_THAT(errors, IsEmpty());
  EXPECT_EQ(dataset.floor, -3.5);
  EXPECT_EQ(dataset.name, "2024");
  SetDatasetOption("error_fraction", "2", "/start", dataset, errors);
  SetDatasetOption("name", "livez", "/start", dataset, errors);
  EXPECT_THAT(errors, ElementsAre(IsError("--error-fraction", "a number from 0.05 to 1"),
                                  IsError("--name", "is a URL of the server itself")));
}

TEST(SetDatasetOption, TellsASeaLevelFromAMask) {
  DatasetConfig dataset;
  std::vector<ConfigError> errors;
  SetDatasetOption("water", "-2.5", "/start", dataset, errors);
  EXPECT_EQ(dataset.water, (WaterConfig{"", -2.5}));
  SetDatasetOption("water", "/data/water.tif", "/start", dataset, errors);
  EXPECT_EQ(dataset.water, (WaterConfig{"/data/water.tif", std::nullopt}));
  EXPECT_THAT(errors, IsEmpty());
  SetDatasetOption("water", "1e9", "/start", dataset, errors);
  SetDatasetOption("water", "", "/start", dataset, errors);
  EXPECT_THAT(errors, ElementsAre(IsError("--water", "a number from -20000 to 20000"),
                                  IsError("--water", "the path of a raster")));
}

TEST(SetDatasetOption, TakesTheImageOfImageryAlone) {
  DatasetConfig dataset;
  std::vector<ConfigError> errors;
  SetDatasetOption("imagery", "/data/photo.tif", "/start", dataset, errors);
  EXPECT_THAT(errors, IsEmpty());
  ImageryConfig expected;
  expected.image = "/data/photo.tif";
  EXPECT_EQ(dataset.imagery, expected);
  SetDatasetOption("imagery", "", "/start", dataset, errors);
  EXPECT_THAT(errors, ElementsAre(IsError("--imagery", "the path of an image")));
}

TEST(ChangedServerOptions, NamesWhatDiffers) {
  Config a, b;
  EXPECT_TRUE(ChangedServerOptions(a, b).empty());
  b.cache_bytes = 7;
  b.datasets.emplace_back().name = "new";
  EXPECT_EQ(ChangedServerOptions(a, b), (std::vector<std::string>{"datasets", "cache_bytes"}));
}

// Options that need another one: with it, without it, and with their default.
TEST(FindUnusedOptions, NamesWhatAnotherOptionLacks) {
  struct Case {
    const char *key, *value, *other, *enough, *too_little;
  };
  for (const auto& [key, value, other, enough, too_little] :
       {Case{"admin_socket_mode", "0660", "admin_listen", "unix:/run/admin.sock", "127.0.0.1:9090"},
        Case{"cache_dir_bytes", "5MB", "cache_dir", "/cache", "none"},
        Case{"request_burst", "3", "requests_per_second", "1.5", "0"},
        Case{"forwarded_header", "forwarded", "trusted_proxies", "127.0.0.1", ""},
        Case{"access_log_file", "/a.log", "access_log", "json", "log"},
        Case{"access_log_file", "/a.log", "access_log", "combined", "off"}}) {
    Config config;
    EXPECT_THAT(Set(other, too_little, config), IsEmpty());
    EXPECT_THAT(FindUnusedOptions(config), IsEmpty()) << key << " has its default";
    EXPECT_THAT(Set(key, value, config), IsEmpty());
    EXPECT_THAT(FindUnusedOptions(config), ElementsAre(IsError(key, other)));
    EXPECT_THAT(Set(other, enough, config), IsEmpty());
    EXPECT_THAT(FindUnusedOptions(config), IsEmpty()) << key;
  }
  EXPECT_THAT(FindUnusedOptions({}), IsEmpty());
}

TEST(FindUnusedOptions, KnowsTheKeysOfASharedCache) {
  Config config;
  config.shared_cache = {.url = "redis://cache:6379/0", .ca_file = "/ca.pem"};
  EXPECT_THAT(FindUnusedOptions(config), ElementsAre(IsError("shared_cache.ca_file", "rediss://")));
  config.shared_cache.url = "rediss://cache:6379/0";
  EXPECT_THAT(FindUnusedOptions(config), IsEmpty());
}

TEST(NeedsRestart, KnowsWhatIsTakenOverWhileServing) {
  EXPECT_FALSE(NeedsRestart("datasets") || NeedsRestart("cache_bytes") || NeedsRestart("log_level"));
  EXPECT_TRUE(NeedsRestart("listen") && NeedsRestart("tokens") && NeedsRestart("io_threads"));
}

}  // namespace
}  // namespace terrace::config
