// Slopes, shades and contours against plain formulas of the standard library.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <random>
#include <set>

#include "engine/export/contour_lines.h"
#include "engine/geo/mercator_grid.h"
#include "tests/tiler/fetched_tile.h"
#include "tiler/map/contour_tile.h"
#include "tiler/map/map_heights.h"
#include "tiler/map/relief.h"

namespace terrace::tiler {
namespace {

constexpr float kNoHeight = std::numeric_limits<float>::quiet_NaN();
constexpr double kDegree = 3.14159265358979323846 / 180;

MapHeights HeightsOf(const MapWindow& window, const std::function<double(std::int64_t, std::int64_t)>& height) {
  MapHeights heights;
  heights.side = window.size + 2 * window.margin;
  for (int row = 0; row < heights.side; ++row) {
    for (int column = 0; column < heights.side; ++column) {
      heights.heights.push_back(static_cast<float>(height(window.nodes.column + column, window.first_row + row)));
    }
  }
  return heights;
}

// Metres on the WGS 84 ellipsoid of a degree at a latitude, by the textbook.
struct Metres {
  explicit Metres(double latitude) {
    constexpr double kA = 6378137, kE2 = 0.0066943799901413165;
    const double sine = std::sin(latitude * kDegree), w = std::sqrt(1 - kE2 * sine * sine);
    east = kA / w * std::cos(latitude * kDegree) * kDegree;
    north = kA * (1 - kE2) / (w * w * w) * kDegree;
  }
  double east, north;
};

TEST(Relief, SlopesOfPlanesAreTrueSlopes) {
  const geo::TileKey kKeys[] = {{12, 2000, 2047}, {12, 2100, 1100}, {12, 2100, 3000}, {15, 1, 8000}};  // to 66 degrees
  for (const geo::TileKey& key : kKeys) {
    const MapWindow window(key, 256, kReliefMargin);
    const geo::MercatorGrid grid{window.depth};
    const double middle = grid.Latitude(key.y * 256 + 128), west = grid.Longitude(key.x * 256);
    const Metres metres(middle);
    for (const auto& slope : {std::pair(0.5773502691896258, 0.0), std::pair(0.0, -1.0), std::pair(0.3, 0.4)}) {
      const double east = slope.first, north = slope.second;
      const MapHeights heights = HeightsOf(window, [&](std::int64_t column, std::int64_t row) {
        return east * (grid.Longitude(column) - west) * metres.east +
               north * (grid.Latitude(row) - middle) * metres.north;
      });
      const std::vector<Gradient> gradients = GradientsOf(heights, window);
      const Gradient& at = gradients[128 * 256 + 128];
      EXPECT_NEAR(at.east, east, 2e-3);
      EXPECT_NEAR(at.north, north, 2e-3);
      EXPECT_EQ(SlopeStep(at), std::lround(2 * std::atan(std::hypot(east, north)) / kDegree));
    }
  }
}

TEST(Relief, SlopesOfPlanesAreTheSameAtTheRimOfTheData) {
  const MapWindow window({12, 2100, 1100}, 256, kReliefMargin);
  const auto plane = [&](std::int64_t column, std::int64_t row) {
    return 7.0 * static_cast<double>(column - window.nodes.column) - 5.0 * static_cast<double>(row - window.first_row);
  };
  const std::vector<Gradient> whole = GradientsOf(HeightsOf(window, plane), window);
  const std::vector<Gradient> part = GradientsOf(HeightsOf(window,
                                                           [&](std::int64_t column, std::int64_t row) {
                                                             const std::int64_t x = column - window.nodes.column;
                                                             const std::int64_t y = row - window.first_row;
                                                             const bool is_known =
                                                                 x > 40 && x < 200 && y > 50 && y < 90;
                                                             return is_known ? plane(column, row) : kNoHeight;
                                                           }),
                                                 window);
  int known = 0;
  for (std::size_t i = 0; i < part.size(); ++i) {
    if (std::isnan(part[i].east)) continue;
    ++known;
    ASSERT_NEAR(part[i].east, whole[i].east, 1e-9) << i;
    ASSERT_NEAR(part[i].north, whole[i].north, 1e-9) << i;
  }
  EXPECT_EQ(known, 159 * 39);
}

TEST(Relief, StepsAreTheNearestHalfDegrees) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> angle(0, 90);
  for (int i = 0; i < 20'000; ++i) {
    const double degrees = angle(random), tangent = std::tan(degrees * kDegree);
    const int step = SlopeStep({tangent * 0.6, tangent * -0.8});
    ASSERT_LE(std::abs(step / 2.0 - degrees), 0.25 + 1e-6) << degrees;
  }
  EXPECT_EQ(SlopeStep({0, 0}), 0);
  EXPECT_EQ(SlopeStep({1e9, 0}), 180);
  EXPECT_EQ(SlopeStep({std::numeric_limits<double>::quiet_NaN(), 0}), kNoSlope);
}

TEST(Relief, ShadesAreTheCosineOfTheLight) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> slope(-3, 3);
  for (const auto& [azimuth, altitude, hundredths] :
       {std::tuple(315, 45, 100), std::tuple(0, 90, 100), std::tuple(100, 20, 250), std::tuple(270, 0, 1)}) {
    MapParameters parameters;
    parameters.azimuth_deg = static_cast<std::uint16_t>(azimuth);
    parameters.altitude_deg = static_cast<std::uint8_t>(altitude);
    parameters.z_factor_hundredths = static_cast<std::uint16_t>(hundredths);
    const Hillshade hillshade(parameters);
    const double z = hundredths / 100.0;
    for (int i = 0; i < 5000; ++i) {
      const Gradient at{slope(random), slope(random)};
      const double length = std::sqrt(1 + z * z * (at.east * at.east + at.north * at.north));
      const double cosine =
          (std::sin(altitude * kDegree) - std::cos(altitude * kDegree) * (std::sin(azimuth * kDegree) * z * at.east +
                                                                          std::cos(azimuth * kDegree) * z * at.north)) /
          length;
      ASSERT_NEAR(hillshade.Of(at), 1 + 254 * std::max(cosine, 0.0), 0.5 + 1e-6);
    }
  }
  EXPECT_EQ(Hillshade({}).Of({0, 0}), 181);
  EXPECT_EQ(Hillshade({}).Of({std::numeric_limits<double>::quiet_NaN(), 0}), 0);
  // The light comes from the north-west: a slope that falls to there is bright.
  EXPECT_GT(Hillshade({}).Of({0.5, -0.5}), 240);
  EXPECT_LT(Hillshade({}).Of({-0.5, 0.5}), 60);
}

