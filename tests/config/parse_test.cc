#include "config/file/parse.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/config/errors.h"

namespace terrace::config {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::Ge;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Le;
using testing::SizeIs;

TEST(ParseConfig, GivesDefaultsForAnEmptyObject) {
  const ConfigResult config = ParseConfig("{}", "/nowhere");
  ASSERT_TRUE(config);
  EXPECT_EQ(*config, Config{});
}

TEST(ParseConfig, SetsWhatTheTextSaysAndNothingElse) {
  const ConfigResult config = ParseConfig(R"({
    "listen": "[::1]:9000",
    "datasets": [{"name": "maui", "sources": ["maui.tif"], "error_fraction": 0.25, "floor": -12.5, "max_void_gap": 0,
                  "voids": "floor", "criterion": "data-dependent", "compact": true,
                  "glb_compression": "quantized", "draco_speed": 3, "draco_normal_bits": 10}],
    "viewer": false, "cache_control": "no-cache", "io_threads": 1, "worker_threads": 3, "queue_length": 10,
    "cache_bytes": "1GiB", "refinement_cache_bytes": "10 MiB", "max_connections": 64, "max_locations": 50, "max_mesh_samples": 5000, "request_deadline_s": 1.5, "header_timeout_s": 2,
    "idle_timeout_s": 3, "write_timeout_s": 4, "drain_timeout_s": 0, "log_level": "debug", "log_format": "json"})",
                                          "/data");
  ASSERT_TRUE(config);
  Config expected;
  expected.listen = {"::1", 9000};
  DatasetConfig maui;
  maui.name = "maui";
  maui.sources = {"/data/maui.tif"};
  maui.error_fraction = 0.25;
  maui.floor = -12.5;
  maui.max_void_gap = 0;
  maui.voids = dem::HoleFill::kFloor;
  maui.criterion = tin::Criterion::kDataDependent;
  maui.compact = true;
  maui.glb_compression = proto::GlbCompression::kQuantized;
  maui.draco_speed = 3;
  maui.draco_normal_bits = 10;
  expected.datasets = {maui};
  expected.viewer = {false, {}};
  expected.cache_control = "no-cache";
  expected.io_threads = 1;
  expected.worker_threads = 3;
  expected.queue_length = 10;
  expected.cache_bytes = std::size_t{1} << 30;
  expected.refinement_cache_bytes = std::size_t{10} << 20;
  expected.max_connections = 64;
  expected.max_locations = 50;
  expected.max_mesh_samples = 5000;
  expected.request_deadline = std::chrono::milliseconds(1500);
  expected.header_timeout = std::chrono::milliseconds(2000);
  expected.idle_timeout = std::chrono::milliseconds(3000);
  expected.write_timeout = std::chrono::milliseconds(4000);
  expected.drain_timeout = std::chrono::milliseconds(0);
  expected.log_level = LogLevel::kDebug;
  expected.log_format = LogFormat::kJson;
  EXPECT_EQ(*config, expected);
}

TEST(ParseConfig, ReportsAllErrorsTogetherInTheOrderOfTheText) {
  EXPECT_THAT(
      ErrorsOf(R"({
    "io_threads": 0,
    "datasets": [{"sources": []}, {"name": "a b", "sources": ["x.tif", 7]}, 3],
    "lissten": "0.0.0.0:80",
    "log_level": "loud"})"),
      ElementsAre(IsError("/io_threads", "a whole number from 1 to 64"),
                  IsError("/datasets/0/sources", "a list of paths"), IsError("/datasets/0", "\"name\" is missing"),
                  IsError("/datasets/1/name", "1 to 64 letters, digits"),
                  IsError("/datasets/1/sources/1", "a path, a glob or a folder"),
                  IsError("/datasets/2", "an object with keys such as \"name\""),
                  IsError("/lissten", "did you mean \"listen\"?"),
                  IsError("/log_level", "\"debug\" or \"info\" or \"warn\" or \"error\" or \"off\"")));
}

TEST(ParseConfig, SuggestsTheNearestKeyAndListsAllWhenNoneIsNear) {
  EXPECT_THAT(ErrorsOf(R"({"cache-bytes": 1})"), ElementsAre(IsError("/cache-bytes", "did you mean \"cache_bytes\"?")));
  EXPECT_THAT(ErrorsOf(R"({"colour": 1})"),
              ElementsAre(IsError("", "key 1 of this object is unknown; known are listen, datasets, viewer")));
  EXPECT_THAT(ErrorsOf(R"({"datasets": [{"name": "a", "source": ["a.tif"]}]})"),
              ElementsAre(IsError("/datasets/0/source", "did you mean \"sources\"?"),
                          IsError("/datasets/0", "\"sources\" is missing")));
}

