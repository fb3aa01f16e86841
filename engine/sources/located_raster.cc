#include "engine/sources/located_raster.h"

#include <fmt/format.h>

#include <utility>

#include "engine/gdal/gdal_runtime.h"
#include "engine/gdal/raster_file.h"

namespace terrace::dem {

Result<LocatedRaster> LocateRaster(GDALDataset& dataset, const std::string& path,
                                   const std::optional<FileStamp>& before, int bands) {
  if (auto complete = CheckComplete(dataset, path, bands); !complete) return tl::unexpected(complete.error());
  auto files = StampedFiles::OfOpened(FilesOf(dataset, path), before);
  if (!files) return tl::unexpected(files.error());
  auto georeference = Georeference::Of(dataset, path);
  if (!georeference) return tl::unexpected(georeference.error());
  const auto spacing = SourceSpacing::Of(*georeference, path);
  if (!spacing) return tl::unexpected(spacing.error());
  return LocatedRaster{nullptr, *std::move(files), *std::move(georeference), *spacing, {}};
}

Result<LocatedRaster> OpenLocatedRaster(const std::string& path) {
  ForgetRemote(path);
  const auto before = StampOf(path);
  TakeGdalWarnings();  // earlier ones
  auto dataset = OpenRaster(path);
  if (!dataset) return tl::unexpected(dataset.error());
  std::vector<std::string> warnings = TakeGdalWarnings();
  for (std::string& warning : warnings) {
    warning = fmt::format("GDAL warns of this file: \"{}\"; check where it lies with gdalinfo", warning);
  }
  auto located = LocateRaster(**dataset, path, before);
  if (!located) return located;
  located->dataset = *std::move(dataset);
  located->warnings = std::move(warnings);
  return located;
}

}  // namespace terrace::dem
