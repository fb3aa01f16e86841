#include "engine/crs/georeference.h"

#include <cpl_conv.h>
#include <cpl_string.h>
#include <fmt/core.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <vector>

#include "engine/core/plain_number.h"
#include "engine/gdal/sample_rules.h"
#include "engine/geo/ellipsoid.h"

namespace terrace::dem {
namespace {

// Positions within this distance of the raster's western edge, in pixels, count as on it: SRTM's corners are not exact
// in binary.
constexpr double kEdgeTolerance = 1e-6;

Position Apply(const std::array<double, 6>& affine, Position p) {
  return {affine[0] + p.x * affine[1] + p.y * affine[2], affine[3] + p.x * affine[4] + p.y * affine[5]};
}

std::string NameAndCode(const OGRSpatialReference& srs) {
  const char* name = srs.GetName();
  const char* authority = srs.GetAuthorityName(nullptr);
  const char* code = srs.GetAuthorityCode(nullptr);
  std::string text = name == nullptr ? "unnamed" : name;
  if (authority != nullptr && code != nullptr) text += fmt::format(" ({}:{})", authority, code);
  return text;
}

bool IsWgs84Degrees(const OGRSpatialReference& srs) {
  OGRSpatialReference wgs84;
  wgs84.SetWellKnownGeogCS("WGS84");
  const char* const options[] = {"IGNORE_DATA_AXIS_TO_SRS_AXIS_MAPPING=YES",
                                 "CRITERION=EQUIVALENT_EXCEPT_AXIS_ORDER_GEOGCRS", nullptr};
  return srs.IsSame(&wgs84, options) != 0;
}

std::string Wkt(const OGRSpatialReference& srs) {
  char* text = nullptr;
  const char* const options[] = {"FORMAT=WKT2_2019", nullptr};
  const bool written = srs.exportToWkt(&text, options) == OGRERR_NONE;
  std::string wkt = written ? text : "";
  CPLFree(text);
  return wkt;
}

// The unit of a CRS with three axes, which states its size in metres but not its name.
std::string UnitOfHeightAxis(const OGRSpatialReference& srs) {
  constexpr double kTolerance = 1e-9;  // the two feet are 6e-7 apart
  double metres = 1;
  srs.GetAxis(nullptr, 2, nullptr, &metres);
  for (const char* name : {"metre", "foot", "US survey foot"}) {
    if (std::abs(metres - *MetresPerUnit(name)) < kTolerance) return name;
  }
  return fmt::format("{} m a unit", metres);  // unknown unit: logged as a warning
}

// Returns nothing if the CRS cannot be written in PROJ's older notation.
std::optional<std::string> Proj4(const OGRSpatialReference& srs) {
  char* text = nullptr;
  const bool written = srs.exportToProj4(&text) == OGRERR_NONE;
  std::optional<std::string> proj4;
  if (written && text != nullptr) proj4 = text;
  CPLFree(text);
  return proj4;
}

// Uses the EPSG code if there is one. GDAL's text of a file's CRS varies: a compound CRS without its vertical part has
// lost the details of its code, and earlier reads of a thread determine whether the datum of WGS 84 is written as an
// ensemble. Rasters with different texts would not be combined.
std::string CanonicalWkt(const OGRSpatialReference& horizontal) {
  const char* authority = horizontal.GetAuthorityName(nullptr);
  const char* code = horizontal.GetAuthorityCode(nullptr);
  if (authority != nullptr && code != nullptr && EQUAL(authority, "EPSG")) {
    OGRSpatialReference registered;
    registered.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    // IsSame distinguishes an ensemble from its datum, but their projections are equal.
    if (registered.importFromEPSG(std::atoi(code)) == OGRERR_NONE &&
        (registered.IsSame(&horizontal) != 0 || (Proj4(registered) && Proj4(registered) == Proj4(horizontal)))) {
      if (Result<std::string> wkt = EpsgWkt(code)) return *std::move(wkt);
    }
  }
  return Wkt(horizontal);
}

// GRS 80 counts: the two differ by 0.1 mm.
bool HasEllipsoidOfWgs84(const OGRSpatialReference& srs) {
  return std::abs(srs.GetSemiMajor() - geo::kSemiMajorAxis) < 0.01 &&
         std::abs(srs.GetInvFlattening() - 298.257223) < 1e-4;
}

// Name and unit of the vertical datum, if the CRS states them.
std::pair<std::string, std::string> VerticalPart(const OGRSpatialReference& srs) {
  if (srs.IsCompound() != 0) {
    const char* name = srs.GetAttrValue("COMPD_CS|VERT_CS|VERT_DATUM");
    const char* unit = srs.GetAttrValue("COMPD_CS|VERT_CS|UNIT");
    // If a GeoTIFF states only the unit of its heights, or describes them in words, GDAL makes a vertical datum with
    // that text as name.
    const bool is_unknown = name != nullptr && EQUAL(name, "unknown");
    return {is_unknown ? "" : name == nullptr ? "unnamed" : name, unit == nullptr ? "" : unit};
  }
  if (srs.GetAxesCount() != 3) return {};
  const char* const ellipsoid = srs.GetAttrValue("SPHEROID");
  return {HasEllipsoidOfWgs84(srs) ? "ellipsoid" : fmt::format("ellipsoid {}", ellipsoid == nullptr ? "?" : ellipsoid),
          UnitOfHeightAxis(srs)};
}

// Whether the file's x is the latitude or northing, which most formats of GDAL put into y.
bool HasNorthingFirst(const OGRSpatialReference& srs) {
  OGRSpatialReference usual = srs;
  usual.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  const std::vector<int>&axes = srs.GetDataAxisToSRSAxisMapping(), &usual_axes = usual.GetDataAxisToSRSAxisMapping();
  return axes.size() >= 2 && usual_axes.size() >= 2 && axes[0] == usual_axes[1] && axes[1] == usual_axes[0];
}

std::vector<double> NumbersIn(const char* list) {
  std::vector<double> numbers;
  const CPLStringList texts(CSLTokenizeString2(list, "{, }", 0));
  for (int i = 0; i < texts.size(); ++i) numbers.push_back(CPLAtof(texts[i]));
  return numbers;
}

// GDAL places the rows of a Gaussian grid in a netCDF file at even distances, and keeps their latitudes as metadata.
Result<void> CheckRowSpacing(GDALDataset& dataset, const std::array<double, 6>& to_crs, const std::string& path) {
  constexpr double kTolerance = 0.1;  // rows: latitudes in single precision are nearer to their places
  const char* const text = dataset.GetMetadataItem("Y_VALUES", "GEOLOCATION2");
  if (text == nullptr) return {};
  std::vector<double> latitudes = NumbersIn(text);
  if (latitudes.size() != static_cast<std::size_t>(dataset.GetRasterYSize())) return {};  // cut out of a larger raster
  std::ranges::sort(latitudes);
  if (to_crs[5] < 0) std::ranges::reverse(latitudes);
  for (std::size_t row = 0; row < latitudes.size(); ++row) {
    const double off = std::abs((latitudes[row] - to_crs[3]) / to_crs[5] - (static_cast<double>(row) + 0.5));
    if (off <= kTolerance) continue;
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: its rows are not evenly spaced: row {}, at latitude {}, is {} rows from its place in an even "
                     "grid; resample it to one, as with `cdo remapbil,r720x360 in out`",
                     path, row, PlainNumber(latitudes[row]), PlainNumber(std::round(off * 100) / 100));
  }
  return {};
}

}  // namespace

