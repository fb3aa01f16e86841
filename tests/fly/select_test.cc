// Flights over a quadtree whose tiles arrive late, in random order: what must hold in every frame.
#include "fly/select/select.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "fly/select/coverage.h"
#include "fly/tree/tile_tree.h"

namespace terrace::fly {
namespace {

// A layer with all tiles of the first `levels` levels.
std::unique_ptr<TileTree> FullTree(int levels) {
  std::string ranges;
  for (int level = 0; level < levels; ++level) {
    ranges += (level > 0 ? "," : "") + std::string(R"([{"startX":0,"startY":0,"endX":)") +
              std::to_string(geo::TileColumns(level) - 1) + R"(,"endY":)" + std::to_string(geo::TileRows(level) - 1) +
              "}]";
  }
  return *MakeLayerTree(R"({"tiles":["{z}/{x}/{y}.terrain"],"available":[)" + ranges + "]}");
}

class Client {
 public:
  Client(std::unique_ptr<TileTree> tree, SelectOptions options, unsigned seed)
      : tree_(std::move(tree)), options_(options), random_(seed) {}

  // A frame; then each of the tiles that are loading arrives with `chance`.
  void Frame(const Pose& pose, double chance) {
    view_ = std::make_unique<View>(pose, Lens{});
    SelectTiles(
        options_, *view_, [this](Tile& tile) { tree_->AddChildren(tile); }, ++frame_, tree_->root(), selection_);
    for (const LoadTask& task : selection_.loads) {
      if (loading_.size() < 20) Start(*task.tile);
    }
    std::shuffle(loading_.begin(), loading_.end(), random_);
    std::erase_if(loading_, [&](Tile* tile) {
      if (std::uniform_real_distribution(0.0, 1.0)(random_) >= chance) return false;
      tile->in_flight = false;
      tile->state = LoadState::kReady;
      TileContent content;
      content.heights = HeightSpan{0, 1500};
      tree_->TakeContent(*tile, content);
      return true;
    });
  }

  void LoadAll(const Pose& pose) {
    for (int i = 0; i < 400; ++i) {
      Frame(pose, 1);
      if (selection_.loads.empty() && loading_.empty()) return;
    }
    ADD_FAILURE() << "never loaded";
  }

  Coverage Measure() const { return MeasureCoverage(*view_, frame_, tree_->root()); }
  const Selection& selection() const { return selection_; }
  Tile& root() { return tree_->root(); }

 private:
  void Start(Tile& tile) {
    if (!tile.NeedsLoad()) return;
    if (tile.content != Content::kMesh) {
      tile.state = LoadState::kReady;
      return;
    }
    tile.in_flight = true;
    loading_.push_back(&tile);
  }

  std::unique_ptr<TileTree> tree_;
  SelectOptions options_;
  std::mt19937 random_;
  std::unique_ptr<View> view_;
  Selection selection_;
  std::uint64_t frame_ = 0;
  std::vector<Tile*> loading_;
};

void ExpectNoTileAboveAnother(const Selection& selection) {
  std::set<const Tile*> drawn;
  for (const DrawnTile& one : selection.drawn) EXPECT_TRUE(drawn.insert(one.tile).second);
  for (const Tile* tile : drawn) {
    for (const Tile* above = tile->parent; above != nullptr; above = above->parent) EXPECT_FALSE(drawn.contains(above));
  }
}

Pose Over(double lon, double height_m, double heading) { return {{lon, 46, height_m}, heading, -25}; }

TEST(Select, CoversTheScreenOnceWhileTilesArriveInAnyOrder) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    Client client(FullTree(13), {}, seed);
    for (int i = 0; i < 260; ++i) {
      client.Frame(Over(7 + i * 0.004, 8000, i * 1.5), 0.15);
      const Coverage coverage = client.Measure();
      EXPECT_EQ(coverage.uncovered, 0) << "frame " << i;
      EXPECT_EQ(coverage.doubled, 0) << "frame " << i;
      ExpectNoTileAboveAnother(client.selection());
    }
  }
}

TEST(Select, RefinesUntilTheErrorIsSmall) {
  Client client(FullTree(14), {}, 1);
  client.LoadAll(Over(7, 6000, 20));
  EXPECT_TRUE(client.selection().IsRefined());
  EXPECT_EQ(client.Measure().holes(), 0);
  EXPECT_GT(client.Measure().rays, 200);
  std::size_t refinable = 0;
  for (const DrawnTile& one : client.selection().drawn) {
    if (one.tile->children.empty()) continue;
    ++refinable;
    EXPECT_LT(one.error_px, 16);
  }
  EXPECT_GT(refinable, 20U);
}

TEST(Select, DrawsAnAncestorUntilAllOfItsDescendantsAreThere) {
  Client client(FullTree(13), {}, 1);
  client.LoadAll(Over(7, 3e5, 0));
  const std::size_t before = client.selection().drawn.size();
  // Nearer, and nothing arrives: what is loaded stays on the screen, without a hole.
  for (int i = 0; i < 5; ++i) client.Frame(Over(7, 30000, 0), 0);
  EXPECT_TRUE(client.selection().any_kicked);
  EXPECT_FALSE(client.selection().IsRefined());
  EXPECT_GT(before, 0U);
  EXPECT_EQ(client.Measure().missing, 0);
  EXPECT_FALSE(client.selection().loads.empty() && client.selection().pending == 0);
}