TEST(ParseConfig, KnowsWhatOthersCallAKey) {
  for (const std::string key : {"port", "host", "address", "bind"}) {
    EXPECT_THAT(ErrorsOf("{\"" + key + "\": 8080}"), ElementsAre(IsError("/" + key, "did you mean \"listen\"?")));
  }
  EXPECT_THAT(ErrorsOf(R"({"datasets": [{"name": "a", "files": ["a.tif"]}]})"),
              ElementsAre(IsError("/datasets/0/files", "did you mean \"sources\"?"),
                          IsError("/datasets/0", "\"sources\" is missing")));
  EXPECT_THAT(ErrorsOf(R"({"cache": 1})"),
              ElementsAre(IsError("/cache", "did you mean \"cache_bytes\" or \"disk_cache\"?")));
}

TEST(ParseConfig, RefusesPathsWithACharacterThatEndsThem) {
  EXPECT_THAT(ErrorsOf(R"({"viewer": "a\u0000b", "disk_cache": {"directory": "a\u0000b"},
                           "datasets": [{"name": "a", "sources": ["a\u0000b"]}]})"),
              ElementsAre(IsError("/viewer", "u0000"), IsError("/disk_cache/directory", "u0000"),
                          IsError("/datasets/0/sources/0", "u0000")));
}

TEST(ParseConfig, SaysWhereAMisplacedKeyBelongs) {
  EXPECT_THAT(ErrorsOf(R"({"floor": 0, "error": 5, "vertical": "egm96", "tile_bytes": 0, "certificate": "a.pem"})"),
              ElementsAre(IsError("/floor", "is no key of this object; \"floor\" belongs in an object of \"datasets\""),
                          IsError("/error",
                                  "is no key of this object; did you mean \"error_fraction\" or \"finest_error\" in "
                                  "an object of \"datasets\"?"),
                          IsError("/vertical",
                                  "\"vertical\" belongs in an object of \"datasets\" or in an object of a dataset's "
                                  "\"sources\""),
                          IsError("/tile_bytes", "\"tile_bytes\" belongs in \"disk_cache\""),
                          IsError("/certificate", "\"certificate\" belongs in \"tls\"")));
  EXPECT_THAT(ErrorsOf(R"({"datasets": [{"name": "a", "sources": [{"path": "a.tif", "feather": 5}], "Listen": "a:1",
                           "sea_level": 0, "texture": "webp"}]})"),
              ElementsAre(IsError("/datasets/0/sources/0/feather", "belongs in an object of \"datasets\""),
                          IsError("/datasets/0/Listen", "\"listen\" belongs at the top of the file"),
                          IsError("/datasets/0/sea_level", "\"sea_level\" belongs in a dataset's \"water\""),
                          IsError("/datasets/0/texture", "\"texture\" belongs in a dataset's \"imagery\"")));
}

TEST(ParseConfig, ShowsTheFormOfLayers) {
  EXPECT_THAT(ErrorsOf(R"({"datasets": [{"name": "a", "sources": ["a.tif"], "imagery": "a.tif", "water": true}]})"),
              ElementsAre(IsError("/datasets/0/imagery", "must be {\"image\": \"photo.tif\"}"),
                          IsError("/datasets/0/water", "or {\"sea_level\": 0}, exactly one of them")));
}

TEST(ParseConfig, EscapesKeysInPathsAsJsonPointersDo) {
  EXPECT_THAT(ErrorsOf(R"({"cache/bytes": 1, "log~level": 1})"),
              ElementsAre(IsError("/cache~1bytes", "did you mean"), IsError("/log~0level", "did you mean")));
}

TEST(ParseConfig, RefusesTwoDatasetsOfOneName) {
  EXPECT_THAT(ErrorsOf(R"({"datasets": [{"name": "a", "sources": ["a.tif"]}, {"name": "b", "sources": ["b.tif"]},
                                        {"name": "a", "sources": ["c.tif"]}]})"),
              ElementsAre(IsError("/datasets/2/name", "is the name of /datasets/0 too")));
}

TEST(ParseConfig, RefusesAVerticalDatumItCannotConvert) {
  EXPECT_THAT(ErrorsOf(R"({"datasets": [{"name": "a", "sources": ["a.tif"], "vertical": "egm69"}]})"),
              ElementsAre(IsError("/datasets/0/vertical", "the path of a grid (.gtx, .tif)")));
  EXPECT_THAT(ErrorsOf(R"({"datasets": [{"name": "a", "sources": [{"vertical": "egm96", "nodata": "none"}]}]})"),
              ElementsAre(IsError("/datasets/0/sources/0/nodata", "\"auto\", \"declared\", a number"),
                          IsError("/datasets/0/sources/0", "\"path\" is missing")));
}