Result<Georeference> Georeference::Of(GDALDataset& dataset, const std::string& path) {
  Georeference self;
  self.width_ = dataset.GetRasterXSize();
  self.height_ = dataset.GetRasterYSize();
  if (dataset.GetGeoTransform(self.to_crs_.data()) != CE_None) {
    if (dataset.GetGCPCount() > 0) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "{}: is placed by ground control points only; resample it with `gdalwarp -t_srs EPSG:4326 in out`", path);
    }
    if (dataset.GetMetadata("RPC") != nullptr) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: is placed by rational polynomials (RPC) only; resample it with `gdalwarp -rpc -t_srs "
                       "EPSG:4326 in out`",
                       path);
    }
    return MakeError(
        ErrorCode::kInvalidArgument,
        "{}: has no georeference; if you know where it lies, add one with `gdal_translate -a_srs EPSG:XXXX "
        "-a_ullr west north east south in out`; `terrace mesh` needs none",
        path);
  }
  const OGRSpatialReference* srs = dataset.GetSpatialRef();
  // Everything below takes x for the longitude or easting.
  if (srs != nullptr && HasNorthingFirst(*srs)) {
    std::swap_ranges(self.to_crs_.begin(), self.to_crs_.begin() + 3, self.to_crs_.begin() + 3);
  }
  if (auto affine = self.SetAffine(path); !affine) return tl::unexpected(affine.error());
  if (auto even = CheckRowSpacing(dataset, self.to_crs_, path); !even) return tl::unexpected(even.error());
  if (srs == nullptr || srs->IsEmpty()) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "{}: states no coordinate reference system; add it with `gdal_translate -a_srs EPSG:XXXX in out`{}", path,
        self.MayBeInDegrees() ? "; if its coordinates are degrees, XXXX is 4326" : "");
  }
  if (auto crs = self.ReadCrs(*srs, path); !crs) return tl::unexpected(crs.error());
  return self;
}

