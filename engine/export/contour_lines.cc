#include "engine/export/contour_lines.h"

#include <gdal_alg.h>
#include <gdal_priv.h>
#include <ogrsf_frmts.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "engine/common/dem_types.h"
#include "engine/core/check.h"
#include "engine/gdal/gdal_runtime.h"

namespace terrace::dem {
namespace {

constexpr const char* kHeightField = "height";

// A raster of GDAL over these heights, without a copy.
GDALDatasetUniquePtr RasterOver(std::span<const float> heights, int columns, int rows) {
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("MEM");
  if (driver == nullptr) return nullptr;
  GDALDatasetUniquePtr raster(driver->Create("", columns, rows, 0, GDT_Float32, nullptr));
  if (!raster) return nullptr;
  // GDAL only reads it.
  const auto address = reinterpret_cast<std::uintptr_t>(heights.data());
  const std::string pointer = "DATAPOINTER=" + std::to_string(address);
  char* options[] = {const_cast<char*>(pointer.c_str()), nullptr};
  if (raster->AddBand(GDT_Float32, options) != CE_None) return nullptr;
  double in_nodes[] = {0, 1, 0, 0, 0, 1};  // rows count downwards; this driver's default has them upwards
  if (raster->SetGeoTransform(in_nodes) != CE_None) return nullptr;
  return raster;
}

int ContinueUnlessStopped(double, const char*, void* stop) {
  return static_cast<const std::stop_token*>(stop)->stop_requested() ? FALSE : TRUE;
}

// A layer that keeps the lines of GDAL's generator. GDAL's driver for vectors in memory is not among those of this
// process (gdal/driver_list.h).
class LineCollector final : public OGRLayer {
 public:
  LineCollector() : definition_(new OGRFeatureDefn("contours")) {
    definition_->Reference();
    definition_->SetGeomType(wkbLineString);
    OGRFieldDefn height(kHeightField, OFTReal);
    definition_->AddFieldDefn(&height);
  }
  ~LineCollector() override { definition_->Release(); }

  OGRFeatureDefn* GetLayerDefn() override { return definition_; }
  void ResetReading() override {}
  OGRFeature* GetNextFeature() override { return nullptr; }
  int TestCapability(const char*) override { return FALSE; }

  OGRErr ICreateFeature(OGRFeature* feature) override {
    const OGRGeometry* const geometry = feature->GetGeometryRef();
    if (geometry == nullptr || wkbFlatten(geometry->getGeometryType()) != wkbLineString) return OGRERR_FAILURE;
    const OGRLineString& string = *geometry->toLineString();
    ContourLine line;
    line.height = feature->GetFieldAsDouble(0);
    line.points.reserve(static_cast<std::size_t>(string.getNumPoints()));
    for (int i = 0; i < string.getNumPoints(); ++i) {
      line.points.push_back({string.getX(i) - 0.5, string.getY(i) - 0.5});  // GDAL's nodes are the middles of pixels
    }
    lines.push_back(std::move(line));
    return OGRERR_NONE;
  }

  std::vector<ContourLine> lines;

 private:
  OGRFeatureDefn* const definition_;  // counted: features refer to it
};

std::size_t CrossingsBetween(float a, float b, double interval) {
  if (std::isnan(a) || std::isnan(b)) return 0;
  const double steps = std::abs(std::floor(a / interval) - std::floor(b / interval));
  return static_cast<std::size_t>(std::min(steps, static_cast<double>(kMaxContourCrossings)));
}

}  // namespace

std::size_t CountContourCrossings(std::span<const float> heights, int columns, int rows, double interval) {
  TERRACE_CHECK(interval > 0 && heights.size() == Area(columns, rows));
  std::size_t count = 0;
  const auto stride = static_cast<std::size_t>(columns);
  for (std::size_t i = 0; i < heights.size(); ++i) {
    if ((i + 1) % stride != 0) count += CrossingsBetween(heights[i], heights[i + 1], interval);
    if (i + stride < heights.size()) count += CrossingsBetween(heights[i], heights[i + stride], interval);
  }
  return count;
}

Result<std::vector<ContourLine>> TraceContours(std::span<const float> heights, int columns, int rows, double interval,
                                               const std::stop_token& stop) {
  TERRACE_CHECK(interval > 0 && columns > 0 && rows > 0 && heights.size() == Area(columns, rows));
  const auto failed = [&stop]() -> tl::unexpected<Error> {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "contours: stopped");
    return MakeError(ErrorCode::kInternal, "GDAL cannot make contours: {}", TakeGdalError());
  };
  InitGdal();
  ForgetGdalError();
  const GDALDatasetUniquePtr raster = RasterOver(heights, columns, rows);
  if (!raster) return failed();
  LineCollector collector;
  const std::string spacing = "LEVEL_INTERVAL=" + std::to_string(interval);
  char* options[] = {const_cast<char*>(spacing.c_str()), const_cast<char*>("ELEV_FIELD=0"),
                     const_cast<char*>("NODATA=nan"), nullptr};
  std::stop_token token = stop;
  if (GDALContourGenerateEx(raster->GetRasterBand(1), &collector, options, ContinueUnlessStopped, &token) != CE_None) {
    return failed();
  }
  std::ranges::stable_sort(collector.lines, {}, &ContourLine::height);
  return std::move(collector.lines);
}

}  // namespace terrace::dem
