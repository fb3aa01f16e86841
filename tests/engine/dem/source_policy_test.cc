// Names of sources that are not plain files are rejected before GDAL gets them, without network access and without
// opening files outside the data roots.
#include "engine/gdal/source_policy.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gdal_priv.h>
#include <poll.h>
#include <sys/inotify.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <set>
#include <thread>

#include "engine/gdal/gdal_runtime.h"
#include "engine/gdal/raster_file.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

namespace fs = std::filesystem;

// Accepts connections on a free port and counts them.
class Listener {
 public:
  Listener() : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(socket_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(socket_, 64), 0);
    ::getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
    thread_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        pollfd ready{socket_, POLLIN, 0};
        if (::poll(&ready, 1, 20) > 0) {
          ++hits_;
          ::close(::accept(socket_, nullptr, nullptr));
        }
      }
    });
  }
  ~Listener() {
    thread_ = {};
    ::close(socket_);
  }
  std::string url(const std::string& path) const { return fmt::format("http://127.0.0.1:{}/{}", port_, path); }
  std::string host() const { return fmt::format("127.0.0.1:{}", port_); }
  int hits() const { return hits_; }

 private:
  int socket_, port_ = 0;
  std::atomic<int> hits_ = 0;
  std::jthread thread_;
};

std::string NamingOverviews(const fs::path& file) {
  return "<PAMDataset><Metadata domain=\"OVERVIEWS\"><MDI key=\"OVERVIEW_FILE\">" + file.string() +
         "</MDI></Metadata></PAMDataset>";
}

// Records which files of a folder are opened.
class OpenWatch {
 public:
  explicit OpenWatch(const fs::path& folder) : queue_(::inotify_init1(IN_NONBLOCK)) {
    EXPECT_GE(::inotify_add_watch(queue_, folder.c_str(), IN_OPEN), 0);
  }
  ~OpenWatch() { ::close(queue_); }
  std::set<std::string> Opened() const {
    std::set<std::string> names;
    alignas(inotify_event) char buffer[1 << 16];
    for (ssize_t got = 0; (got = ::read(queue_, buffer, sizeof buffer)) > 0;) {
      for (ssize_t at = 0; at < got;) {
        const auto* event = reinterpret_cast<const inotify_event*>(buffer + at);
        if (event->len > 0) names.insert(event->name);
        at += static_cast<ssize_t>(sizeof(inotify_event) + event->len);
      }
    }
    return names;
  }

 private:
  int queue_;
};

void Write(const fs::path& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

std::string Vrt(const std::string& source_xml) {
  return R"(<VRTDataset rasterXSize="16" rasterYSize="16"><SRS>EPSG:4326</SRS><GeoTransform>0, 1, 0, 0, 0, -1</GeoTransform>
    <VRTRasterBand dataType="Float32" band="1">)" +
         source_xml + "</VRTRasterBand></VRTDataset>";
}
std::string Part(const std::string& name, bool relative = false) {
  return fmt::format(
      "<SimpleSource><SourceFilename relativeToVRT=\"{}\">{}</SourceFilename><SourceBand>1</SourceBand></SimpleSource>",
      relative ? 1 : 0, name);
}

class SourcePolicyTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directory(root_);
    fs::create_directory(outside_);
    WriteRaster(dir_, {}, "root/dem.tif");
    WriteRaster(dir_, {}, "outside/secret.tif");
    Allow({.roots = {root_.string()}});
  }
  void TearDown() override { Allow({}); }
  static void Allow(const SourcePolicy& policy) {
    const auto set = SetSourcePolicy(policy);
    ASSERT_TRUE(set) << set.error().message;
  }
  static std::vector<std::string> WithVrt() {
    std::vector<std::string> drivers = {"VRT", "GTiff"};
    return drivers;
  }

  TempDir dir_;
  const fs::path root_ = dir_.path() / "root", outside_ = dir_.path() / "outside";
  Listener web_;
};

