#include "engine/gdal/raster_file.h"

#include <cpl_conv.h>
#include <cpl_minixml.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <system_error>
#include <utility>

#include "engine/gdal/driver_list.h"
#include "engine/gdal/file_end.h"
#include "engine/gdal/gdal_runtime.h"
#include "engine/gdal/source_policy.h"
#include "engine/gdal/vrt_check.h"

namespace terrace::dem {
namespace {

// A one arc-second raster of the whole Earth has 1,296,000 columns.
constexpr int kMaxSide = 1 << 22;
constexpr std::int64_t kMaxSamples = std::int64_t{1} << 36;
// GDAL decodes whole storage blocks, whatever the size of its cache: a small file can declare a block of gigabytes.
constexpr std::int64_t kMaxBlockBytes = std::int64_t{128} << 20;
constexpr int kMaxBands = 4096;  // hyperspectral images have hundreds

constexpr unsigned kOpenFlags = GDAL_OF_RASTER | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR;

// During its lifetime, GDAL looks up files beside a raster by name, instead of listing the folder at each opening,
// which would take most of the time for thousands of rasters in one folder. For remote folders a listing is one
// request.
class LookUpSidecars {
 public:
  explicit LookUpSidecars(const std::string& path) {
    if (!IsAllowedRemote(path)) option_.emplace("GDAL_DISABLE_READDIR_ON_OPEN", "TRUE", /*bSetOnlyIfUndefined=*/false);
  }

 private:
  std::optional<CPLConfigOptionSetter> option_;  // for this thread
};

// The bytes that one read of a band decodes at least: a block, including interleaved bands.
std::int64_t BytesPerBlock(GDALDataset& dataset, GDALRasterBand& band) {
  int width = 0, height = 0;
  band.GetBlockSize(&width, &height);
  const char* const interleave = dataset.GetMetadataItem("INTERLEAVE", "IMAGE_STRUCTURE");
  const std::int64_t together = interleave != nullptr && EQUAL(interleave, "PIXEL") ? dataset.GetRasterCount() : 1;
  return std::int64_t{width} * height * GDALGetDataTypeSizeBytes(band.GetRasterDataType()) * together;
}

Result<void> CheckBlocks(GDALDataset& dataset, GDALRasterBand& band, const std::string& path) {
  const std::int64_t bytes = BytesPerBlock(dataset, band);
  if (bytes <= kMaxBlockBytes) return {};
  int width = 0, height = 0;
  band.GetBlockSize(&width, &height);
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: stored in blocks of {} x {} samples ({} MiB each), too large to read tiles from; rewrite it "
                   "with `gdal_translate -b 1 -co TILED=YES -co COMPRESS=DEFLATE in out.tif`",
                   path, width, height, bytes >> 20);
}

struct SizeLimits {
  std::int64_t side = 0, samples = 0;
  const char* of_what = "";
};

// The message names only the exceeded limit.
Result<void> CheckSize(const std::string& path, std::int64_t width, std::int64_t height, const SizeLimits& limits) {
  const bool is_too_long = std::max(width, height) > limits.side;
  if (!is_too_long && width * height <= limits.samples) return {};
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: {} x {} samples; {} may have {} {} at most: cut it with `gdal_translate -srcwin` or coarsen it "
                   "with `gdalwarp -tr`",
                   path, width, height, limits.of_what, is_too_long ? limits.side : limits.samples,
                   is_too_long ? "on a side" : "in all");
}

Result<void> CheckShape(GDALDataset& dataset, const std::string& path) {
  if (dataset.GetRasterCount() < 1) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: has no raster bands; a container needs the name of one of its rasters: list them with "
                     "`gdalinfo {}` and extract one with gdal_translate",
                     path, path);
  }
  GDALRasterBand& band = HeightBand(dataset);
  if (GDALDataTypeIsComplex(band.GetRasterDataType()) != 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: samples are complex numbers ({}), heights must be real; convert "
                     "with `gdal_translate -ot Float32 in out`",
                     path, GDALGetDataTypeName(band.GetRasterDataType()));
  }
  const std::int64_t width = dataset.GetRasterXSize(), height = dataset.GetRasterYSize();
  if (auto fits = CheckSize(path, width, height, {kMaxSide, kMaxSamples, "a raster that is served"}); !fits)
    return fits;
  if (dataset.GetRasterCount() > kMaxBands) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: has {} bands; take the one with heights out with "
                     "`gdal_translate -b 1 in out.tif`",
                     path, dataset.GetRasterCount());
  }
  if (auto blocks = CheckBlocks(dataset, band, path); !blocks) return blocks;
  if (auto links = CheckLinks(dataset, path); !links) return links;
  if (HasMaskBand(band)) {
    if (auto blocks = CheckBlocks(dataset, *band.GetMaskBand(), path); !blocks) return blocks;
  }
  for (int i = 0; i < band.GetOverviewCount(); ++i) {
    GDALRasterBand* const overview = band.GetOverview(i);
    if (overview == nullptr) continue;
    if (auto blocks = CheckBlocks(dataset, *overview, path); !blocks) return blocks;
  }
  return {};
}

