#include "engine/crs/vertical_datum.h"

#include <filesystem>
#include <system_error>
#include <utility>

#include "engine/gdal/source_policy.h"

namespace terrace::dem {
namespace {

constexpr const char* kWayOut =
    "; or let `vertical` say what the heights count from (\"ellipsoid\", \"egm96\", \"egm2008\", \"unknown\" to pass "
    "them through, or a grid of undulations)";

Result<VerticalDatum> Above(Result<std::shared_ptr<const Geoid>> geoid) {
  if (!geoid) return MakeError(geoid.error().code, "{}{}", geoid.error().message, kWayOut);
  std::string name = (*geoid)->name();
  return VerticalDatum{std::move(name), *std::move(geoid)};
}

Result<VerticalDatum> AboveCrs(const std::string& vertical_crs, Position centre) {
  auto geoid = Geoid::OfCrs(vertical_crs, centre);
  if (geoid) return Above(std::move(geoid));
  if (const auto depths = NameOfDepths(vertical_crs)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{} counts downwards; make heights of the depths with `gdal_calc.py -A in --outfile=out "
                     "--calc=-A`, and let `vertical` say what the heights count from: the copy still states depths",
                     *depths);
  }
  return Above(std::move(geoid));
}

}  // namespace

Result<VerticalDatum> ResolveVertical(const std::string& wanted, const Georeference& stated, Position centre) {
  if (wanted == "unknown") return VerticalDatum{};
  if (wanted == "ellipsoid") return VerticalDatum{"ellipsoid", nullptr};
  if (wanted == "egm96") return Above(Geoid::OfCrs("EPSG:5773", centre));
  if (wanted == "egm2008") return Above(Geoid::OfCrs("EPSG:3855", centre));
  if (wanted.starts_with("EPSG:")) return AboveCrs(wanted, centre);
  if (wanted != "crs") {
    std::error_code ignored;
    if (std::filesystem::exists(wanted, ignored)) {
      if (auto allowed = CheckPlainFile(wanted); !allowed) return tl::unexpected(allowed.error());
    }
    return Above(Geoid::OfGrid(wanted, centre));
  }
  if (!stated.vertical_crs().empty()) return AboveCrs(stated.vertical_crs(), centre);
  if (stated.vertical_datum().starts_with("ellipsoid ")) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "its heights are above the {}, not above that of WGS 84; convert them with `gdalwarp -t_srs "
                     "EPSG:4979 in out.tif`{}",
                     stated.vertical_datum(), kWayOut);
  }
  return VerticalDatum{stated.vertical_datum(), nullptr};
}

}  // namespace terrace::dem