TEST_F(SourcePolicyTest, RefusesNamesThatAreMoreThanFiles) {
  const std::string inside = (root_ / "dem.tif").string(), secret = (outside_ / "secret.tif").string();
  fs::create_symlink(secret, root_ / "link.tif");
  fs::create_directory_symlink(outside_, root_ / "folder");
  ::mkfifo((root_ / "pipe.tif").c_str(), 0600);
  Write(root_ / "inline.tif", Vrt(Part(secret)));
  Write(root_ / "web.vrt", Vrt(Part("/vsicurl/" + web_.url("a.tif"))));
  Write(root_ / "wms.tif",
        "<GDAL_WMS><Service name=\"TMS\"><ServerUrl>" + web_.url("${z}/${x}/${y}.png") +
            "</ServerUrl></Service><DataWindow><UpperLeftX>-180</UpperLeftX></DataWindow></GDAL_WMS>");
  Write(root_ / "wcs.tif",
        "<WCS_GDAL><ServiceURL>" + web_.url("?") + "</ServiceURL><CoverageName>a</CoverageName></WCS_GDAL>");
  Write(root_ / "wmts.xml", "<GDAL_WMTS><GetCapabilitiesUrl>" + web_.url("wmts") + "</GetCapabilitiesUrl></GDAL_WMTS>");
  const std::vector<std::string> names = {
      // Programs.
      Vrt(Part(secret)),
      Vrt(Part("/etc/passwd")),
      "<GDAL_WMS><Service name=\"TMS\"><ServerUrl>" + web_.url("a") + "</ServerUrl></Service></GDAL_WMS>",
      "<GDAL_WMTS><GetCapabilitiesUrl>" + web_.url("a") + "</GetCapabilitiesUrl></GDAL_WMTS>",
      "MEM:::DATAPOINTER=1,PIXELS=64,LINES=64,DATATYPE=Float32",
      "vrt://" + secret + "?bands=1",
      "DERIVED_SUBDATASET:AMPLITUDE:" + secret,
      // Parts of containers.
      "GTIFF_DIR:1:" + secret,
      "GTIFF_RAW:" + secret,
      "NETCDF:\"" + secret + "\":z",
      "HDF5:\"" + secret + "\"://z",
      "GPKG:" + secret + ":z",
      "ZARR:\"" + secret + "\":/z",
      "SENTINEL2_L1C:" + secret + ":10m:EPSG_32632",
      // The network.
      web_.url("dem.tif"),
      "https://" + web_.host() + "/dem.tif",
      "ftp://" + web_.host() + "/dem.tif",
      "WMS:" + web_.url("?SERVICE=WMS"),
      "WMTS:" + web_.url("wmts"),
      "WCS:" + web_.url("wcs"),
      "OGCAPI:" + web_.url("api"),
      "STACTA:" + web_.url("stac"),
      "PG:host=127.0.0.1 dbname=a table=b",
      "NGW:" + web_.url("resource/1"),
      "EEDAI:image",
      "PLMOSAIC:mosaic=a",
      // File systems of GDAL's.
      "/vsicurl/" + web_.url("dem.tif"),
      "/vsicurl?url=" + web_.url("dem.tif"),
      "/vsicurl_streaming/" + web_.url("dem.tif"),
      "/vsizip//vsicurl/" + web_.url("a.zip/a.tif"),
      "/vsitar/{/vsicurl/" + web_.url("a.tar") + "}/a.tif",
      "/vsigzip//vsicurl/" + web_.url("a.gz"),
      "/vsis3/bucket/dem.tif",
      "/vsigs/bucket/dem.tif",
      "/vsiaz/container/dem.tif",
      "/vsiswift/container/dem.tif",
      "/vsiwebhdfs/" + web_.url("webhdfs/v1/dem.tif"),
      "/vsistdin/",
      "/vsistdin?buffer_limit=1GB",
      "/vsimem/dem.tif",
      "/vsisubfile/0_100," + secret,
      "/vsisparse/" + secret,
      "/vsicrypt/key=0123456789012345," + secret,
      "/vsicached?file=" + secret,
      "/vsizip/" + secret + "/a.tif",
      // Other ways out of the root.
      secret,
      inside + "/../../outside/secret.tif",
      (root_ / ".." / "outside" / "secret.tif").string(),
      (root_ / "link.tif").string(),
      (root_ / "folder" / "secret.tif").string(),
      (root_ / "pipe.tif").string(),
      root_.string(),
      "/proc/self/mem",
      "/proc/self/fd/0",
      "/dev/zero",
      "/dev/stdin",
      inside + std::string(1, '\n'),
      "",
      // Programs in files with innocent names.
      (root_ / "inline.tif").string(),
      (root_ / "web.vrt").string(),
      (root_ / "wms.tif").string(),
      (root_ / "wcs.tif").string(),
      (root_ / "wmts.xml").string(),
  };
  EXPECT_GE(names.size(), 40u);
  RecordProperty("names", static_cast<int>(names.size()));
  const OpenWatch watch(outside_);
  for (const std::string& name : names) {
    const auto opened = OpenRaster(name);
    EXPECT_FALSE(opened) << name;
    EXPECT_FALSE(ElevationModel::Open(name)) << name;
  }
  ASSERT_TRUE(OpenRaster(inside)) << "the table is refused for the wrong reason";
  EXPECT_EQ(watch.Opened(), std::set<std::string>());
  EXPECT_EQ(web_.hits(), 0);
}

