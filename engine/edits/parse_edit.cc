#include "engine/edits/parse_edit.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <span>
#include <string_view>
#include <utility>

#include "engine/edits/edit_polygon.h"
#include "engine/edits/edit_properties.h"
#include "engine/edits/edit_shape.h"
#include "engine/geo/ellipsoid.h"

namespace terrace::dem {
namespace {

using nlohmann::json;

constexpr double kMaxHeight_m = 20'000;
constexpr double kMaxWidth_m = 100'000;
constexpr double kFurthestLatitude = 89.9;  // closer to a pole, metres to the east lose their meaning

struct Vertex {
  GeoPosition at;
  std::optional<double> height;
};
using Ring = std::vector<Vertex>;

// For messages about features whose geometry is not read.
std::optional<GeoPosition> FirstPosition(const json& feature) {
  if (!feature.contains("geometry") || !feature["geometry"].is_object()) return std::nullopt;
  const auto found = feature["geometry"].find("coordinates");
  const json* at = found == feature["geometry"].end() ? nullptr : &*found;
  while (at != nullptr && at->is_array() && !at->empty() && at->front().is_array()) at = &at->front();
  if (at == nullptr || !at->is_array() || at->size() < 2 || !(*at)[0].is_number() || !(*at)[1].is_number()) {
    return std::nullopt;
  }
  return GeoPosition{(*at)[0], (*at)[1]};
}

// Whether these properties of a feature without `terrain` are its members. Other files have an "op" of their own.
bool LooksLikeEdit(const json& properties) {
  const auto op = properties.find("op");
  if (op == properties.end() || std::ranges::find(kEditOpNames, *op) == kEditOpNames.end()) return false;
  return std::ranges::any_of(kEditKeys, [&](std::string_view key) { return key != "op" && properties.contains(key); });
}

class Parser {
 public:
  Parser(const std::string& file, std::size_t feature, std::vector<EditFault>& faults)
      : file_(file), feature_(feature), faults_(faults), before_(faults.size()) {}

  std::optional<Edit> Parse(const json& json);

 private:
  bool has_failed() const { return faults_.size() > before_; }
  void Fail(std::string message, std::optional<GeoPosition> place = {}) {
    faults_.push_back({file_, feature_, place ? place : first_, std::move(message)});
  }
  void CheckEditKeys(const json& terrain);
  std::optional<double> Number(const json& terrain, const char* key, double low, double high);
  void ReadGeometry(const json& geometry);
  void AddRing(const json& points);
  void CheckPolygons(std::span<const std::size_t> first_rings);
  void ReadOptions(const json& terrain);
  void ReadDatum(const json& terrain);
  void ReadHeights(const json& terrain);
  void FitSlope(std::vector<std::optional<double>> heights);
  std::vector<std::optional<double>> HeightsOf(const json& terrain, const char* key, const Ring& ring);
  void PlaceOnPlane();