// GDAL's drivers of several other formats (SRTMHGT, ENVI, HFA) return zeros for samples that the network did not
// deliver.
Result<void> CheckRemoteFormat(GDALDataset& dataset, const std::string& path) {
  if (!IsAllowedRemote(path) || EQUAL(dataset.GetDriverName(), "GTiff")) return {};
  return MakeError(
      ErrorCode::kInvalidArgument,
      "{}: is remote, and its format is {}: only GeoTIFFs are read over the network, because GDAL does not "
      "report failed reads of other formats; convert it with `gdal_translate -of COG in out.tif`, or copy it "
      "to this machine",
      path, dataset.GetDriverName());
}

// A lower bound of the end of a GeoTIFF's blocks, according to its directory.
class BlockEnds {
 public:
  explicit BlockEnds(GDALDataset& dataset) {
    const auto structure = [&dataset](const char* item) { return dataset.GetMetadataItem(item, "IMAGE_STRUCTURE"); };
    is_compressed_ = structure("COMPRESSION") != nullptr;
    const char* const interleave = structure("INTERLEAVE");
    bands_of_block_ = interleave != nullptr && EQUAL(interleave, "PIXEL") ? dataset.GetRasterCount() : 1;
  }

  std::uint64_t last() const { return last_; }

  void Add(GDALRasterBand& band) {
    int width = 0, height = 0;
    band.GetBlockSize(&width, &height);
    const int columns = (band.GetXSize() - 1) / width + 1, rows = (band.GetYSize() - 1) / height + 1;
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns && looked_at_ < kMaxBlocks; ++column, ++looked_at_) {
        const std::uint64_t offset = Tell(band, "BLOCK_OFFSET", column, row);
        if (offset == 0) continue;  // a sparse block: zeros
        std::uint64_t bytes = Tell(band, "BLOCK_SIZE", column, row);
        // The last strip may state the size of a whole strip, but is read only as far as its rows; tiles are read
        // whole.
        const int strip_rows = std::min(height, band.GetYSize() - row * height);
        if (!is_compressed_)
          bytes = std::min(bytes, BytesOf(band, width, width == band.GetXSize() ? strip_rows : height));
        last_ = std::max(last_, offset + bytes);
      }
    }
  }

 private:
  static constexpr std::int64_t kMaxBlocks = std::int64_t{1} << 20;  // half a second

  static std::uint64_t Tell(GDALRasterBand& band, const char* what, int column, int row) {
    const char* const text = band.GetMetadataItem(fmt::format("{}_{}_{}", what, column, row).c_str(), "TIFF");
    return text == nullptr ? 0 : std::strtoull(text, nullptr, 10);
  }

  // A lower bound: samples of less than a byte count as nothing.
  std::uint64_t BytesOf(GDALRasterBand& band, int width, int rows) const {
    const char* const bits = band.GetMetadataItem("NBITS", "IMAGE_STRUCTURE");
    if (bits != nullptr) return 1;
    const auto sample = static_cast<std::uint64_t>(GDALGetDataTypeSizeBytes(band.GetRasterDataType()));
    return sample * static_cast<std::uint64_t>(bands_of_block_) * static_cast<std::uint64_t>(width) *
           static_cast<std::uint64_t>(rows);
  }

  bool is_compressed_ = false;
  int bands_of_block_ = 1;
  std::int64_t looked_at_ = 0;
  std::uint64_t last_ = 0;
};

// Of a GeoTIFF.
std::uint64_t EndOfBlocks(GDALDataset& dataset, const std::string& path, int bands) {
  const bool has_own_overviews = SidecarOf(path, ".ovr").empty(), has_own_mask = SidecarOf(path, ".msk").empty();
  BlockEnds ends(dataset);
  for (int number = 1; number <= std::min(bands, dataset.GetRasterCount()); ++number) {
    GDALRasterBand& band = *dataset.GetRasterBand(number);
    ends.Add(band);
    for (int i = 0; has_own_overviews && i < band.GetOverviewCount(); ++i) {
      if (GDALRasterBand* const overview = band.GetOverview(i)) ends.Add(*overview);
    }
    if (has_own_mask && HasMaskBand(band)) ends.Add(*band.GetMaskBand());
  }
  return ends.last();
}