TEST_F(SourcePolicyTest, TheWatchesSee) {
  const OpenWatch watch(outside_);
  { std::ifstream(outside_ / "secret.tif").get(); }
  EXPECT_EQ(watch.Opened(), std::set<std::string>{"secret.tif"});
  const int client = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(web_.host().substr(web_.host().find(':') + 1))));
  ASSERT_EQ(::connect(client, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  for (int i = 0; i < 200 && web_.hits() == 0; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  ::close(client);
  EXPECT_EQ(web_.hits(), 1);
}

// Even if a name is accepted, GDAL cannot reach what the file refers to.
TEST_F(SourcePolicyTest, GdalItselfReachesNoNetwork) {
  for (const std::string& name :
       {"/vsicurl/" + web_.url("dem.tif"), "/vsicurl_streaming/" + web_.url("dem.tif"), web_.url("dem.tif"),
        "WMS:" + web_.url("?SERVICE=WMS"), "/vsizip//vsicurl/" + web_.url("a.zip/a.tif")}) {
    EXPECT_EQ(ReopenRaster(name), nullptr) << name;
    VSIStatBufL status;
    EXPECT_NE(VSIStatL(name.c_str(), &status), 0) << name;
  }
  EXPECT_EQ(web_.hits(), 0);
}

TEST_F(SourcePolicyTest, OpensWhatLiesUnderTheRoots) {
  EXPECT_TRUE(OpenRaster((root_ / "dem.tif").string()));
  fs::create_symlink(root_ / "dem.tif", root_ / "again.tif");
  EXPECT_TRUE(OpenRaster((root_ / "again.tif").string()));
  const auto refused = OpenRaster((outside_ / "secret.tif").string());
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("lies outside of the data roots"), std::string::npos);
  EXPECT_NE(refused.error().message.find("data_roots"), std::string::npos);
}

TEST_F(SourcePolicyTest, WithoutRootsAnyRegularFileMayBeOpened) {
  Allow({});
  EXPECT_TRUE(OpenRaster((outside_ / "secret.tif").string()));
  EXPECT_FALSE(OpenRaster("/dev/zero"));
}

TEST_F(SourcePolicyTest, OpensAMosaicOfFilesWhereVrtIsListed) {
  Write(root_ / "mosaic.vrt", Vrt(Part("dem.tif", true)));
  const auto refused = OpenRaster((root_ / "mosaic.vrt").string());
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("list \"VRT\" in allowed_drivers"), std::string::npos);
  Allow({.roots = {root_.string()}, .drivers = WithVrt()});
  const auto opened = OpenRaster((root_ / "mosaic.vrt").string());
  ASSERT_TRUE(opened) << opened.error().message;
  Write(root_ / "nested.vrt", Vrt(Part("mosaic.vrt", true)));
  EXPECT_TRUE(OpenRaster((root_ / "nested.vrt").string()));
}

