#include <cpl_string.h>
#include <cpl_vsi.h>
#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <array>
#include <atomic>
#include <limits>
#include <utility>

#include "engine/export/output_grid.h"
#include "engine/gdal/driver_list.h"
#include "engine/gdal/gdal_runtime.h"

namespace terrace::dem {
namespace {

tl::unexpected<Error> CannotWrite(const char* driver) {
  return MakeError(ErrorCode::kUnavailable, "GDAL cannot write a grid by its driver {}: {}", driver, TakeGdalError());
}

// A file in memory, deleted with this object.
class MemoryFile {
 public:
  explicit MemoryFile(const char* suffix) {
    static std::atomic<std::uint64_t> last{0};
    path_ = fmt::format("/vsimem/terrace-grid-{}{}", ++last, suffix);
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  ~MemoryFile() {
    VSIUnlink(path_.c_str());
    VSIUnlink(sidecar().c_str());
  }

  const char* path() const { return path_.c_str(); }
  // Whether GDAL has written something that the format cannot contain beside the file.
  bool has_sidecar() const {
    VSIStatBufL unused;
    return VSIStatL(sidecar().c_str(), &unused) == 0;
  }
  std::string Bytes() const {
    vsi_l_offset size = 0;
    const GByte* const bytes = VSIGetMemFileBuffer(path_.c_str(), &size, FALSE);
    return bytes == nullptr ? std::string() : std::string(reinterpret_cast<const char*>(bytes), size);
  }

 private:
  std::string sidecar() const { return path_ + ".aux.xml"; }

  std::string path_;
};

// Without the code of a deprecated system, for which GDAL reads that of its successor, which may lie elsewhere.
std::string WktOf(const OutputGrid& grid) {
  const CPLConfigOptionSetter as_readers("OSR_USE_NON_DEPRECATED", "YES", /*bSetOnlyIfUndefined=*/false);
  OGRSpatialReference read;
  const std::string code = std::to_string(grid.epsg), id = fmt::format(",ID[\"EPSG\",{}]]", code);
  const bool is_read = read.importFromEPSG(grid.epsg) == OGRERR_NONE && read.GetAuthorityCode(nullptr) != nullptr;
  if (!is_read || read.GetAuthorityCode(nullptr) == code || !grid.wkt.ends_with(id)) return grid.wkt;
  return grid.wkt.substr(0, grid.wkt.size() - id.size()) + "]";
}

// Pixels are centred on the nodes.
void Place(const OutputGrid& grid, GDALDataset& dataset) {
  const double x = grid.step_x(), y = grid.step_y();
  double transform[6] = {grid.west - x / 2, x, 0, grid.north + y / 2, 0, -y};
  dataset.SetGeoTransform(transform);
  OGRSpatialReference srs;
  srs.importFromWkt(WktOf(grid).c_str());
  srs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  dataset.SetSpatialRef(&srs);
}

template <typename T>
CPLErr WriteBand(const OutputGrid& grid, GDALDataset& dataset, std::span<const T> values, GDALDataType type) {
  return dataset.GetRasterBand(1)->RasterIO(GF_Write, 0, 0, static_cast<int>(grid.columns), static_cast<int>(grid.rows),
                                            const_cast<T*>(values.data()), static_cast<int>(grid.columns),
                                            static_cast<int>(grid.rows), type, 0, 0, nullptr);
}

}  // namespace

Result<std::string> WriteGeoTiff(const OutputGrid& grid, std::span<const float> heights) {
  ForgetGdalError();
  GDALDriver* const driver = FindDriver("GTiff");
  if (driver == nullptr) return CannotWrite("GTiff");
  const MemoryFile file(".tif");
  CPLStringList options;
  for (const char* option : {"TILED=YES", "COMPRESS=DEFLATE", "PREDICTOR=3", "ZLEVEL=1"}) options.AddString(option);
  {
    const GDALDatasetUniquePtr dataset(driver->Create(file.path(), static_cast<int>(grid.columns),
                                                      static_cast<int>(grid.rows), 1, GDT_Float32, options.List()));
    if (dataset == nullptr) return CannotWrite("GTiff");
    Place(grid, *dataset);
    dataset->GetRasterBand(1)->SetNoDataValue(std::numeric_limits<double>::quiet_NaN());
    dataset->GetRasterBand(1)->SetUnitType("metre");
    ForgetGdalError();  // of the CRS, which the sidecar tells
    if (WriteBand(grid, *dataset, heights, GDT_Float32) != CE_None) return CannotWrite("GTiff");
    dataset->FlushCache(/*bAtClosing=*/false);
  }
  if (file.has_sidecar()) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "format: GDAL cannot write EPSG:{} into a GeoTIFF; choose another crs, or another format, such as f32",
        grid.epsg);
  }
  if (HasGdalError()) return CannotWrite("GTiff");  // compressed blocks are written when GDAL's cache is flushed
  std::string bytes = file.Bytes();
  return bytes.empty() ? Result<std::string>(CannotWrite("GTiff")) : Result<std::string>(std::move(bytes));
}

Result<void> CheckGeoTiff(const OutputGrid& grid) {
  OutputGrid smallest = grid;
  smallest.columns = smallest.rows = 2;
  const auto written = WriteGeoTiff(smallest, std::array<float, 4>{});
  return written ? Result<void>() : tl::unexpected(written.error());
}

Result<std::string> WritePng16(const OutputGrid& grid, std::span<const std::uint16_t> values) {
  ForgetGdalError();
  GDALDriver* const memory = FindDriver("MEM");
  GDALDriver* const png = FindDriver("PNG");
  if (memory == nullptr || png == nullptr) return CannotWrite("PNG");
  const GDALDatasetUniquePtr source(
      memory->Create("", static_cast<int>(grid.columns), static_cast<int>(grid.rows), 1, GDT_UInt16, nullptr));
  if (source == nullptr || WriteBand(grid, *source, values, GDT_UInt16) != CE_None) return CannotWrite("MEM");
  const MemoryFile file(".png");
  CPLStringList options;
  options.AddString("ZLEVEL=3");
  {
    const GDALDatasetUniquePtr copy(
        png->CreateCopy(file.path(), source.get(), FALSE, options.List(), nullptr, nullptr));
    if (copy == nullptr) return CannotWrite("PNG");
  }
  std::string bytes = file.Bytes();
  return bytes.empty() ? Result<std::string>(CannotWrite("PNG")) : Result<std::string>(std::move(bytes));
}

}  // namespace terrace::dem