  const std::string& file_;
  const std::size_t feature_;
  std::vector<EditFault>& faults_;
  const std::size_t before_;
  std::optional<GeoPosition> first_;
  std::vector<Ring> rings_;
  Edit edit_;
};

std::optional<Edit> Parser::Parse(const json& feature) {
  if (!feature.contains("properties") || !feature["properties"].is_object()) return std::nullopt;
  const json& properties = feature["properties"];
  const auto terrain = properties.find("terrain");
  if (terrain == properties.end()) {
    if (LooksLikeEdit(properties)) {
      first_ = FirstPosition(feature);
      Fail(fmt::format("\"op\" belongs into \"terrain\": \"properties\": {{\"terrain\": {{\"op\": {}, ...}}}}",
                       properties["op"].dump()));
    }
    return std::nullopt;
  }
  edit_.file = file_;
  edit_.feature = feature_;
  first_ = FirstPosition(feature);
  if (!terrain->is_object() || !terrain->contains("op") || !(*terrain)["op"].is_string()) {
    Fail(fmt::format(
        "properties.terrain must be an object{} with an \"op\", such as {{\"op\": \"flatten\", \"height\": 250}}",
        terrain->is_string() ? ", not text," : ""));
    return std::nullopt;
  }
  const std::string op = (*terrain)["op"];
  const auto known = std::ranges::find(kEditOpNames, std::string_view(op));
  if (known == kEditOpNames.end()) {
    const std::string nearest = NearestOf(op, kEditOpNames);
    Fail(fmt::format("unknown op \"{}\"{}", op,
                     nearest.empty() ? fmt::format("; ops are {}", fmt::join(kEditOpNames, ", ")) : nearest));
    return std::nullopt;
  }
  edit_.op = static_cast<EditOp>(known - kEditOpNames.begin());
  if (feature.contains("geometry")) ReadGeometry(feature["geometry"]);
  if (!has_failed() && rings_.empty()) Fail("has no geometry");
  CheckEditKeys(*terrain);
  if (has_failed()) return std::nullopt;
  ReadOptions(*terrain);
  ReadDatum(*terrain);
  PlaceOnPlane();
  ReadHeights(*terrain);
  if (has_failed()) return std::nullopt;
  Complete(edit_);
  if (edit_.reach.min_y < -kFurthestLatitude || edit_.reach.max_y > kFurthestLatitude) {
    Fail("reaches a pole; edits end at 89.9 degrees");
  }
  if (has_failed()) return std::nullopt;
  return std::move(edit_);
}

void Parser::CheckEditKeys(const json& terrain) {
  const auto taken = [&] {
    std::vector<std::string_view> keys;
    std::ranges::copy_if(kEditKeys, std::back_inserter(keys),
                         [&](std::string_view own) { return HasProperty(edit_.op, own); });
    return fmt::format("it has {}", fmt::join(keys, ", "));
  };
  for (const auto& [key, value] : terrain.items()) {
    // ReadDatum checks "vertical": its message says why an op does not take it.
    if (std::ranges::find(kEditKeys, key) == kEditKeys.end()) {
      const std::string nearest = NearestOf(key, kEditKeys);
      Fail(fmt::format("unknown property \"{}\" of terrain{}", key, nearest.empty() ? "; " + taken() : nearest));
    } else if (key != "vertical" && !HasProperty(edit_.op, key)) {
      Fail(fmt::format("{} has no \"{}\"; {}", NameOf(edit_.op), key, taken()));
    }
  }
}

std::optional<double> Parser::Number(const json& terrain, const char* key, double low, double high) {
  const auto found = terrain.find(key);
  if (found == terrain.end()) return std::nullopt;
  if (found->is_number()) {
    const double value = *found;
    if (value >= low && value <= high) return value;
  }
  Fail(fmt::format("{} is {}; it must be a number from {} to {}", key, found->dump(), low, high));
  return std::nullopt;
}

void Parser::AddRing(const json& points) {
  Ring ring;
  if (!points.is_array()) return Fail("its coordinates are no positions");
  for (const json& point : points) {
    if (!point.is_array() || point.size() < 2 || !point[0].is_number() || !point[1].is_number()) {
      return Fail(fmt::format("{} is no position: [longitude, latitude]", point.dump().substr(0, 60)));
    }
    const GeoPosition at{point[0], point[1]};
    if (std::abs(at.latitude) > 90) {
      const bool is_swapped = std::abs(at.longitude) <= 90 && std::abs(at.latitude) <= 180;
      return Fail(fmt::format("latitude {} is beyond 90{}", at.latitude,
                              is_swapped ? "; are the axes swapped? GeoJSON has [longitude, latitude]" : ""),
                  at);
    }
    if (std::abs(at.longitude) > 180) {
      return Fail(
          fmt::format("longitude {} is beyond 180: divide what crosses the antimeridian into two parts of one feature",
                      at.longitude),
          at);
    }
    if (!ring.empty() && std::abs(ring.back().at.longitude - at.longitude) > 180) {
      return Fail(
          "crosses the antimeridian; divide it into two parts of one MultiPolygon or MultiLineString (RFC 7946, "
          "section 3.1.9)",
          at);
    }
    std::optional<double> height;
    if (point.size() > 2 && point[2].is_number()) {
      height = point[2].get<double>();
    } else if (point.size() > 2 && !point[2].is_null()) {
      return Fail(fmt::format("{} is no height: a number, or null for none", point[2].dump()), at);
    }
    ring.push_back({at, height});
  }
  if (!edit_.is_area) {
    if (ring.size() < 2) return Fail("a line needs two positions or more");
  } else {
    if (ring.size() < 4) return Fail("a ring needs four positions or more, the last equal to the first");
    const GeoPosition last = ring.back().at;
    if (last.longitude != ring.front().at.longitude || last.latitude != ring.front().at.latitude) {
      return Fail("the ring is open: its last position must be its first", last);
    }
    ring.pop_back();
  }
  rings_.push_back(std::move(ring));
}

std::vector<GeoPosition> PositionsOf(const Ring& ring) {
  std::vector<GeoPosition> positions;
  for (const Vertex& vertex : ring) positions.push_back(vertex.at);
  return positions;
}

// `first_rings`: of the parts, each an outer ring and its holes.
void Parser::CheckPolygons(std::span<const std::size_t> first_rings) {
  if (has_failed()) return;
  std::vector<RingsOfPart> parts;
  for (std::size_t r = 0; r < rings_.size(); ++r) {
    if (parts.size() < first_rings.size() && first_rings[parts.size()] == r) parts.emplace_back();
    parts.back().push_back(PositionsOf(rings_[r]));
  }
  for (const RingsOfPart& part : parts) {
    if (auto fault = FaultOf(part)) return Fail("the polygon is not valid: " + fault->what, fault->at);
  }
  if (const auto place = FirstOverlap(parts)) {
    Fail("parts of the polygon overlap; merge them, or divide them into features", *place);
  }
}

void Parser::ReadGeometry(const json& geometry) {
  if (!geometry.is_object() || !geometry.contains("type") || !geometry["type"].is_string() ||
      !geometry.contains("coordinates") || !geometry["coordinates"].is_array()) {
    return Fail("has no geometry with a type and coordinates");
  }
  const std::string type = geometry["type"];
  const json& coordinates = geometry["coordinates"];
  const bool takes_area = edit_.op != EditOp::kCarve && edit_.op != EditOp::kRaise && edit_.op != EditOp::kBreakline;
  const bool takes_line = !takes_area || edit_.op == EditOp::kPrecision;
  std::vector<std::size_t> first_rings;
  const auto add_polygon = [&](const json& polygon) {
    first_rings.push_back(rings_.size());
    if (!polygon.is_array() || polygon.empty()) return Fail("a polygon needs a ring");
    for (const json& ring : polygon) AddRing(ring);
  };
  if ((type == "Polygon" || type == "MultiPolygon") && takes_area) {
    edit_.is_area = true;
    if (type == "Polygon") {
      add_polygon(coordinates);
    } else if (edit_.op == EditOp::kSlope && coordinates.size() > 1) {
      return Fail("slope takes one polygon; divide the parts into features");  // its heights are those of one ring
    } else {
      for (const json& polygon : coordinates) add_polygon(polygon);
    }
    CheckPolygons(first_rings);
  } else if ((type == "LineString" || type == "MultiLineString") && takes_line) {
    edit_.is_area = false;
    if (type == "LineString") return AddRing(coordinates);
    for (const json& line : coordinates) AddRing(line);
  } else {
    Fail(fmt::format("{} takes a {}, not a {}", NameOf(edit_.op),
                     takes_area && takes_line ? "polygon or a line"
                     : takes_area             ? "polygon"
                                              : "line",
                     type));
  }
}

void Parser::ReadOptions(const json& terrain) {
  edit_.blend_m = Number(terrain, "blend_m", 0, kMaxWidth_m).value_or(0);
  if (const auto width = Number(terrain, "width_m", 0, kMaxWidth_m); width && !edit_.is_area) {
    edit_.half_width_m = *width / 2;
  } else if (!edit_.is_area && edit_.op != EditOp::kBreakline && !has_failed()) {
    Fail(fmt::format("{} along a line needs its \"width_m\"", NameOf(edit_.op)));
  }
  if (edit_.op == EditOp::kOffset) {
    const auto metres = Number(terrain, "metres", -kMaxHeight_m, kMaxHeight_m);
    if (!metres && !has_failed()) Fail("offset needs \"metres\"");
    edit_.offset_m = metres.value_or(0);
  }
  if (edit_.op == EditOp::kPrecision) {
    const auto error = Number(terrain, "error_m", 0.001, 100'000), factor = Number(terrain, "factor", 1e-6, 1);
    if (!error && !factor && !has_failed()) Fail("precision needs \"error_m\" or \"factor\"");
    edit_.error_m = error.value_or(edit_.error_m);
    edit_.factor = factor.value_or(1);
    const double min_level = Number(terrain, "min_level", 0, 30).value_or(0);
    edit_.min_level = static_cast<int>(min_level);
    if (min_level != edit_.min_level) Fail(fmt::format("min_level is {}; it must be a whole number", min_level));
  }
  if (edit_.op == EditOp::kReplace) {
    const auto source = terrain.find("source");
    if (source == terrain.end() || !source->is_string())
      return Fail("replace needs the path of a raster as \"source\"");
    edit_.source = (std::filesystem::path(file_).parent_path() / source->get<std::string>()).string();
  }
}

void Parser::ReadDatum(const json& terrain) {
  const auto found = terrain.find("vertical");
  if (found == terrain.end()) return;
  if (edit_.op == EditOp::kReplace) {
    auto vertical = ParseSourceVertical(*found);
    if (!vertical) return Fail(vertical.error());
    edit_.source_vertical = *std::move(vertical);
    return;
  }
  const auto datum = ParseDatum(*found);
  if (!datum) return Fail(datum.error());
  if (!edit_.has_heights()) return Fail(fmt::format("vertical is of heights, and {} has none", NameOf(edit_.op)));
  edit_.datum = *datum;
}

// From the westernmost to the easternmost position. Parts whose middle is west of Greenwich are one turn further east
// if that is the shorter way around: those of a feature on both sides of the antimeridian. Parts stay whole.
std::pair<double, double> LongitudesOf(const std::vector<Ring>& rings) {
  double west = 180, east = -180, west_across = 540, east_across = -180;
  for (const Ring& ring : rings) {
    double first = 180, last = -180;
    for (const Vertex& vertex : ring) {
      first = std::min(first, vertex.at.longitude);
      last = std::max(last, vertex.at.longitude);
    }
    const double turn = first + last < 0 ? 360 : 0;
    west = std::min(west, first), east = std::max(east, last);
    west_across = std::min(west_across, first + turn), east_across = std::max(east_across, last + turn);
  }
  return east - west > 180 && east_across - west_across < east - west ? std::pair(west_across, east_across)
                                                                      : std::pair(west, east);
}

void Parser::PlaceOnPlane() {
  double south = 90, north = -90;
  for (const Ring& ring : rings_) {
    for (const Vertex& vertex : ring) {
      south = std::min(south, vertex.at.latitude);
      north = std::max(north, vertex.at.latitude);
    }
  }
  const auto [west, east] = LongitudesOf(rings_);
  EditPlane& plane = edit_.plane;
  plane.longitude = (west + east) / 2;
  // Of few bits, so that 180 and -180 degrees are exactly one place.
  if (east > 180) plane.longitude = std::remainder(std::round(plane.longitude * 0x1p24) / 0x1p24, 360.0);
  plane.latitude = (south + north) / 2;
  plane.east_m = std::max(geo::MetresPerDegreeEast(plane.latitude), 1.0);
  plane.north_m = geo::MetresPerDegreeNorth(plane.latitude);
  for (const Ring& ring : rings_) {
    auto& placed = edit_.rings.emplace_back();
    for (const Vertex& vertex : ring) placed.push_back({plane.X(vertex.at.longitude), plane.Y(vertex.at.latitude)});
  }
}

// One height a point: from the property, which is a number or a list, else the third coordinates.
std::vector<std::optional<double>> Parser::HeightsOf(const json& terrain, const char* key, const Ring& ring) {
  std::vector<std::optional<double>> heights(ring.size());
  const auto given = terrain.find(key);
  if (given == terrain.end()) {
    for (std::size_t i = 0; i < ring.size(); ++i) heights[i] = ring[i].height;
  } else if (given->is_number()) {
    std::ranges::fill(heights, std::optional(given->get<double>()));
  } else if (given->is_array() &&
             (given->size() == ring.size() || (edit_.is_area && given->size() == ring.size() + 1))) {
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const json& height = (*given)[i];
      if (height.is_number()) {
        heights[i] = height.get<double>();
      } else if (!height.is_null()) {
        Fail(fmt::format("{} has {}; heights are numbers, or null where none is given", key, height.dump()));
      }
    }
  } else {
    Fail(fmt::format("{} must be {} heights, one for each position", key, ring.size()));
  }
  if (given != terrain.end() && given->is_array() && given->size() == ring.size() + 1 &&
      given->back() != given->front()) {
    Fail(fmt::format("{} begins with {} and ends with {}, which are of one position", key, given->front().dump(),
                     given->back().dump()));
  }
  for (const auto& height : heights) {
    if (height && !(std::abs(*height) <= kMaxHeight_m)) {
      Fail(fmt::format("height {} m is not on Earth", *height));
      break;
    }
  }
  return heights;
}

// Fills points without a height from their neighbours along the line or ring.
void Interpolate(std::vector<std::optional<double>>& heights, const std::vector<PlanPoint>& points, bool is_ring) {
  const std::size_t n = heights.size();
  const auto known = heights;
  const auto length = [&](std::size_t i) {
    const PlanPoint a = points[i % n], b = points[(i + 1) % n];
    return std::hypot(b.x - a.x, b.y - a.y);
  };
  for (std::size_t i = 0; i < n; ++i) {
    if (known[i]) continue;
    double back = 0, ahead = 0;
    std::size_t low = i + n, high = i + n;
    const std::size_t first = is_ring ? i : n, last = is_ring ? i + 2 * n : 2 * n - 1;
    while (low > first && !known[low % n]) back += length(--low);
    while (high < last && !known[high % n]) ahead += length(high++);
    const auto &a = known[low % n], &b = known[high % n];
    if (a && b) {
      heights[i] = back + ahead > 0 ? *a + (*b - *a) * (back / (back + ahead)) : *a;
    } else {
      heights[i] = a ? a : b;
    }
  }
}

void Parser::ReadHeights(const json& terrain) {
  if (has_failed()) return;
  if (edit_.op == EditOp::kFlatten) {
    const auto height = terrain.find("height");
    if (height == terrain.end()) return Fail("flatten needs a \"height\": metres, \"mean\" or \"median\"");
    if (*height == "mean" || *height == "median") {
      edit_.flat = *height == "mean" ? FlatHeight::kMean : FlatHeight::kMedian;
    } else {
      if (height->is_string())
        return Fail(fmt::format("height is {}; it must be metres, \"mean\" or \"median\"", height->dump()));
      edit_.height_m = Number(terrain, "height", -kMaxHeight_m, kMaxHeight_m).value_or(0);
    }
    return;
  }
  if (edit_.op == EditOp::kSlope) return FitSlope(HeightsOf(terrain, "heights", rings_.front()));
  if (edit_.op != EditOp::kCarve && edit_.op != EditOp::kRaise) return;
  for (std::size_t r = 0; r < rings_.size(); ++r) {
    std::vector<std::optional<double>> heights = HeightsOf(terrain, "height", rings_[r]);
    if (has_failed()) return;
    Interpolate(heights, edit_.rings[r], false);
    auto& of_line = edit_.heights.emplace_back();
    for (const auto& height : heights) {
      if (!height) return Fail("heights are missing: give \"height\" as a number or one for each position");
      of_line.push_back(*height);
    }
  }
}

// The plane with the least squares of differences; nothing if the points lie on a line.
std::optional<std::array<double, 3>> FittedPlane(const std::vector<PlanPoint>& points,
                                                 const std::vector<std::optional<double>>& heights) {
  double n = 0, x = 0, y = 0, z = 0, xx = 0, xy = 0, yy = 0, xz = 0, yz = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!heights[i]) continue;
    n += 1, x += points[i].x, y += points[i].y, z += *heights[i];
  }
  x /= n, y /= n, z /= n;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!heights[i]) continue;
    const double dx = points[i].x - x, dy = points[i].y - y, dz = *heights[i] - z;
    xx += dx * dx, xy += dx * dy, yy += dy * dy, xz += dx * dz, yz += dy * dz;
  }
  const double area = xx * yy - xy * xy;
  if (!(area > 1e-9 * (xx + yy) * (xx + yy))) return std::nullopt;
  const double gx = (xz * yy - yz * xy) / area, gy = (yz * xx - xz * xy) / area;
  return std::array<double, 3>{gx, gy, z - gx * x - gy * y};
}

