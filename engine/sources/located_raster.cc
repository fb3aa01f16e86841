#include "engine/sources/located_raster.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "engine/gdal/gdal_runtime.h"
#include "engine/gdal/raster_file.h"

namespace terrace::dem {

namespace {

// What GDAL has warned of on this thread, without what says nothing about samples and positions (the order of a TIFF's
// tags, and requests that were repeated) and without rows that are not evenly spaced, which Georeference::Of measures.
std::vector<std::string> WarningsOfGdal(const std::string& path) {
  std::vector<std::string> warnings;
  const std::string name = path.substr(path.rfind('/') + 1) + ": ";
  for (std::string text : TakeGdalWarnings()) {
    if (text.starts_with(name)) text.erase(0, name.size());
    if (text.starts_with("Latitude grid not spaced evenly") || text.starts_with("TIFFReadDirectory") ||
        text.find("Retrying again") != std::string::npos)
      continue;
    while (text.ends_with('.')) text.pop_back();
    std::string warning = fmt::format("GDAL warns: {}; `gdalinfo` shows what it reads", text);
    if (std::ranges::find(warnings, warning) == warnings.end()) warnings.push_back(std::move(warning));
  }
  return warnings;
}

}  // namespace

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
  auto located = LocateRaster(**dataset, path, before);
  if (!located) return located;
  located->dataset = *std::move(dataset);
  located->warnings = WarningsOfGdal(path);  // some formats read the reference system only when it is asked for
  return located;
}

}  // namespace terrace::dem