// Grids of netCDF often have longitudes and latitudes, but state no reference system.
bool Georeference::MayBeInDegrees() const {
  constexpr double kMargin = 0.5;  // half a pixel of grids with nodes at the poles
  const auto is_within = [&](double column, double row) {
    const double x = to_crs_[0] + column * to_crs_[1] + row * to_crs_[2];
    const double y = to_crs_[3] + column * to_crs_[4] + row * to_crs_[5];
    return std::abs(x) <= 360 + kMargin && std::abs(y) <= 90 + kMargin;
  };
  return is_within(0, 0) && is_within(width_, 0) && is_within(0, height_) && is_within(width_, height_);
}

Result<void> Georeference::SetAffine(const std::string& path) {
  if (GDALInvGeoTransform(to_crs_.data(), to_pixel_.data()) != 0) return {};
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: its georeference has no extent (pixel size {} x {}); set it with `gdal_translate -a_ullr west "
                   "north east south in out`",
                   path, to_crs_[1], to_crs_[5]);
}

// Whether pixel sizes are so equal that over `side` pixels the two grids differ by less than the tolerance.
bool Georeference::HasPixelsOf(const Georeference& other, int side) const {
  const double pixel = std::min(pixel_width(), pixel_height());
  return std::ranges::none_of(std::array<std::size_t, 4>{1, 2, 4, 5}, [&](std::size_t i) {
    return std::abs(to_crs_[i] - other.to_crs_[i]) * side > kOffsetTolerance * pixel;
  });
}

bool Georeference::MayAlign(const Georeference& other) const {
  return !horizontal_wkt_.empty() && HasPixelsOf(other, std::max(other.width_, other.height_));
}

Position Georeference::CornerOf(const Georeference& other) const {
  return Apply(to_pixel_, {other.to_crs_[0], other.to_crs_[3]});
}

std::optional<PixelOffset> Georeference::OffsetOf(const Georeference& other) const {
  if (horizontal_wkt_.empty() || horizontal_wkt_ != other.horizontal_wkt_) return std::nullopt;
  if (!HasPixelsOf(other, std::max({width_, height_, other.width_, other.height_}))) return std::nullopt;
  const Position corner = CornerOf(other);
  if (!(std::max(std::abs(corner.x), std::abs(corner.y)) < kFarthestPixel)) return std::nullopt;
  const double column = std::round(corner.x), row = std::round(corner.y);
  if (std::abs(corner.x - column) > kOffsetTolerance || std::abs(corner.y - row) > kOffsetTolerance)
    return std::nullopt;
  return PixelOffset{static_cast<std::int64_t>(column), static_cast<std::int64_t>(row)};
}

Position Georeference::LargestMisplacement(const Georeference& other, const PixelOffset& first) const {
  Position largest{0, 0};
  const double width = other.width_, height = other.height_;
  // Both grids are affine: the difference is largest at a corner.
  for (const Position corner : {Position{0, 0}, {width, 0}, {0, height}, {width, height}}) {
    const Position there = Apply(to_pixel_, Apply(other.to_crs_, corner));
    double x = there.x - corner.x - static_cast<double>(first.column);
    if (period_ > 0) x -= period_ * std::round(x / period_);
    const double y = there.y - corner.y - static_cast<double>(first.row);
    largest = {std::max(largest.x, std::abs(x)), std::max(largest.y, std::abs(y))};
  }
  return largest;
}