TEST_F(SourcePolicyTest, RefusesVrtsThatDoMoreOrLeadElsewhere) {
  const std::string secret = (outside_ / "secret.tif").string();
  fs::create_symlink(secret, root_ / "link.tif");
  Write(root_ / "loop.vrt", Vrt(Part("loop.vrt", true)));
  Write(root_ / "inner.vrt", Vrt(Part(secret)));
  Write(root_ / "disguised.tif", Vrt(Part(secret)));
  const std::string python =
      "<VRTDataset rasterXSize=\"2\" rasterYSize=\"2\"><VRTRasterBand dataType=\"Byte\" band=\"1\" "
      "subClass=\"VRTDerivedRasterBand\"><PixelFunctionLanguage>Python</PixelFunctionLanguage>"
      "<PixelFunctionType>a.b</PixelFunctionType></VRTRasterBand></VRTDataset>";
  const std::string raw =
      "<VRTDataset rasterXSize=\"16\" rasterYSize=\"16\"><VRTRasterBand dataType=\"Byte\" band=\"1\" "
      "subClass=\"VRTRawRasterBand\"><SourceFilename>" +
      secret + "</SourceFilename></VRTRasterBand></VRTDataset>";
  const std::string warped =
      "<VRTDataset rasterXSize=\"16\" rasterYSize=\"16\" subClass=\"VRTWarpedDataset\">"
      "<GDALWarpOptions><SourceDataset>" +
      secret + "</SourceDataset></GDALWarpOptions></VRTDataset>";
  const std::string options =
      Vrt("<SimpleSource><SourceFilename relativeToVRT=\"1\">dem.tif</SourceFilename><OpenOptions>"
          "<OOI key=\"GEOREF_SOURCES\">NONE</OOI></OpenOptions></SimpleSource>");
  const std::string attribute =
      Vrt("<SimpleSource SourceFilename=\"" + secret + "\"><SourceBand>1</SourceBand></SimpleSource>");
  const std::string group = "<VRTDataset><Group name=\"/\"><Array name=\"a\"><Source><SourceFilename>" + secret +
                            "</SourceFilename></Source></Array></Group></VRTDataset>";
  Allow({.roots = {root_.string()}, .drivers = WithVrt()});
  const OpenWatch watch(outside_);
  for (const std::string& xml : {Vrt(Part(secret)),
                                 Vrt(Part("../outside/secret.tif", true)),
                                 Vrt(Part("link.tif", true)),
                                 Vrt(Part("inner.vrt", true)),
                                 Vrt(Part("loop.vrt", true)),
                                 Vrt(Part("disguised.tif", true)),
                                 Vrt(Part("/vsicurl/" + web_.url("a.tif"))),
                                 Vrt(Part("/vsizip/" + secret)),
                                 Vrt(Part("vrt://" + secret)),
                                 Vrt(Part("&lt;VRTDataset/&gt;")),
                                 Vrt(Part("GTIFF_DIR:1:" + secret)),
                                 Vrt("<KernelFilteredSource/>"),
                                 python,
                                 raw,
                                 warped,
                                 options,
                                 attribute,
                                 group,
                                 std::string("<VRTDataset"),
                                 std::string("not XML")}) {
    Write(root_ / "hostile.vrt", xml);
    EXPECT_FALSE(OpenRaster((root_ / "hostile.vrt").string())) << xml;
  }
  EXPECT_EQ(watch.Opened(), std::set<std::string>());
  EXPECT_EQ(web_.hits(), 0);
}

// Of relativeToVRT GDAL reads a number: the names would be relative to another folder than the one that is checked.
TEST_F(SourcePolicyTest, WhetherAPartIsRelativeIsADigit) {
  Allow({.roots = {root_.string()}, .drivers = WithVrt()});
  for (const char* relative : {"true", "yes", "on", "", "2", "1x"}) {
    Write(root_ / "mosaic.vrt", Vrt(fmt::format("<SimpleSource><SourceFilename relativeToVRT=\"{}\">dem.tif"
                                                "</SourceFilename><SourceBand>1</SourceBand></SimpleSource>",
                                                relative)));
    const auto refused = OpenRaster((root_ / "mosaic.vrt").string());
    ASSERT_FALSE(refused) << relative;
    EXPECT_NE(refused.error().message.find("relativeToVRT"), std::string::npos) << refused.error().message;
  }
}

