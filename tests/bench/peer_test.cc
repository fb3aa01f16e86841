#include "tests/bench/peer.h"

#include <gtest/gtest.h>

#include <array>

#include "tests/bench/race.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::bench {
namespace {

TEST(Peer, GoalsAreWordsOfTheCommandLine) {
  EXPECT_EQ(GoalArgument({5}), "error=5");
  EXPECT_EQ(GoalArgument({0.25}), "error=0.25");
  EXPECT_EQ(GoalArgument({0, 1542}), "points=1542");
}

TEST(Peer, LinesOfSecondsAndPointsCountAndNoOthers) {
  const auto runs =
      ParsePeerOutput("reading\nseconds 0.5 points 7\nseconds 0.25 points 7 error 2\nseconds x points 1\n");
  ASSERT_TRUE(runs.has_value());
  EXPECT_EQ(runs->seconds, (std::vector<double>{0.5, 0.25}));
  EXPECT_EQ(runs->points, 7u);
  EXPECT_FALSE(ParsePeerOutput("").has_value());
  EXPECT_FALSE(ParsePeerOutput("seconds 0 points 7\n").has_value());  // a clock without progress measures nothing
}

TEST(Peer, GetsTheHeightsAndTheGoal) {
  const tin::HeightField field = tin::NoiseField(7, 5, 1);
  FieldFiles files;
  const auto path = files.PathOf(field);
  ASSERT_TRUE(path.has_value());
  EXPECT_EQ(std::filesystem::file_size(*path), 7u * 5u * sizeof(float));
  EXPECT_EQ(files.PathOf(field).value(), *path);
  // The script prints its arguments: width + height as seconds, the goal's digits as points.
  const auto runs =
      RunPeer("sh -c 'test -f \"$0\" && echo seconds $(($1 + $2)) points ${3#points=}'", *path, field, {0, 1542});
  ASSERT_TRUE(runs.has_value());
  EXPECT_EQ(runs->seconds, std::vector<double>{12});
  EXPECT_EQ(runs->points, 1542u);
}

TEST(Peer, ThatFailsIsReported) {
  const tin::HeightField field = tin::NoiseField(2, 2, 1);
  FieldFiles files;
  const auto runs = RunPeer("false", *files.PathOf(field), field, {1});
  ASSERT_FALSE(runs.has_value());
  EXPECT_EQ(runs.error().code, ErrorCode::kUnavailable);
}

TEST(Race, SumsMinimaAndMediansOverFields) {
  const tin::HeightField a = tin::NoiseField(2, 2, 1), b = tin::NoiseField(3, 2, 1);
  std::vector<double> clock{3, 1, 2, 10, 30, 20};
  std::size_t turn = 0;
  const Contender contender = [&](const tin::HeightField& field, const tin::GreedyGoal&, Runs& runs) {
    runs.seconds.push_back(clock[turn++]);
    runs.points = static_cast<std::size_t>(field.width());
  };
  const std::array<const tin::HeightField*, 2> fields{&a, &b};
  const std::vector<Score> scores = Race(fields, {1}, 3, std::array{contender});
  EXPECT_EQ(scores[0].min_seconds, 11);
  EXPECT_EQ(scores[0].median_seconds, 22);
  EXPECT_EQ(scores[0].points, 5u);
}

}  // namespace
}  // namespace terrace::bench