Result<Georeference> Georeference::Moved(const PixelOffset& first, int width, int height,
                                         const std::string& name) const {
  Georeference moved;
  moved.width_ = width;
  moved.height_ = height;
  moved.to_crs_ = to_crs_;
  const Position corner = Apply(to_crs_, {static_cast<double>(first.column), static_cast<double>(first.row)});
  moved.to_crs_[0] = corner.x;
  moved.to_crs_[3] = corner.y;
  if (auto affine = moved.SetAffine(name); !affine) return tl::unexpected(affine.error());
  OGRSpatialReference srs(wkt_.c_str());
  srs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  if (auto crs = moved.ReadCrs(srs, name); !crs) return tl::unexpected(crs.error());
  return moved;
}

Result<void> Georeference::ReadCrs(const OGRSpatialReference& srs, const std::string& path) {
  wkt_ = Wkt(srs);
  std::tie(vertical_datum_, vertical_unit_) = VerticalPart(srs);
  if (srs.IsCompound() != 0 && !vertical_datum_.empty()) vertical_crs_ = Wkt(srs);
  const OGRSpatialReference horizontal = HorizontalPart(srs);
  horizontal_wkt_ = CanonicalWkt(horizontal);
  crs_ = NameAndCode(vertical_datum_.empty() ? horizontal : srs);
  is_geographic_ = horizontal.IsGeographic() != 0;
  if (!is_geographic_ && horizontal.IsProjected() == 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: its coordinate reference system \"{}\" has neither longitudes and latitudes nor eastings and "
                     "northings; assign the right one with `gdal_translate -a_srs EPSG:XXXX in out`",
                     path, crs_);
  }
  const Position centre = Apply(to_crs_, {width_ / 2.0, height_ / 2.0});
  centre_x_ = centre.x;
  const char* unit = nullptr;
  if (horizontal.IsGeographic() != 0) {
    horizontal.GetAngularUnits(&unit);
    FindPeriod(horizontal);
  } else {
    horizontal.GetLinearUnits(&unit);
  }
  pixel_unit_ = unit == nullptr ? "" : unit;
  if (IsWgs84Degrees(horizontal)) return {};

  constexpr double kSmallestEarth = 6.3e6, kLargestEarth = 6.4e6;  // metres
  if (const double radius = horizontal.GetSemiMajor(); radius < kSmallestEarth || radius > kLargestEarth) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "{}: its coordinate reference system \"{}\" is of a body with a radius of {:.0f} km; only the Earth is "
        "served",
        path, crs_, radius / 1000);
  }
  auto projector = Projector::Make(horizontal_wkt_, centre);
  if (!projector) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "{}: {}: {}; resample it with `gdalwarp -t_srs EPSG:4326 in out` where the grids it needs are installed", path,
        crs_, projector.error().message);
  }
  if (!(*projector)->is_identity()) projector_ = *std::move(projector);
  if (projector_ != nullptr && full_circle_ == 0) FindTurn();
  return {};
}

// Detects a cylindrical projection whose eastings continue beyond the antimeridian: they return from degrees a whole
// turn less. Tests the centres of the outermost pixels, which a raster of the whole Earth has within the antimeridian.
// Corners of a rotated raster may lie beyond, and the first and last rows may lie beyond the poles, where there are no
// degrees.
void Georeference::FindTurn() {
  const double pixel_size = std::max(pixel_width(), pixel_height());
  const double right = width_ - 0.5, middle = height_ / 2.0, bottom = height_ - 0.5;
  for (const Position pixel :
       {Position{0.5, 0.5}, {right, 0.5}, {0.5, middle}, {right, middle}, {0.5, bottom}, {right, bottom}}) {
    const Position there = Apply(to_crs_, pixel);
    std::array<Position, 1> back = {there};
    projector_->Inverse(back);
    projector_->Forward(back);
    const double turn = back[0].x - there.x;
    if (!(std::abs(turn) > pixel_size) || !(std::abs(back[0].y - there.y) < 1e-3 * pixel_size)) continue;
    // The turn must be equal in other rows: outside its outline, a projection that is not cylindrical has another turn
    // in each row.
    std::array<Position, 6> pairs;
    for (std::size_t k = 0; k < 3; ++k) {
      pairs[2 * k] = Apply(to_crs_, {pixel.x, height_ * (0.3 * static_cast<double>(k) + 0.1)});
      pairs[2 * k + 1] = {pairs[2 * k].x + turn, pairs[2 * k].y};
    }
    projector_->Inverse(pairs);
    bool is_turn = true;
    for (std::size_t k = 0; k < 6; k += 2) {
      is_turn = is_turn && std::abs(std::remainder(pairs[k].x - pairs[k + 1].x, 360)) < 1e-6 &&
                std::abs(pairs[k].y - pairs[k + 1].y) < 1e-6;  // false of NaN
    }
    if (!is_turn) continue;
    full_circle_ = std::abs(turn);
    return;
  }
}