// A plane if one fits the heights within a centimetre, else triangles between all corners.
void Parser::FitSlope(std::vector<std::optional<double>> heights) {
  if (has_failed()) return;
  const std::vector<PlanPoint>& ring = edit_.rings.front();
  if (std::ranges::count_if(heights, [](const auto& height) { return height.has_value(); }) < 3) {
    return Fail("slope needs heights at three corners or more: \"heights\", or third coordinates");
  }
  const auto fitted = FittedPlane(ring, heights);
  if (!fitted) return Fail("the corners with heights lie on one line; slope needs three that do not");
  constexpr double kPlanar_m = 0.01;
  bool is_plane = true;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const double at = (*fitted)[0] * ring[i].x + (*fitted)[1] * ring[i].y + (*fitted)[2];
    if (heights[i] && std::abs(at - *heights[i]) > kPlanar_m) is_plane = false;
  }
  if (is_plane) {
    edit_.slope = *fitted;
  } else {
    edit_.triangles = CutEars(ring);
    if (edit_.triangles.empty()) return Fail("the polygon cannot be divided into triangles");
    Interpolate(heights, ring, true);
    auto& of_ring = edit_.heights.emplace_back();
    for (const auto& height : heights) of_ring.push_back(*height);
  }
  for (std::size_t r = edit_.heights.size(); r < edit_.rings.size(); ++r) {
    std::vector<double> of_ring;
    for (const PlanPoint point : edit_.rings[r]) of_ring.push_back(TargetAt(edit_, point, {.is_inside = true}));
    edit_.heights.push_back(std::move(of_ring));
  }
}

}  // namespace

std::optional<Edit> ParseEdit(const json& feature, const std::string& file, std::size_t index,
                              std::vector<EditFault>& faults) {
  if (!feature.is_object()) return std::nullopt;
  return Parser(file, index, faults).Parse(feature);
}

}  // namespace terrace::dem