TEST(Relief, PixelsWithoutHeightsHaveNone) {
  const MapWindow window({10, 500, 300}, 256, kReliefMargin);
  const MapHeights heights = HeightsOf(window, [&](std::int64_t column, std::int64_t row) -> double {
    const bool is_void = column == window.nodes.column + 10 && row == window.first_row + 10;
    return is_void ? kNoHeight : 100;
  });
  const std::vector<Gradient> gradients = GradientsOf(heights, window);
  for (int row = 0; row < 256; ++row) {
    for (int column = 0; column < 256; ++column) {
      const int step = SlopeStep(gradients[static_cast<std::size_t>(256 * row + column)]);
      ASSERT_EQ(step, row == 9 && column == 9 ? kNoSlope : 0) << row << " " << column;
    }
  }
}

TEST(Relief, ColoursAreOpaqueBetweenTheirStops) {
  EXPECT_EQ(SlopeColors()[0], (std::array<std::uint8_t, 3>{255, 255, 255}));
  EXPECT_EQ(SlopeColors()[60], (std::array<std::uint8_t, 3>{254, 178, 76}));
  EXPECT_EQ(SlopeColors()[70], (std::array<std::uint8_t, 3>{247, 119, 54})) << "half way";
  EXPECT_EQ(SlopeColors()[180], (std::array<std::uint8_t, 3>{0, 0, 0}));
}

using Piece = std::tuple<double, std::int64_t, std::int64_t, std::int64_t, std::int64_t>;

// The pieces of lines, on the whole map, that lie in the strip of units between two tiles and cross it.
std::set<Piece> PiecesAcross(const std::vector<proto::ContourFeature>& features, const geo::TileKey& key,
                             std::int64_t edge, bool is_vertical) {
  std::set<Piece> pieces;
  for (const proto::ContourFeature& feature : features) {
    for (const auto& line : feature.lines) {
      for (std::size_t i = 1; i < line.size(); ++i) {
        std::array<std::array<std::int64_t, 2>, 2> ends;
        for (const std::size_t k : {0, 1}) ends[k] = {line[i - k].x + 4096 * key.x, line[i - k].y + 4096 * key.y};
        if (ends[1] < ends[0]) std::swap(ends[0], ends[1]);
        const auto& a = ends[0];
        const auto& b = ends[1];
        const std::size_t axis = is_vertical ? 0 : 1;
        if (std::min(a[axis], b[axis]) < edge && std::max(a[axis], b[axis]) > edge) {
          pieces.emplace(feature.height_m, a[0], a[1], b[0], b[1]);
        }
      }
    }
  }
  return pieces;
}