TEST_F(SourcePolicyTest, OfALinkToAVrtTheTargetCounts) {
  for (const char* folder : {"2024", "links"}) fs::create_directory(root_ / folder);
  const std::string part = WriteRaster(dir_, {}, "root/2024/x.tif");
  Write(root_ / "2024" / "m.vrt", Vrt(Part("x.tif", true)));
  fs::create_symlink("2024/m.vrt", root_ / "latest.vrt");
  fs::create_symlink("../latest.vrt", root_ / "links" / "again.vrt");
  Write(root_ / "nested.vrt", Vrt(Part("links/again.vrt", true)));
  for (const auto& roots : {std::vector<std::string>{}, std::vector<std::string>{root_.string()}}) {
    Allow({.roots = roots, .drivers = WithVrt()});
    for (const char* name : {"latest.vrt", "links/again.vrt", "nested.vrt"}) {
      const auto opened = ElevationModel::Open((root_ / name).string());
      EXPECT_TRUE(opened) << opened.error().message;
    }
  }
  // A part beside the link is not the one that GDAL reads.
  fs::copy(part, root_ / "x.tif");
  fs::remove(part);
  fs::create_symlink(outside_ / "secret.tif", part);
  for (const char* name : {"latest.vrt", "nested.vrt"}) EXPECT_FALSE(OpenRaster((root_ / name).string())) << name;
}

TEST_F(SourcePolicyTest, WithoutRootsAVrtStaysInItsFolder) {
  Allow({.drivers = WithVrt()});
  Write(root_ / "mosaic.vrt", Vrt(Part("dem.tif", true)));
  EXPECT_TRUE(OpenRaster((root_ / "mosaic.vrt").string()));
  Write(root_ / "out.vrt", Vrt(Part((outside_ / "secret.tif").string())));
  const fs::path started_in = fs::current_path();
  fs::current_path(root_);  // a bare name is relative to this folder
  EXPECT_TRUE(OpenRaster("mosaic.vrt"));
  for (const std::string& name : {(root_ / "out.vrt").string(), std::string("out.vrt"), std::string("./out.vrt")}) {
    const auto refused = OpenRaster(name);
    ASSERT_FALSE(refused) << name;
    EXPECT_NE(refused.error().message.find("name that folder in data_roots"), std::string::npos);
  }
  fs::current_path(started_in);
}

TEST_F(SourcePolicyTest, OverviewsBesideAndElsewhereAreHeldToTheRoots) {
  const std::string secret = (outside_ / "secret.tif").string();
  Write(root_ / "dem.tif.aux.xml", NamingOverviews(secret));
  const OpenWatch watch(outside_);
  const auto linked = OpenRaster((root_ / "dem.tif").string());
  ASSERT_FALSE(linked);
  EXPECT_NE(linked.error().message.find("names overviews elsewhere"), std::string::npos) << linked.error().message;
  fs::remove(root_ / "dem.tif.aux.xml");
  for (const char* beside : {"dem.tif.ovr", "dem.tif.OVR", "dem.tif.MSK", "dem.aux"}) {
    fs::create_symlink(secret, root_ / beside);
    EXPECT_FALSE(OpenRaster((root_ / "dem.tif").string())) << beside;
    fs::remove(root_ / beside);
  }
  EXPECT_TRUE(OpenRaster((root_ / "dem.tif").string()));
  EXPECT_EQ(watch.Opened(), std::set<std::string>());
}

TEST_F(SourcePolicyTest, OnlyASourceNamesOverviewsElsewhere) {
  Allow({.roots = {root_.string()}, .drivers = WithVrt()});
  const std::string dem = (root_ / "dem.tif").string(), mosaic = (root_ / "mosaic.vrt").string();
  const std::string overviews = WriteRaster(dir_, {.width = 8, .height = 8}, "root/overviews.tif");
  const auto expect_refused = [](const std::string& source, const char* why) {
    const auto opened = ElevationModel::Open(source);
    ASSERT_FALSE(opened) << source;
    EXPECT_NE(opened.error().message.find(why), std::string::npos) << opened.error().message;
  };
  Write(mosaic, Vrt(Part("dem.tif", true)));
  EXPECT_TRUE(ElevationModel::Open(mosaic));
  Write(dem + ".aux.xml", NamingOverviews(overviews));
  EXPECT_TRUE(ElevationModel::Open(dem));
  expect_refused(mosaic, "a part of it");
  // Overviews of the overviews.
  Write(overviews + ".aux.xml", NamingOverviews(outside_ / "secret.tif"));
  expect_refused(dem, "overviews.tif: names overviews elsewhere");
  fs::remove(dem + ".aux.xml");
  fs::copy(overviews, dem + ".ovr");
  EXPECT_TRUE(ElevationModel::Open(dem));
  Write(dem + ".ovr.aux.xml", NamingOverviews(outside_ / "secret.tif"));
  expect_refused(dem, "dem.tif.ovr: names overviews elsewhere");
  fs::remove(dem + ".ovr.aux.xml");
  Write(dem + ".ovr", Vrt(Part((outside_ / "secret.tif").string())));
  expect_refused(dem, "dem.tif.ovr: is a VRT");
  fs::rename(dem + ".ovr", dem + ".OVR");  // which GDAL opens as well
  expect_refused(dem, "dem.tif.OVR: is a VRT");
}

