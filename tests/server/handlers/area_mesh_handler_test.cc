#include <gtest/gtest.h>

#include "server/handlers/handlers.h"
#include "server/query/mesh_query.h"

namespace terrace::server {
namespace {

TEST(AreaRequest, ReadsTheBox) {
  const auto area = ParseAreaRequest("bbox=8.2,46,8.8,47&error=5&v=1");
  ASSERT_TRUE(area) << area.error().message;
  EXPECT_EQ(area->west, 8.2);
  EXPECT_EQ(area->south, 46);
  EXPECT_EQ(area->east, 8.8);
  EXPECT_EQ(area->north, 47);
  EXPECT_EQ(area->error_m, 5);
  EXPECT_EQ(area->format, proto::MeshFileFormat::kGlb);
  EXPECT_EQ(area->coordinates, tiler::AreaCoordinates::kEnu);
  EXPECT_EQ(ParseAreaRequest("bbox=0,0,1,1&error=5&format=ply&coordinates=ecef")->format, proto::MeshFileFormat::kPly);
  EXPECT_EQ(ParseAreaRequest("bbox=0,0,1,1&error=5&coordinates=geographic")->coordinates,
            tiler::AreaCoordinates::kGeographic);
}

TEST(AreaRequest, WestAboveEastCrossesTheAntimeridian) {
  const auto area = ParseAreaRequest("bbox=170,-10,-170,10&error=5");
  ASSERT_TRUE(area);
  EXPECT_EQ(area->west, 170);
  EXPECT_EQ(area->east, 190);
}

TEST(AreaRequest, SaysWhatIsWrong) {
  const struct {
    const char* query;
    const char* says;
  } cases[] = {
      {"", "are needed"},
      {"bbox=0,0,1,1", "are needed"},
      {"error=5", "are needed"},
      {"bbox=0,1,1,0&error=5", "south must be below north"},
      {"bbox=0,1,1,1&error=5", "south must be below north"},
      {"bbox=5,0,5,1&error=5", "empty"},
      {"bbox=180,0,-180,1&error=5", "empty"},
      {"bbox=0,0,1,90.1&error=5", "north must be a number from -90 to 90"},
      {"bbox=0,-91,1,1&error=5", "south must be"},
      {"bbox=-181,0,1,1&error=5", "west must be"},
      {"bbox=0,0,181,1&error=5", "east must be"},
      {"bbox=nan,0,1,1&error=5", "west must be"},
      {"bbox=0,0,inf,1&error=5", "east must be"},
      {"bbox=0,0,1&error=5", "west,south,east,north"},
      {"bbox=0,0,1,1,1&error=5", "north must be"},
      {"bbox=&error=5", "west,south,east,north"},
      {"bbox=0,0,1,1&error=0", "error must be"},
      {"bbox=0,0,1,1&error=-5", "error must be"},
      {"bbox=0,0,1,1&error=nan", "error must be"},
      {"bbox=0,0,1,1&error=5&error=5", "more than once"},
      {"bbox=0,0,1,1&error=5&format=stl", "format must be"},
      {"bbox=0,0,1,1&error=5&coordinates=utm", "coordinates must be"},
      {"bbox=0,0,1,1&error=5&size=3", "unknown parameter"},
  };
  for (const auto& c : cases) {
    const auto area = ParseAreaRequest(c.query);
    ASSERT_FALSE(area) << c.query;
    EXPECT_EQ(area.error().code, ErrorCode::kInvalidArgument);
    EXPECT_NE(area.error().message.find(c.says), std::string::npos) << c.query << ": " << area.error().message;
  }
}

}  // namespace
}  // namespace terrace::server