// Whole heights, so that many equal a line's, and lines through the middle between two units.
double Rough(std::int64_t column, std::int64_t row) {
  const auto mixed = static_cast<std::uint64_t>(column * 7919 + row * 104729) * 0x9e3779b97f4a7c15;
  return 200 * std::sin(static_cast<double>(column) / 31) * std::cos(static_cast<double>(row) / 17) +
         static_cast<double>(mixed >> 59);
}

TEST(Contours, NeighboursHaveTheSamePiecesAtTheirEdge) {
  const geo::TileKey key{12, 1234, 1500};
  const auto trace = [](const geo::TileKey& of) {
    const MapWindow window(of, 256, kContourMargin);
    const auto rounded = [](std::int64_t column, std::int64_t row) { return std::round(Rough(column, row)); };
    auto features = ContoursOf(HeightsOf(window, rounded), 800, {});
    EXPECT_TRUE(features);
    return *std::move(features);
  };
  const auto here = trace(key);
  for (const bool is_vertical : {true, false}) {
    const geo::TileKey next{key.level, key.x + (is_vertical ? 1 : 0), key.y + (is_vertical ? 0 : 1)};
    const std::int64_t edge = 4096 * (is_vertical ? next.x : next.y);
    const std::int64_t first = 4096 * (is_vertical ? key.y : key.x), last = first + 4096;
    // Only those within the common edge: corners belong to other neighbours, too.
    const auto within = [&](std::set<Piece> pieces) {
      std::erase_if(pieces, [&](const Piece& piece) {
        const auto& [height, ax, ay, bx, by] = piece;
        const std::int64_t low = is_vertical ? std::min(ay, by) : std::min(ax, bx);
        const std::int64_t high = is_vertical ? std::max(ay, by) : std::max(ax, bx);
        return low < first || high > last;
      });
      return pieces;
    };
    const auto ours = within(PiecesAcross(here, key, edge, is_vertical));
    const auto theirs = within(PiecesAcross(trace(next), next, edge, is_vertical));
    EXPECT_GT(ours.size(), 100u);
    EXPECT_EQ(ours, theirs);
  }
}

TEST(Contours, VerticesLieBetweenTheirSamples) {
  const geo::TileKey key{12, 1234, 1500};
  const MapWindow window(key, 256, kContourMargin);
  const MapHeights heights = HeightsOf(window, Rough);
  const auto features = ContoursOf(heights, 1000, {});
  ASSERT_TRUE(features);
  std::size_t vertices = 0;
  for (const proto::ContourFeature& feature : *features) {
    EXPECT_EQ(std::fmod(feature.height_m, 10), 0);
    EXPECT_EQ(feature.is_index, std::fmod(feature.height_m, 50) == 0);
    for (const auto& line : feature.lines) {
      ASSERT_GE(line.size(), 2u);
      for (const proto::TilePoint& point : line) {
        ++vertices;
        const double x = point.x / 16.0 - 0.5 + kContourMargin, y = point.y / 16.0 - 0.5 + kContourMargin;
        ASSERT_TRUE(x >= 0 && y >= 0 && x <= heights.side - 1 && y <= heights.side - 1)
            << x << " " << y << " " << feature.height_m;
        float low = 1e9f, high = -1e9f;
        // Within half a unit of the position.
        for (const double dx : {-0.04, 0.04}) {
          for (const double dy : {-0.04, 0.04}) {
            for (const int i : {0, 1}) {
              for (const int j : {0, 1}) {
                const float height = heights.At(std::min(static_cast<int>(x + dx) + i, heights.side - 1),
                                                std::min(static_cast<int>(y + dy) + j, heights.side - 1));
                low = std::min(low, height);
                high = std::max(high, height);
              }
            }
          }
        }
        ASSERT_GE(feature.height_m, low);
        ASSERT_LE(feature.height_m, high);
      }
    }
  }
  EXPECT_GT(vertices, 1000u);
}

