#include "engine/gdal/vrt_check.h"

#include <cpl_minixml.h>
#include <cpl_string.h>
#include <fmt/format.h>
#include <gdal.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <system_error>

#include "engine/gdal/source_policy.h"

namespace terrace::dem {
namespace {

namespace fs = std::filesystem;

// gdalbuildvrt writes about 700 bytes per tile: this is enough for a country.
constexpr std::uintmax_t kMaxBytes = std::uintmax_t{64} << 20;
constexpr int kDeepestNesting = 4;  // nesting of VRTs

// The elements that gdalbuildvrt and `gdal_translate -of VRT` write. Only SourceFilename names a file.
constexpr std::string_view kElements =
    " VRTDataset SRS GeoTransform Metadata MDI OverviewList BlockXSize BlockYSize VRTRasterBand MaskBand"
    " NoDataValue NodataValue HideNoDataValue ColorInterp ColorTable Entry CategoryNames Category Description"
    " UnitType Offset Scale Histograms HistItem HistMin HistMax BucketCount IncludeOutOfRange Approximate"
    " HistCounts SimpleSource ComplexSource AveragedSource SourceFilename SourceBand SourceProperties SrcRect"
    " DstRect NODATA UseMaskBand ScaleOffset ScaleRatio LUT ColorTableComponent Exponent ";

bool IsKnown(std::string_view name) { return kElements.find(fmt::format(" {} ", name)) != std::string_view::npos; }

// Precondition: both paths have no links and dots.
bool IsInside(const fs::path& file, const fs::path& folder) {
  const auto [in_file, in_folder] = std::ranges::mismatch(file, folder);
  return in_folder == folder.end();
}

// GDAL reads the parts of a linked VRT beside the link's target. Links of folders are left to the file system.
fs::path FollowLinks(fs::path file) {
  constexpr int kMaxLinks = 40;  // as Linux
  std::error_code ignored;
  for (int i = 0; i < kMaxLinks && fs::is_symlink(file, ignored); ++i) {
    file = file.parent_path() / fs::read_symlink(file, ignored);
  }
  return file;
}

// Made absolute first, because a bare file name has no folder.
fs::path FolderOf(const fs::path& path, std::error_code& error) {
  return fs::canonical(fs::absolute(path, error).parent_path(), error);
}

class Checker {
 public:
  explicit Checker(fs::path top) : top_(std::move(top)) {}

  Result<void> Check(const fs::path& vrt, int depth) {
    std::error_code ignored;
    if (depth > kDeepestNesting || fs::file_size(vrt, ignored) > kMaxBytes) {
      return MakeError(ErrorCode::kInvalidArgument, "{}: is too large or nested too deeply for a VRT", vrt.string());
    }
    const CPLXMLTreeCloser tree(CPLParseXMLFile(vrt.c_str()));
    if (tree.get() == nullptr) return MakeError(ErrorCode::kInvalidArgument, "{}: is no valid VRT", vrt.string());
    return CheckNodes(tree.get(), vrt, depth);
  }

  std::vector<std::string> TakeParts() { return std::move(parts_); }

 private:
  Result<void> CheckNodes(const CPLXMLNode* node, const fs::path& vrt, int depth) {
    for (; node != nullptr; node = node->psNext) {
      // GDAL takes an attribute for the element of that name.
      for (const char* name : {"subClass", "SourceFilename"}) {
        if (node->eType == CXT_Attribute && EQUAL(node->pszValue, name)) return Refuse(vrt, name);
      }
      if (node->eType != CXT_Element) continue;
      const std::string_view name = node->pszValue;
      if (name == "?xml") continue;
      if (!IsKnown(name)) return Refuse(vrt, name);
      if (name == "SourceFilename") {
        if (auto checked = CheckPart(node, vrt, depth); !checked) return checked;
      } else if (auto checked = CheckNodes(node->psChild, vrt, depth); !checked) {
        return checked;
      }
    }
    return {};
  }

  static Result<void> Refuse(const fs::path& vrt, std::string_view what) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: a VRT here is a plain mosaic of files, without \"{}\"; make a raster of it with "
                     "gdal_translate",
                     vrt.string(), what);
  }

  Result<void> CheckPart(const CPLXMLNode* node, const fs::path& vrt, int depth) {
    fs::path part = CPLGetXMLValue(node, "", "");
    const auto fail = [&](const std::string& why) {
      return MakeError(ErrorCode::kInvalidArgument, "{}: a part of it: {}", vrt.string(), why);
    };
    // GDAL reads a number: "true" is 0.
    const std::string_view relative = CPLGetXMLValue(node, "relativeToVRT", "0");
    if (relative != "0" && relative != "1") {
      return fail(fmt::format("{}: its relativeToVRT is \"{}\"; write \"1\" or \"0\"", part.string(), relative));
    }
    if (relative == "1") part = vrt.parent_path() / part;
    parts_.push_back(part.string());
    if (IsAllowedRemote(part.string())) {
      // OpenRaster would look into the file, but a mosaic may have thousands of parts.
      const std::string ending = part.extension().string();
      if (EQUAL(ending.c_str(), ".tif") || EQUAL(ending.c_str(), ".tiff")) return {};
      return fail(fmt::format("{}: only GeoTIFFs (.tif, .tiff) are read over the network", part.string()));
    }
    std::error_code error;
    const fs::path real = fs::canonical(part, error);
    if (error)
      return fail(fmt::format("{}: is no file on this machine; copy it there, or make the VRT anew", part.string()));
    if (!HasDataRoots() && !IsInside(real, top_)) {
      return fail(fmt::format("{}: lies outside of the VRT's folder; name that folder in data_roots", part.string()));
    }
    if (auto plain = CheckPlainFile(part.string()); !plain) return fail(plain.error().message);
    return LooksLikeVrt(real) ? Check(real, depth + 1) : Result<void>();
  }

  const fs::path top_;  // the folder of the outermost VRT, canonical
  std::vector<std::string> parts_;
};

}  // namespace

bool LooksLikeVrt(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string head(1024, '\0');
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  return head.find("<VRTDataset") != std::string::npos || fs::path(path).extension() == ".vrt";
}

Result<void> CheckVrt(const std::string& path) {
  std::error_code error;
  const fs::path vrt = FollowLinks(path), folder = FolderOf(vrt, error);
  if (error) return MakeError(ErrorCode::kInvalidArgument, "{}: {}", path, error.message());
  return Checker(folder).Check(vrt, 0);
}

std::vector<std::string> PartsOfVrt(const std::string& path) {
  std::error_code error;
  const fs::path vrt = FollowLinks(path);
  Checker checker(FolderOf(vrt, error));
  static_cast<void>(checker.Check(vrt, 0));
  return checker.TakeParts();
}

}  // namespace terrace::dem