// GDAL reads no description that begins with an XML declaration (`<?xml version="1.0"?>`).
bool IsReadableDescription(const std::string& file) {
  const CPLXMLTreeCloser tree(CPLParseXMLFile(file.c_str()));
  ForgetGdalError();
  return tree != nullptr && tree->eType == CXT_Element && tree->pszValue[0] != '?';
}

// Whether a band has a mask that is no alpha band.
bool HasMaskOfItsOwn(GDALDataset& dataset) {
  for (int i = 1; i <= dataset.GetRasterCount(); ++i) {
    GDALRasterBand& band = *dataset.GetRasterBand(i);
    if (HasMaskBand(band) && (band.GetMaskFlags() & GMF_ALPHA) == 0) return true;
  }
  return false;
}

// GDAL ignores sidecars that it cannot read, and would so make heights of the voids that they declare. It reads no
// description (.aux.xml) of a VRT.
Result<void> CheckSidecarsAreRead(GDALDataset& dataset, const std::string& path) {
  if (IsAllowedRemote(path)) return {};
  const auto refuse = [](const std::string& file, std::string_view what) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: is not used by GDAL: {}; write it again, or remove it", file,
                     what);
  };
  std::error_code unknown;
  const std::string mask = SidecarOf(path, ".msk"), description = path + ".aux.xml";
  if (std::filesystem::is_regular_file(mask, unknown) && !HasMaskOfItsOwn(dataset)) {
    return refuse(mask, "it cannot be read as a raster, or the metadata INTERNAL_MASK_FLAGS_1 of its dataset is not 2");
  }
  const bool is_described = std::filesystem::is_regular_file(description, unknown);
  if (is_described && !EQUAL(dataset.GetDriverName(), "VRT") && !IsReadableDescription(description)) {
    return refuse(description, "it cannot be read as XML, or begins with an XML declaration (\"<?xml\")");
  }
  return {};
}

Error CutShort(const std::string& path, std::uint64_t size, std::uint64_t end) {
  return {ErrorCode::kUnavailable,
          fmt::format("{}: is cut short: it has {} bytes, and its last samples lie up to byte {}; copy it again", path,
                      size, end)};
}

// What GDAL's own message, "not recognized as a supported file format", does not say.
std::optional<Error> ExplainUnrecognized(const std::string& path) {
  if (IsAllowedRemote(path)) return std::nullopt;
  std::error_code unknown;
  std::string start(64, '\0');
  std::ifstream(path, std::ios::binary).read(start.data(), static_cast<std::streamsize>(start.size()));
  const std::uint64_t size = std::filesystem::file_size(path, unknown), end = EndOfHdf5(start);
  if (!unknown && size < end) return CutShort(path, size, end);
  const std::string ending = CPLGetExtension(path.c_str());
  if (EQUAL(ending.c_str(), "hgt")) {
    return Error{
        ErrorCode::kInvalidArgument,
        fmt::format("{}: its name or size is not that of an SRTM cell; name it by its south-western corner, as "
                    "N46E008.hgt, and check its size: 1201 x 1201 or 3601 x 3601 samples of two bytes",
                    path)};
  }
  const auto beside = [&](const char* other) { return std::filesystem::path(path).replace_extension(other); };
  if (EQUAL(ending.c_str(), "sgrd")) {
    const char* const samples = std::filesystem::exists(beside("SDAT"), unknown) ? "SDAT" : "sdat";
    return Error{ErrorCode::kInvalidArgument,
                 fmt::format("{}: is the header of a SAGA raster; name the file with its samples, {}", path,
                             beside(samples).string())};
  }
  const std::filesystem::path header = beside(ending == "SDAT" ? "SGRD" : "sgrd");
  if (EQUAL(ending.c_str(), "sdat") && !std::filesystem::exists(header, unknown)) {
    return Error{ErrorCode::kInvalidArgument,
                 fmt::format("{}: its header {} is missing; copy it there, or rename it so that its name has these "
                             "capital and small letters",
                             path, header.string())};
  }
  return std::nullopt;
}

