#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "server/handlers/handlers.h"
#include "tiler/store/baked_tiles.h"

namespace terrace::server {
namespace {

std::array<DatasetView, 1> Datasets() {
  std::array<DatasetView, 1> datasets;
  datasets[0].name = "a <b>";
  datasets[0].generation = 0x0a1b2c3d4e5f6789;
  datasets[0].attribution = "\xff not UTF-8";
  datasets[0].available.resize(3);
  datasets[0].bounds = {177, -20, -178, -15};
  datasets[0].heights = {-12.5, 1324};
  return datasets;
}

TEST(DatasetsHandler, ListsWhatAClientNeeds) {
  const auto list = nlohmann::json::parse(DatasetsJson(Datasets()));
  ASSERT_EQ(list["datasets"].size(), 1u);
  const auto& dataset = list["datasets"][0];
  EXPECT_EQ(dataset["name"], "a <b>");
  EXPECT_EQ(dataset["version"], "0a1b2c3d4e5f");
  EXPECT_EQ(dataset["bounds"], nlohmann::json::parse("[177.0, -20.0, -178.0, -15.0]"));
  EXPECT_EQ(dataset["sources"], 1);
  EXPECT_EQ(dataset["min_level"], 0);
  EXPECT_EQ(dataset["max_level"], 2);
  EXPECT_EQ(dataset["heights"]["min"], -12.5);
  EXPECT_EQ(dataset["heights"]["max"], 1324);
  const std::string base = "/a%20%3Cb%3E";
  EXPECT_EQ(dataset["urls"], (nlohmann::json{{"layer", base + "/layer.json"},
                                             {"tileset", base + "/tileset.json"},
                                             {"tiles", base + "/{z}/{x}/{y}.terrain?v=0a1b2c3d4e5f"},
                                             {"tiles_json", base + "/tiles.json"},
                                             {"heights", base + "/heights"},
                                             {"grid", base + "/grid"},
                                             {"sight", base + "/sight"},
                                             {"hillshade", base + "/hillshade/tiles.json"},
                                             {"slope", base + "/slope/tiles.json"},
                                             {"contours", base + "/contours/tiles.json"},
                                             {"mesh", base + "/mesh"}}));
}

TEST(DatasetsHandler, ListsNoTilesForMapsWhereWebMercatorEnds) {
  std::array<DatasetView, 1> datasets = Datasets();
  datasets[0].bounds = {-180, 86, 180, 90};
  const auto list = nlohmann::json::parse(DatasetsJson(datasets));
  const nlohmann::json& urls = list["datasets"][0]["urls"];
  EXPECT_TRUE(urls.contains("layer") && urls.contains("tileset"));
  for (const char* name : {"tiles_json", "hillshade", "slope", "contours"}) EXPECT_FALSE(urls.contains(name)) << name;
  datasets[0].bounds.south = 85;
  EXPECT_TRUE(nlohmann::json::parse(DatasetsJson(datasets))["datasets"][0]["urls"].contains("tiles_json"));
}

// An archive that only has formats.
class BakedFormats final : public tiler::BakedTiles {
 public:
  explicit BakedFormats(std::vector<tiler::TileFormat> formats) { extent_.formats = std::move(formats); }

  tiler::Coding coding() const override { return tiler::Coding::kGzip; }
  const tiler::BakedExtent& extent() const override { return extent_; }
  Result<std::optional<tiler::EncodedTile>> Find(const tiler::TileRequest&) const override { return std::nullopt; }
  Result<dem::HeightRange> RangeBound(const geo::TileKey&) const override { return dem::HeightRange{}; }
  bool HasKind(const tiler::TileRequest&) const override { return true; }
  bool is_outdated() const override { return false; }
  Error WhyAbsent(const tiler::TileRequest&) const override { return {}; }

 private:
  tiler::BakedExtent extent_;
};

TEST(DatasetsHandler, ListsWhatAnArchiveAloneServes) {
  using tiler::TileFormat;
  using Names = std::vector<std::string>;
  struct Case {
    std::vector<TileFormat> formats;
    Names names, links;
  };
  const std::vector<Case> cases = {
      {{TileFormat::kQuantizedMesh}, {"grid", "heights", "layer", "sight", "tiles"}, {"layer.json"}},
      {{TileFormat::kGlb}, {"tileset"}, {"tileset.json"}},
      {{TileFormat::kHeightPng, TileFormat::kGlb}, {"tiles_json", "tileset"}, {"tileset.json", "tiles.json"}}};
  for (const Case& one : cases) {
    std::array<DatasetView, 1> datasets = Datasets();
    datasets[0].only_archive = std::make_shared<const BakedFormats>(one.formats);
    const auto list = nlohmann::json::parse(DatasetsJson(datasets));
    Names names;
    for (const auto& [name, url] : list["datasets"][0]["urls"].items()) names.push_back(name);
    EXPECT_EQ(names, one.names);
    const std::string page = IndexHtml(datasets);
    for (const std::string file : {"layer.json", "tileset.json", "tiles.json"}) {
      const bool is_linked = page.find(">" + file + "</a>") != std::string::npos;
      EXPECT_EQ(is_linked, std::ranges::count(one.links, file) == 1) << file;
    }
  }
}

TEST(DatasetsHandler, TellsWhereTheDeepestTilesLie) {
  std::array<DatasetView, 1> datasets = Datasets();
  datasets[0].bounds = {-180, -90, 180, 90};
  datasets[0].available[2] = {{3, 1, 3, 2}};
  const auto list = nlohmann::json::parse(DatasetsJson(datasets));
  EXPECT_EQ(list["datasets"][0]["finest_bounds"], nlohmann::json::parse("[-45.0, -45.0, 0.0, 45.0]"));
}

TEST(DatasetsHandler, TellsWhoDoesNotSeeAllThatATokenMayShowMore) {
  EXPECT_FALSE(nlohmann::json::parse(DatasetsJson(Datasets())).contains("more_with_token"));
  for (const bool is_seen : {false, true}) {
    const auto list = nlohmann::json::parse(DatasetsJson(Datasets(), [&](const DatasetView&) { return is_seen; }));
    EXPECT_EQ(list["datasets"].size(), is_seen ? 1u : 0u);
    EXPECT_TRUE(list.value("more_with_token", false)) << "whether or not there is more";
  }
}

TEST(DatasetsHandler, EscapesNamesInThePlainPage) {
  const std::string page = IndexHtml(Datasets());
  EXPECT_NE(page.find("a &lt;b&gt;"), std::string::npos);
  EXPECT_EQ(page.find("<b>"), std::string::npos);
  for (const char* file : {"layer.json", "tileset.json", "tiles.json"}) {
    EXPECT_NE(page.find(std::string("<a href=\"/a%20%3Cb%3E/") + file), std::string::npos) << file;
  }
}

}  // namespace
}  // namespace terrace::server