void Georeference::FindPeriod(const OGRSpatialReference& srs) {
  full_circle_ = 2 * std::numbers::pi / srs.GetAngularUnits(static_cast<const char**>(nullptr));
  // The meridians of a rotated pole are no meridians of the Earth.
  if (to_crs_[2] != 0 || to_crs_[4] != 0 || srs.IsDerivedGeographic() != 0) return;
  period_ = std::abs(full_circle_ / to_crs_[1]);
  const double whole = std::round(period_);
  // A pixel size of 0.008333333333 means 1/120: up to a hundredth of a pixel around the Earth counts as no gap.
  if (std::abs(period_ - whole) < 0.01 && width_ >= whole) wrap_columns_ = static_cast<int>(whole);
}

double Georeference::CanonicalColumn(double column) const {
  const double wrapped = column - period_ * std::floor(column / period_);
  // Positions between the last column and the first belong to the raster.
  if (wrap_columns_ > 0 && wrapped >= wrap_columns_) return wrapped - wrap_columns_;
  return wrapped > period_ - kEdgeTolerance ? wrapped - period_ : wrapped;
}

void Georeference::ToPixels(std::span<Position> positions) const {
  if (projector_ != nullptr) projector_->Forward(positions);
  for (Position& position : positions) {
    if (full_circle_ > 0 && period_ == 0) {
      // Columns of a rotated or projected grid do not wrap: longitudes nearest to its centre are used.
      position.x -= full_circle_ * std::round((position.x - centre_x_) / full_circle_);
    }
    position = Apply(to_pixel_, position);
    if (period_ > 0) position.x = CanonicalColumn(position.x);
  }
}

void Georeference::ToDegrees(std::span<Position> positions) const {
  for (Position& position : positions) position = Apply(to_crs_, position);
  if (projector_ != nullptr) projector_->Inverse(positions);
}

double Georeference::pixel_width() const { return std::hypot(to_crs_[1], to_crs_[4]); }
double Georeference::pixel_height() const { return std::hypot(to_crs_[2], to_crs_[5]); }

Result<void> Georeference::AddTo(ContentHasher& hasher, const FileContentOptions& options) const {
  hasher.Add(width_);
  hasher.Add(height_);
  for (const double number : to_crs_) hasher.Add(number);
  hasher.Add(full_circle_);
  hasher.Add(period_);
  hasher.Add(wrap_columns_);
  hasher.AddText(pipeline());
  if (projector_ == nullptr) return {};
  const auto grids = HashFiles(projector_->grids(), options);
  if (!grids) return tl::unexpected(grids.error());
  hasher.Add(*grids);
  return {};
}

Result<std::uint64_t> Georeference::FingerprintWith(const StampedFiles& files,
                                                    const FileContentOptions& options) const {
  const auto bytes = HashFiles(files, options);
  if (!bytes) return tl::unexpected(bytes.error());
  ContentHasher hasher;
  hasher.Add(*bytes);
  if (auto placed = AddTo(hasher, options); !placed) return tl::unexpected(placed.error());
  return hasher.Hash().low;
}

OGRSpatialReference HorizontalPart(const OGRSpatialReference& srs) {
  OGRSpatialReference horizontal(srs);
  if (horizontal.IsCompound() != 0) horizontal.StripVertical();
  if (horizontal.GetAxesCount() == 3) horizontal.DemoteTo2D(nullptr);
  return horizontal;
}

}  // namespace terrace::dem