Error CannotOpen(const std::string& path, const std::string& problem) {
  const LookUpSidecars looked_up(path);
  const bool is_of_allowed = GDALIdentifyDriverEx(path.c_str(), GDAL_OF_RASTER, nullptr, nullptr) != nullptr;
  if (const auto format = LeftOutDriverOf(path); format && !is_of_allowed) {
    return {ErrorCode::kInvalidArgument,
            fmt::format("{}: its format, {}, is not among the allowed_drivers; add \"{}\" to them, or convert the file "
                        "with `gdal_translate in out.tif`",
                        path, *format, *format)};
  }
  if (std::optional<Error> known = ExplainUnrecognized(path)) return *std::move(known);
  const std::string ending = CPLGetExtension(path.c_str());
  const bool is_packed = EQUAL(ending.c_str(), "zip") || EQUAL(ending.c_str(), "gz") || EQUAL(ending.c_str(), "tar");
  return {ErrorCode::kInvalidArgument,
          fmt::format("{}: cannot be opened as a raster ({}); {}", path, problem,
                      is_packed ? "extract the raster from it"
                                : fmt::format("check the file with `gdalinfo {}` and its permissions", path))};
}

Result<void> CheckEnd(GDALDataset& dataset, const std::string& path, int bands) {
  std::error_code unknown;
  const std::uint64_t size = std::filesystem::file_size(path, unknown);
  if (unknown) return {};
  const std::uint64_t end =
      EQUAL(dataset.GetDriverName(), "GTiff") ? EndOfBlocks(dataset, path, bands) : EndOfSamples(dataset, path);
  if (end <= size) return {};
  return tl::unexpected(CutShort(path, size, end));
}

// GDAL opens a part of a VRT when it reads from it. It takes a part that cannot be opened for one without data, returns
// zeros for the end of some truncated parts, and heights for voids of a damaged sidecar. Reads of a truncated GeoTIFF
// fail, so that those of which the VRT uses the intact part are accepted.
Result<void> CheckParts(const std::string& vrt) {
  std::set<std::string> known;
  for (const std::string& part : PartsOfVrt(vrt)) {
    if (IsAllowedRemote(part) || !known.insert(part).second) continue;
    const auto refuse = [&](const Error& error) {
      return MakeError(error.code, "{}: a part of it: {}", vrt, error.message);
    };
    const GDALDatasetUniquePtr dataset = ReopenRaster(part);
    if (dataset == nullptr || dataset->GetRasterCount() < 1) return refuse(CannotOpen(part, TakeGdalError()));
    if (auto links = CheckNoLinks(*dataset, part); !links) return refuse(links.error());
    if (auto sidecars = CheckSidecarsAreRead(*dataset, part); !sidecars) return refuse(sidecars.error());
    if (EQUAL(dataset->GetDriverName(), "GTiff") || EQUAL(dataset->GetDriverName(), "VRT")) continue;
    if (auto complete = CheckEnd(*dataset, part, 1); !complete) return refuse(complete.error());
  }
  return {};
}

// Whether the driver reports an error of a tile that it cannot decode, fills in zeros and returns success. Of other
// drivers, errors during a successful read are harmless: a VRT opens its parts then.
bool HidesErrors(GDALRasterBand& band) {
  GDALDataset* const dataset = band.GetDataset();
  const std::string driver = dataset == nullptr ? "" : dataset->GetDriverName();
  return driver == "GPKG" || driver == "MBTiles";
}

}  // namespace

Result<void> CheckSizeToMesh(const std::string& path, int width, int height) {
  // Two gigabytes of floats: a raster that is meshed in one piece must fit into memory several times.
  constexpr std::int64_t kMaxSamples = std::int64_t{1} << 29;
  constexpr int kMaxPerSide = 1 << 15;  // the mesher's coordinates have 15 bits
  return CheckSize(path, width, height, {kMaxPerSide, kMaxSamples, "a mesh"});
}

void ForgetRemote(const std::string& path) {
  if (!AllowsRemote()) return;
  if (IsAllowedRemote(path)) return VSICurlPartialClearCache(path.c_str());
  if (path.starts_with("/vsi") || !CheckSourceName(path) || !LooksLikeVrt(path)) return;
  for (const std::string& part : PartsOfVrt(path)) {
    if (IsAllowedRemote(part)) VSICurlPartialClearCache(part.c_str());
  }
}

bool IsRaster(const std::string& path) {
  // GDAL's driver for ESRI's .hdr accepts any file beside a header as the raster.
  for (const char* sidecar : {"ovr", "msk", "aux", "rrd", "hdr", "prj", "qpj", "stx", "clr", "blw", "tfw", "wld"}) {
    if (EQUAL(CPLGetExtension(path.c_str()), sidecar)) return false;
  }
  if (path.ends_with(".aux.xml")) return false;
  InitGdal();
  if (!CheckPlainFile(path)) return true;  // opening it reports why not
  const LookUpSidecars looked_up(path);
  return GDALIdentifyDriverEx(path.c_str(), GDAL_OF_RASTER, nullptr, nullptr) != nullptr;
}