// Vector Tile Specification 2.1, 4.3.4.2 and 4.3.4.3: a line has at least two points, and no piece without length.
TEST(Contours, HaveLength) {
  const MapWindow window({12, 1234, 1500}, 256, kContourMargin);
  // Peaks that reach a line by a little: rings within a unit or two.
  const MapHeights heights = HeightsOf(window, [](std::int64_t column, std::int64_t row) {
    const bool is_peak = column % 7 == 0 && row % 7 == 0;
    return is_peak ? 100 + static_cast<double>((column * 31 + row * 17) % 40) / 10 : 80;
  });
  const auto features = ContoursOf(heights, 10000, {});
  ASSERT_TRUE(features);
  std::size_t lines = 0;
  for (const proto::ContourFeature& feature : *features) {
    for (const auto& line : feature.lines) {
      ++lines;
      ASSERT_GE(line.size(), 2u);
      for (std::size_t i = 1; i < line.size(); ++i)
        ASSERT_FALSE(line[i] == line[i - 1]) << line[i].x << ' ' << line[i].y;
    }
  }
  EXPECT_GT(lines, 100u) << "larger rings are kept";
}

// The lines with all points, from GDAL, against the simplified ones.
TEST(Contours, PointsThatAreLeftOutLieNearTheLine) {
  const MapWindow window({12, 1234, 1500}, 256, kContourMargin);
  const MapHeights heights = HeightsOf(window, [](std::int64_t column, std::int64_t row) {
    return 200 * std::sin(static_cast<double>(column) / 23) * std::cos(static_cast<double>(row) / 37);
  });
  const auto features = ContoursOf(heights, 5000, {});
  const auto all = dem::TraceContours(heights.heights, heights.side, heights.side, 50, {});
  ASSERT_TRUE(features && all);
  std::map<double, std::vector<std::array<proto::TilePoint, 2>>> pieces;
  std::size_t kept = 0, given = 0;
  for (const proto::ContourFeature& feature : *features) {
    for (const auto& line : feature.lines) {
      kept += line.size();
      for (std::size_t i = 1; i < line.size(); ++i) pieces[feature.height_m].push_back({line[i - 1], line[i]});
    }
  }
  for (const dem::ContourLine& line : *all) {
    for (const dem::ContourPoint& point : line.points) {
      const double x = (point.x - kContourMargin + 0.5) * 16, y = (point.y - kContourMargin + 0.5) * 16;
      if (x < 0 || y < 0 || x > 4096 || y > 4096) continue;
      ++given;
      double nearest = 1e9;
      for (const auto& [a, b] : pieces[line.height]) {
        const double dx = b.x - a.x, dy = b.y - a.y;
        const double share = std::clamp(((x - a.x) * dx + (y - a.y) * dy) / (dx * dx + dy * dy), 0.0, 1.0);
        nearest = std::min(nearest, std::hypot(x - a.x - share * dx, y - a.y - share * dy));
      }
      ASSERT_LE(nearest, 2 + 0.75) << line.height << " at " << x << " " << y;  // and the rounding to units
    }
  }
  EXPECT_LT(kept, given / 2);
}

TEST(Contours, DoNotTouchPixelsWithoutHeights) {
  const MapWindow window({12, 1234, 1500}, 256, kContourMargin);
  MapHeights heights = HeightsOf(window, Rough);
  for (int row = 100; row < 140; ++row) {
    for (int column = 100; column < 140; ++column) {
      heights.heights[static_cast<std::size_t>(row * heights.side + column)] = kNoHeight;
    }
  }
  const auto features = ContoursOf(heights, 1000, {});
  ASSERT_TRUE(features);
  ASSERT_GT(features->size(), 10u);
  const auto inside = [](std::int32_t units) {
    const double node = units / 16.0 - 0.5 + kContourMargin;
    return node > 99.5 + 0.04 && node < 139.5 - 0.04;  // GDAL continues lines half way to such a pixel
  };
  for (const proto::ContourFeature& feature : *features) {
    for (const auto& line : feature.lines) {
      for (const proto::TilePoint& point : line) EXPECT_FALSE(inside(point.x) && inside(point.y));
    }
  }
}

