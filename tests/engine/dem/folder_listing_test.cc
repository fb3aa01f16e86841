// Opening a file does not list its folder, which would be most of the work for thousands of files in one folder.
#include <gdal_priv.h>

#include <atomic>
#include <fstream>
#include <memory>
#include <string>

#include "engine/gdal/gdal_runtime.h"
#include "engine/gdal/raster_file.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

// A driver that GDAL tries for files that no other driver recognizes. It counts the files whose folder GDAL has listed.
class ListingProbe {
 public:
  ListingProbe() {
    InitGdal();
    asked_ = listed_ = 0;
    driver_ = std::make_unique<GDALDriver>();
    driver_->SetDescription("LISTING_PROBE");
    driver_->SetMetadataItem(GDAL_DCAP_RASTER, "YES");
    driver_->pfnOpen = [](GDALOpenInfo* info) -> GDALDataset* {
      ++asked_;
      if (info->GetSiblingFiles() != nullptr) ++listed_;
      return nullptr;
    };
    GetGDALDriverManager()->RegisterDriver(driver_.get());
  }
  ~ListingProbe() { GetGDALDriverManager()->DeregisterDriver(driver_.get()); }

  static int asked() { return asked_; }
  static int listed() { return listed_; }

 private:
  static inline std::atomic<int> asked_, listed_;
  std::unique_ptr<GDALDriver> driver_;
};

TEST(FolderListing, IsNotMadeToOpenAFile) {
  const TempDir dir;
  for (const char* name : {"one.unknown", "two.unknown"}) std::ofstream(dir.File(name)) << std::string(2000, 'x');
  const ListingProbe probe;
  EXPECT_FALSE(ElevationModel::Open(dir.File("one.unknown")));
  EXPECT_FALSE(IsRaster(dir.File("two.unknown")));
  EXPECT_GE(ListingProbe::asked(), 2);
  EXPECT_EQ(ListingProbe::listed(), 0);
}

}  // namespace
}  // namespace terrace::dem