GDALDatasetUniquePtr ReopenRaster(const std::string& path, int overview) {
  InitGdal();
  ForgetGdalError();
  const std::string level = fmt::format("OVERVIEW_LEVEL={}", overview);
  const char* const options[] = {overview < 0 ? nullptr : level.c_str(), nullptr};
  const auto open = [&] { return GDALDatasetUniquePtr(GDALDataset::Open(path.c_str(), kOpenFlags, nullptr, options)); };
  {
    const LookUpSidecars looked_up(path);
    if (GDALDatasetUniquePtr dataset = open()) return dataset;
  }
  // By name, GDAL does not find dem.HDR, the header of dem.bil; in a listing, it does.
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(std::filesystem::path(path).replace_extension("HDR"), ignored)) return nullptr;
  return open();
}

Result<GDALDatasetUniquePtr> OpenRaster(const std::string& path, int overview) {
  InitGdal();
  if (auto name = CheckSourceName(path); !name) return tl::unexpected(name.error());
  GDALDatasetUniquePtr dataset = ReopenRaster(path, overview);
  if (dataset == nullptr) {
    return tl::unexpected(CannotOpen(path, TakeGdalError()));
  }
  if (auto format = CheckRemoteFormat(*dataset, path); !format) return tl::unexpected(format.error());
  if (auto shape = CheckShape(*dataset, path); !shape) return tl::unexpected(shape.error());
  // An overview need not have a mask of its own, and may be one sample wide.
  if (overview >= 0) return dataset;
  if (dataset->GetRasterXSize() < 2 || dataset->GetRasterYSize() < 2) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: {} x {} samples are no surface; at least 2 x 2 are needed", path,
                     dataset->GetRasterXSize(), dataset->GetRasterYSize());
  }
  if (auto sidecars = CheckSidecarsAreRead(*dataset, path); !sidecars) return tl::unexpected(sidecars.error());
  return dataset;
}

bool ReadRaw(GDALRasterBand& band, int col, int row, int cols, int rows, GDALDataType type, void* out) {
  ForgetGdalError();
  if (band.RasterIO(GF_Read, col, row, cols, rows, out, cols, rows, type, 0, 0, nullptr) != CE_None) return false;
  if (!HasGdalError() || !HidesErrors(band)) return true;
  band.FlushCache(/*bAtClosing=*/false);  // else the next read would find the zeros
  return false;
}

Result<void> CheckComplete(GDALDataset& dataset, const std::string& path, int bands) {
  if (IsAllowedRemote(path)) return {};
  return EQUAL(dataset.GetDriverName(), "VRT") ? CheckParts(path) : CheckEnd(dataset, path, bands);
}

bool HasMaskBand(GDALRasterBand& band) {
  const int flags = band.GetMaskFlags();
  return (flags & GMF_PER_DATASET) != 0 || flags == 0;  // 0: a mask of this band alone
}

std::string PictureColorOf(GDALRasterBand& band) {
  const GDALColorInterp part = band.GetColorInterpretation();
  const bool is_picture = part != GCI_Undefined && part != GCI_GrayIndex && part != GCI_AlphaBand;
  return is_picture ? GDALGetColorInterpretationName(part) : "";
}

bool HasFileEndingWith(GDALDataset& dataset, std::string_view ending) {
  const CPLStringList files(dataset.GetFileList());
  return std::any_of(files.List(), files.List() + files.Count(),
                     [&](const char* file) { return std::string_view(file).ends_with(ending); });
}

std::vector<std::string> FilesOf(GDALDataset& dataset, const std::string& path) {
  std::vector<std::string> files = {path};
  const CPLStringList list(dataset.GetFileList());
  for (int i = 0; i < list.Count(); ++i) {
    if (path != list[i]) files.emplace_back(list[i]);
  }
  if (IsAllowedRemote(path) || !LooksLikeVrt(path)) return files;
  std::set<std::string> known(files.begin(), files.end());
  for (const std::string& part : PartsOfVrt(path)) {
    if (known.insert(part).second) files.push_back(part);
    if (IsAllowedRemote(part)) continue;  // each file beside it would take a request
    for (std::string& name : SidecarsOf(part)) {
      if (known.insert(name).second) files.push_back(std::move(name));
    }
  }
  return files;
}

}  // namespace terrace::dem
