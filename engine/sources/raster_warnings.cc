#include "engine/sources/raster_warnings.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/core/plain_number.h"
#include "engine/crs/footprint.h"
#include "engine/crs/geoid.h"
#include "engine/gdal/sample_rules.h"

namespace terrace::dem {
namespace {

// The latitude beyond a pole, farther than a pixel, that the rows of a geographic raster reach; 0: none.
double BeyondPole(const Georeference& georeference) {
  if (!georeference.is_geographic_grid()) return 0;
  std::array<Position, 2> ends{{{0, 0}, {0, static_cast<double>(georeference.height())}}};
  georeference.ToDegrees(ends);
  const double latitude = std::abs(ends[0].y) > std::abs(ends[1].y) ? ends[0].y : ends[1].y;
  const double pixel = std::abs(ends[1].y - ends[0].y) / georeference.height();
  return std::abs(latitude) > 90 + pixel ? latitude : 0;
}

// How many pixels the centre is away from where its longitude and latitude lead back to; NaN: nowhere.
double OffCentre(const Georeference& georeference) {
  const Position centre{georeference.width() / 2.0, georeference.height() / 2.0};
  std::array<Position, 1> there{centre};
  georeference.ToDegrees(there);
  georeference.ToPixels(there);
  double x = there[0].x - centre.x;
  if (const double turn = georeference.period(); turn > 0) x -= turn * std::round(x / turn);
  return std::hypot(x, there[0].y - centre.y);
}

void WarnOfPosition(const Georeference& georeference, double spacing_m, const RasterLayout& layout,
                    std::vector<std::string>& warnings) {
  // One more column is allowed, for grids with nodes at -180 and at 180 degrees.
  if (const int beyond = layout.width - layout.columns; beyond > 1) {
    warnings.push_back(fmt::format(
        "reaches more than once around the Earth: its last {} columns are taken for duplicates of its first "
        "and are not read",
        beyond));
  }
  if (const double latitude = BeyondPole(georeference); latitude != 0) {
    warnings.push_back(
        fmt::format("reaches beyond a pole, to latitude {}: rows beyond it are not read; if the georeference is wrong, "
                    "correct it with `gdal_translate -a_ullr west north east south in out`",
                    PlainNumber(latitude)));
  }
  if (georeference.transform().find("Ballpark") != std::string::npos) {
    warnings.push_back(
        fmt::format("PROJ knows no exact way from {} to WGS 84 here ({}): positions may be off by up to some hundred "
                    "metres; warp the raster to a system that PROJ can convert",
                    georeference.crs(), georeference.transform()));
  }
  if (HasUnknownOutline(georeference)) {
    warnings.push_back(
        fmt::format("places at its rim have no longitude and latitude ({}): they count as outside, and the bounds are "
                    "those of the whole Earth; cut them off with `gdal_translate -projwin`, or, if a grid of the datum "
                    "ends inside the raster, warp it with `gdalwarp -t_srs EPSG:4326 in out`",
                    georeference.transform()));
  }
  constexpr double kMaxOffCentre = 1;  // pixels
  if (!(OffCentre(georeference) <= kMaxOffCentre)) {
    warnings.push_back(
        fmt::format("longitude and latitude of its centre do not lead back to it: its coordinates are outside of what "
                    "{} is for, so heights may be missing; if that is the wrong system, assign the right one with "
                    "`gdal_translate -a_srs EPSG:XXXX in out`",
                    georeference.crs()));
  }
  constexpr double kSmallestPixel = 0.005;  // metres; of degrees, 500 m
  if (!georeference.is_geographic() && georeference.MayBeInDegrees() && spacing_m < kSmallestPixel) {
    warnings.push_back(
        fmt::format("has pixels of {} {} near the origin of {}: if its coordinates are degrees, state that with "
                    "`gdal_translate -a_srs EPSG:4326 in out`",
                    PlainNumber(georeference.pixel_width()), georeference.pixel_unit(), georeference.crs()));
  }
}

void WarnOfDatum(GDALDataset& dataset, const Georeference& georeference, const VerticalDatum& vertical,
                 const std::string& wanted_vertical, const RasterLayout& layout, std::vector<std::string>& warnings) {
  if (!vertical.is_known()) {
    const char* const dted = dataset.GetMetadataItem("DTED_VerticalDatum");  // also in files made of DTED
    warnings.push_back(fmt::format(
        "no vertical datum stated{}: heights are taken as metres above the WGS 84 ellipsoid; if they are "
        "above mean sea level, set `vertical`, as in --vertical egm96; otherwise they are off by up to 100 "
        "m",
        dted == nullptr || *dted == '\0'
            ? ""
            : fmt::format(" (the file states DTED_VerticalDatum={}; E96 and MSL are mean sea level)", dted)));
  }
  if (wanted_vertical != "crs" && !georeference.vertical_crs().empty()) {
    if (const auto depths = NameOfDepths(georeference.vertical_crs())) {
      warnings.push_back(
          fmt::format("its reference system has depths ({}), but `vertical` takes its samples for heights; if they are "
                      "not negated yet, negate them with `gdal_calc.py -A in --outfile=out --calc=-A`",
                      *depths));
    }
  }
  if (const std::string depths = AttributeOfDepths(*dataset.GetRasterBand(1));
      wanted_vertical != "crs" && !depths.empty()) {
    warnings.push_back(fmt::format(
        "its band states \"{}\", but `vertical` takes its samples for heights; if they are not negated yet, "
        "negate them with `gdal_calc.py -A in --outfile=out --calc=-A`",
        depths));
  }
  if (!vertical.geoid) return;
  // Some programs write feet in places that GDAL does not read.
  const std::string &unit = layout.rules.unit, &counted = vertical.geoid->unit();
  const auto metres = MetresPerUnit(unit), counted_metres = MetresPerUnit(counted);
  if (!unit.empty() && !counted.empty() && metres && counted_metres && *metres != *counted_metres) {
    warnings.push_back(
        fmt::format("the file states heights in \"{}\", and they are taken for that; {} counts in \"{}\": if that is "
                    "what they are, say so with `gdal_edit.py -units \"{}\" file`",
                    unit, vertical.name, counted, counted));
  }
}

}  // namespace

std::vector<std::string> WarningsOf(GDALDataset& dataset, const Georeference& georeference, double spacing_m,
                                    const VerticalDatum& vertical, const std::string& wanted_vertical,
                                    const RasterLayout& layout) {
  std::vector<std::string> warnings;
  WarnOfPosition(georeference, spacing_m, layout, warnings);
  WarnOfDatum(dataset, georeference, vertical, wanted_vertical, layout, warnings);
  return warnings;
}

}  // namespace terrace::dem