TEST(ParseConfig, KeepsTheOrderOfSources) {
  const ConfigResult config =
      ParseConfig(R"({"datasets": [{"name": "a", "sources": ["b.tif", "/x/a.tif"]}]})", "/data");
  ASSERT_TRUE(config);
  const std::vector<SourceConfig> expected = {"/data/b.tif", "/x/a.tif"};
  EXPECT_EQ(config->datasets.at(0).sources, expected);
}

TEST(ParseConfig, KeepsLineBreaksOutOfHeaders) {
  EXPECT_THAT(ErrorsOf(R"({"cache_control": "no-cache\r\nSet-Cookie: a=b"})"),
              ElementsAre(IsError("/cache_control", "a Cache-Control header in ASCII")));
}

TEST(ParseConfig, IgnoresTheSchemaKeyAtTheTopOnly) {
  EXPECT_THAT(ErrorsOf(R"({"$schema": "config.schema.json"})"), IsEmpty());
  EXPECT_THAT(ErrorsOf(R"({"datasets": [{"$schema": "x", "name": "a", "sources": ["a.tif"]}]})"),
              ElementsAre(IsError("/datasets/0", "key 1 of this object is unknown")));
}

TEST(ParseConfig, RefusesATextThatIsNotAnObject) {
  EXPECT_THAT(ErrorsOf("[]"), ElementsAre(IsError("", "must be an object with keys such as \"listen\"")));
}

TEST(LoadConfig, TakesPathsRelativeToTheFile) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("load_config_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "terrace.json") << R"({"datasets": [{"name": "a", "sources": ["a.tif"]}], "viewer": "page"})";
  const ConfigResult config = LoadConfig(folder / "terrace.json");
  ASSERT_TRUE(config);
  EXPECT_EQ(config->datasets.at(0).sources.at(0).path, (folder / "a.tif").string());
  EXPECT_EQ(config->viewer.directory, folder / "page");
  std::filesystem::remove_all(folder);
}

TEST(LoadConfig, SaysWhyAFileCannotBeRead) {
  const ConfigResult missing = LoadConfig("/nowhere/terrace.json");
  ASSERT_FALSE(missing);
  EXPECT_THAT(missing.error(), ElementsAre(IsError("", "cannot be read: No such file or directory")));
  const ConfigResult folder = LoadConfig(testing::TempDir());
  ASSERT_FALSE(folder);
  EXPECT_THAT(folder.error(), ElementsAre(IsError("", "is a folder; name a JSON file in it")));
}

TEST(LoadConfig, RefusesAFileThatIsTooLarge) {
  const std::filesystem::path file =
      std::filesystem::path(testing::TempDir()) / ("large_config_" + std::to_string(::getpid()) + ".json");
  std::ofstream(file) << "{}" << std::string(kMaxConfigBytes - 2, '\n');
  EXPECT_TRUE(LoadConfig(file));
  std::filesystem::resize_file(file, kMaxConfigBytes + 1);  // a sparse file
  const ConfigResult larger = LoadConfig(file);
  ASSERT_FALSE(larger);
  EXPECT_THAT(larger.error(), ElementsAre(IsError("", file.string() + " is larger than the 16 MiB")));
  std::filesystem::remove(file);
  const ConfigResult endless = LoadConfig("/dev/zero");
  ASSERT_FALSE(endless);
  EXPECT_THAT(endless.error(), ElementsAre(IsError("", "/dev/zero is larger than the 16 MiB")));
}

// A file of another kind may have millions of errors.
TEST(ParseConfig, TellsABoundedNumberOfErrors) {
  std::string datasets = "{\"datasets\": [{}", keys = "{\"a\": 0", names = "{\"datasets\": [";
  for (int i = 0; i < 10'000; ++i) {
    datasets += ",{}";
    keys += ",\"a\": 0";
    names += std::string(i > 0 ? "," : "") + "{\"name\": \"a\", \"sources\": [\"x\"]}";
  }
  EXPECT_THAT(ErrorsOf(names + "]}"), SizeIs(100));
  EXPECT_THAT(ErrorsOf(datasets + "]}"), SizeIs(AllOf(Ge(100u), Le(101u))));
  EXPECT_THAT(ErrorsOf(keys + "}"), SizeIs(AllOf(Ge(100u), Le(101u))));
}

}  // namespace
}  // namespace terrace::config