TEST(Contours, OfTooManyPointsAreThinnedToIndexLines) {
  const MapWindow window({12, 1234, 1500}, 256, kContourMargin);
  const auto cliffs = [](std::int64_t column, std::int64_t row) { return (column + row) % 2 == 0 ? 0.0 : 60.0; };
  const MapHeights heights = HeightsOf(window, cliffs);
  ASSERT_GT(dem::CountContourCrossings(heights.heights, heights.side, heights.side, 1), dem::kMaxContourCrossings);
  const auto features = ContoursOf(heights, 100, {});
  ASSERT_TRUE(features);
  ASSERT_FALSE(features->empty());
  for (const proto::ContourFeature& feature : *features) {
    EXPECT_TRUE(feature.is_index);
    EXPECT_EQ(std::fmod(feature.height_m, 5), 0) << feature.height_m;
  }
}

TEST(Contours, StopWhenNobodyWaits) {
  const MapWindow window({12, 1234, 1500}, 256, kContourMargin);
  std::stop_source stop;
  stop.request_stop();
  const auto features = ContoursOf(HeightsOf(window, Rough), 1000, stop.get_token());
  ASSERT_FALSE(features);
  EXPECT_EQ(features.error().code, ErrorCode::kCancelled);
}

TEST(MapHeights, MarginsContinueAroundTheEarthAndEndAtTheSquare) {
  const dem::ElevationModel& model = *SamplePipeline().datasets()[0].model;  // the whole Earth
  const MapWindow window({1, 0, 0}, 256, 3);
  const auto heights = ReadMapHeights(model, window, dem::HeightDatum::kEllipsoid, {});
  ASSERT_TRUE(heights) << heights.error().message;
  const auto west = model.ReadMercator(1, {509, 0, 3, 259}), own = model.ReadMercator(1, {0, 0, 259, 259});
  ASSERT_TRUE(west);
  ASSERT_TRUE(own);
  for (int row = 0; row < 259; ++row) {
    for (int i = 0; i < 3; ++i) EXPECT_EQ(heights->At(i, row + 3), (*west)[static_cast<std::size_t>(3 * row + i)]);
    for (int i = 0; i < 259; ++i) {
      ASSERT_EQ(heights->At(i + 3, row + 3), (*own)[static_cast<std::size_t>(259 * row + i)]) << row << " " << i;
    }
  }
  for (int row = 0; row < 3; ++row) {
    for (int i = 0; i < heights->side; ++i) EXPECT_TRUE(std::isnan(heights->At(i, row))) << "north of the square";
  }
}

TEST(MapTiles, AreTheSameAgainAndDifferByTheirParameters) {
  const TilePipeline again(SamplePipeline().datasets());
  std::set<std::string> bytes;
  std::size_t count = 0;
  for (const TileFormat format : {TileFormat::kHillshade, TileFormat::kSlope, TileFormat::kContours}) {
    TileRequest request;
    request.dataset = 1;
    request.format = format;
    request.key = {11, 544, 803};
    request.map.interval_cm = format == TileFormat::kContours ? 2000 : 0;
    std::vector<TileRequest> requests = {request};
    if (format == TileFormat::kHillshade) {
      requests.resize(5, request);
      requests[1].map.azimuth_deg = 0;
      requests[2].map.altitude_deg = 30;
      requests[3].map.z_factor_hundredths = 200;
      requests[4].map.picture = proto::PictureFormat::kWebp;
    } else if (format == TileFormat::kSlope) {
      requests.push_back(request);
      requests[1].map.slope_style = SlopeStyle::kDegrees;
    } else {
      requests.push_back(request);
      requests[1].map.interval_cm = 1000;
    }
    for (const TileRequest& of : requests) {
      const auto tile = SamplePipeline().Build(of, {}), same = again.Build(of, {});
      ASSERT_TRUE(tile) << tile.error().message;
      ASSERT_TRUE(same);
      EXPECT_EQ(tile->bytes, same->bytes);
      bytes.insert(tile->bytes);
      ++count;
    }
  }
  EXPECT_EQ(bytes.size(), count);
}

TEST(MapTiles, OfImageryNeedAnImage) {
  for (const TileFormat format : {TileFormat::kImagery, TileFormat::kGeodeticImagery}) {
    TileRequest request;
    request.format = format;
    request.map.picture = proto::PictureFormat::kWebp;
    const auto tile = SamplePipeline().Build(request, {});
    ASSERT_FALSE(tile);
    EXPECT_EQ(tile.error().code, ErrorCode::kNotFound);
  }
}

}  // namespace
}  // namespace terrace::tiler