TEST_F(SourcePolicyTest, RemoteNamesStayBelowTheirPrefix) {
  Allow({.prefixes = {"/vsicurl/" + web_.url("dems/")}});
  EXPECT_TRUE(IsAllowedRemote("/vsicurl/" + web_.url("dems/a.tif")));
  EXPECT_TRUE(CheckSourceName("/vsicurl/" + web_.url("dems/deep/er/a.tif")));
  for (const std::string& name :
       {"/vsicurl/" + web_.url("other/a.tif"), "/vsicurl/" + web_.url("dems/"), "/vsicurl/" + web_.url("dems/../a.tif"),
        "/vsicurl/" + web_.url("dems/%2e%2e/a.tif"), "/vsicurl/" + web_.url("dems/a.tif?x=/vsizip/"),
        "/vsicurl/" + web_.url("dems//vsizip/a.zip/b.tif"), "/vsicurl_streaming/" + web_.url("dems/a.tif"),
        std::string("/vsis3/bucket/a.tif"), web_.url("dems/a.tif")}) {
    EXPECT_FALSE(CheckSourceName(name)) << name;
  }
  EXPECT_EQ(web_.hits(), 0);
  EXPECT_EQ(ReopenRaster("/vsicurl/" + web_.url("dems/a.tif")), nullptr);
  EXPECT_GT(web_.hits(), 0) << "the allowed prefix is closed";
}

TEST_F(SourcePolicyTest, RefusesItselfWithTheReason) {
  const auto message = [](const SourcePolicy& policy) {
    const auto set = SetSourcePolicy(policy);
    return set ? std::string("accepted") : set.error().message;
  };
  EXPECT_NE(message({.roots = {dir_.File("none")}}).find("is no folder"), std::string::npos);
  EXPECT_NE(message({.prefixes = {"https://example.org/"}}).find("must name a remote folder"), std::string::npos);
  EXPECT_NE(message({.prefixes = {"/vsicurl/"}}).find("must name a remote folder"), std::string::npos);
  EXPECT_NE(message({.drivers = {"GTif"}}).find("\"GTif\" is no format"), std::string::npos);
  EXPECT_FALSE(OpenRaster((outside_ / "secret.tif").string())) << "a refused policy replaced the one in force";
}

TEST(SourceNames, PartsOfArchivesAreToBeExtracted) {
  for (const char* name : {"/vsizip/a.zip/b.tif", "/vsigzip/b.tif.gz", "/vsitar//data/a.tar/b.tif"}) {
    const auto checked = CheckSourceName(name);
    ASSERT_FALSE(checked);
    EXPECT_NE(checked.error().message.find("extract it"), std::string::npos) << checked.error().message;
  }
}

TEST(GdalEnvironment, IsClearedButForTheFoldersOfData) {
  ::setenv("GDAL_SKIP", "GTiff", 1);
  ::setenv("CPL_DEBUG", "ON", 1);
  ::setenv("GTIFF_POINT_GEO_IGNORE", "YES", 1);
  ::setenv("PROJ_NETWORK", "ON", 1);
  ::setenv("PROJ_DATA", "/usr/share/proj", 1);
  const std::vector<std::string> cleared = ClearGdalEnvironment();
  EXPECT_EQ(cleared, (std::vector<std::string>{"CPL_DEBUG", "GDAL_SKIP", "GTIFF_POINT_GEO_IGNORE", "PROJ_NETWORK"}));
  EXPECT_EQ(::getenv("GDAL_SKIP"), nullptr);
  EXPECT_NE(::getenv("PROJ_DATA"), nullptr);
  ::unsetenv("PROJ_DATA");
}

}  // namespace
}  // namespace terrace::dem