TEST(Select, KeepsDetailUntilACoarserTileIsLoaded) {
  Client client(FullTree(13), {}, 1);
  const Pose near = Over(7, 6000, 0), far = Over(7, 60000, 0);
  client.LoadAll(near);
  for (int i = 0; i < 3; ++i) client.Frame(near, 1);
  // Ancestors of what is drawn vanish from memory; the view moves away.
  for (const DrawnTile& one : client.selection().drawn) {
    for (Tile* above = one.tile->parent; above != nullptr && above->content == Content::kMesh; above = above->parent) {
      above->state = LoadState::kUnloaded;
    }
  }
  client.Frame(far, 0);
  EXPECT_EQ(client.Measure().missing, 0);
  const std::vector<LoadTask>& loads = client.selection().loads;
  ASSERT_FALSE(loads.empty());
  EXPECT_EQ(loads.front().group, LoadGroup::kUrgent);
}

TEST(Select, ForbidsHolesWhenTheCameraTurns) {
  SelectOptions strict;
  strict.forbid_holes = true;
  int holes_without = 0;
  for (const SelectOptions& options : {strict, SelectOptions{}}) {
    Client client(FullTree(13), options, 7);
    client.LoadAll(Over(7, 5000, 0));
    for (int i = 0; i < 120; ++i) {
      client.Frame(Over(7 + i * 0.002, 5000, i * 3), 0.1);
      const int missing = client.Measure().missing;
      if (options.forbid_holes) {
        EXPECT_EQ(missing, 0) << "frame " << i;
      } else {
        holes_without += missing > 0 ? 1 : 0;
      }
    }
  }
  EXPECT_GT(holes_without, 0);  // what cesium-native accepts by default
}

TEST(Select, LoadsThePictureBeforeWhatIsPreloaded) {
  Client client(FullTree(13), {}, 1);
  for (int i = 0; i < 8; ++i) client.Frame(Over(7, 9000, 0), 0.5);
  const std::vector<LoadTask>& loads = client.selection().loads;
  ASSERT_GT(loads.size(), 10U);
  EXPECT_TRUE(std::is_sorted(loads.begin(), loads.end(), [](const LoadTask& a, const LoadTask& b) {
    return a.group != b.group ? a.group > b.group : a.priority < b.priority;
  }));
}

TEST(Select, AFailedTileDoesNotHoldUpItsSiblings) {
  Client client(FullTree(4), {}, 1);
  client.Frame(Over(7, 3e5, 0), 0);
  client.root().children[1]->in_flight = false;
  client.root().children[1]->state = LoadState::kFailed;
  client.LoadAll(Over(7, 3e5, 0));
  EXPECT_GT(client.selection().drawn.size(), 4U);
}

TEST(Select, ATileThatHasFailedIsMissingAndNotWaitedFor) {
  Client client(FullTree(13), {}, 1);
  const Pose pose = Over(7, 9000, 0);
  client.LoadAll(pose);
  ASSERT_TRUE(client.selection().IsRefined());
  client.selection().drawn.back().tile->state = LoadState::kFailed;
  client.Frame(pose, 1);
  EXPECT_FALSE(client.selection().IsRefined());
  EXPECT_TRUE(client.selection().IsSettled());
}

// As where the sign of a longitude is wrong: the root there is not available.
TEST(Select, APictureWithoutTerrainIsNeitherCompleteNorWaitedFor) {
  const char* const west =
      R"({"tiles":["{z}/{x}/{y}.terrain"],"available":[[{"startX":0,"startY":0,"endX":0,"endY":0}]]})";
  Client client(*MakeLayerTree(west), {}, 1);
  client.LoadAll(Over(90, 6000, 0));
  ASSERT_FALSE(client.selection().drawn.empty());
  EXPECT_FALSE(client.selection().IsRefined());
  EXPECT_TRUE(client.selection().IsSettled());
  EXPECT_EQ(client.Measure().rays, 0);
  client.LoadAll(Over(-90, 6000, 0));
  EXPECT_TRUE(client.selection().IsRefined());
  EXPECT_GT(client.Measure().rays, 0);
}

TEST(Coverage, FindsHolesInMountainsThatCoarseTilesDoNotHave) {
  Client client(FullTree(13), {}, 1);
  client.LoadAll(Over(7, 9000, 0));
  for (const DrawnTile& one : client.selection().drawn) {
    one.tile->volume = Region(RectangleOf(*one.tile->key), 2000, 3000);  // those above have 0 to 1500 m
    one.tile->state = LoadState::kFailed;
  }
  EXPECT_GT(client.Measure().rays, 100);
  EXPECT_EQ(client.Measure().missing, client.Measure().rays);
}

}  // namespace
}  // namespace terrace::fly
