// What Cesium for Unreal and Unity do with a URL of terrace, without a renderer: loads the tiles of one view, prints
// how many there are and what they request, and the height at the point below the camera.
//
//     cesium_native_example http://127.0.0.1:8080/jacksboro/layer.json LATITUDE LONGITUDE [HEIGHT_OF_CAMERA]
#include <Cesium3DTilesContent/registerAllTileContentTypes.h>
#include <Cesium3DTilesSelection/IPrepareRendererResources.h>
#include <Cesium3DTilesSelection/SampleHeightResult.h>
#include <Cesium3DTilesSelection/Tileset.h>
#include <Cesium3DTilesSelection/TilesetLoadFailureDetails.h>
#include <Cesium3DTilesSelection/ViewState.h>
#include <Cesium3DTilesSelection/ViewUpdateResult.h>
#include <CesiumAsync/AsyncSystem.h>
#include <CesiumAsync/GunzipAssetAccessor.h>
#include <CesiumAsync/ITaskProcessor.h>
#include <CesiumCurl/CurlAssetAccessor.h>
#include <CesiumGeospatial/Cartographic.h>
#include <CesiumGeospatial/Ellipsoid.h>
#include <CesiumGltf/Model.h>
#include <CesiumUtility/CreditSystem.h>
#include <spdlog/spdlog.h>

#include <any>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

namespace {

using namespace Cesium3DTilesSelection;
using CesiumGeospatial::Cartographic;
using CesiumGeospatial::Ellipsoid;

// An engine has a pool of threads here.
class Threads : public CesiumAsync::ITaskProcessor {
 public:
  void startTask(std::function<void()> task) override { std::thread(std::move(task)).detach(); }
};

// An engine makes its meshes here, off its main thread, from the glTF that every tile has become.
class Renderer : public IPrepareRendererResources {
 public:
  CesiumAsync::Future<TileLoadResultAndRenderResources> prepareInLoadThread(const CesiumAsync::AsyncSystem& system,
                                                                            TileLoadResult&& tile, const glm::dmat4&,
                                                                            const std::any&) override {
    if (const auto* model = std::get_if<CesiumGltf::Model>(&tile.contentKind)) {
      for (const auto& mesh : model->meshes) {
        for (const auto& primitive : mesh.primitives) {
          if (primitive.indices >= 0) {
            triangles += model->accessors[static_cast<size_t>(primitive.indices)].count / 3;
          }
        }
      }
    }
    return system.createResolvedFuture(TileLoadResultAndRenderResources{std::move(tile), nullptr});
  }
  void* prepareInMainThread(Tile&, void*) override { return nullptr; }
  void free(Tile&, void*, void*) noexcept override {}
  void* prepareRasterInLoadThread(CesiumImage::ImageAsset&, const std::any&) override { return nullptr; }
  void* prepareRasterInMainThread(CesiumRasterOverlays::RasterOverlayTile&, void*) override { return nullptr; }
  void freeRaster(const CesiumRasterOverlays::RasterOverlayTile&, void*, void*) noexcept override {}
  void attachRasterInMainThread(const Tile&, int32_t, const CesiumRasterOverlays::RasterOverlayTile&, void*,
                                const glm::dvec2&, const glm::dvec2&) override {}
  void detachRasterInMainThread(const Tile&, int32_t, const CesiumRasterOverlays::RasterOverlayTile&,
                                void*) noexcept override {}

  std::atomic<int64_t> triangles{0};  // of all tiles that were loaded, skirts included
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "usage: %s URL LATITUDE LONGITUDE [HEIGHT_OF_CAMERA]\n", argv[0]);
    return 2;
  }
  const double latitude = std::atof(argv[2]), longitude = std::atof(argv[3]),
               height = argc > 4 ? std::atof(argv[4]) : 5000;

  Cesium3DTilesContent::registerAllTileContentTypes();
  CesiumAsync::AsyncSystem system(std::make_shared<Threads>());
  auto network = std::make_shared<CesiumAsync::GunzipAssetAccessor>(
      std::make_shared<CesiumCurl::CurlAssetAccessor>(CesiumCurl::CurlAssetAccessorOptions{}));
  auto renderer = std::make_shared<Renderer>();
  auto credits = std::make_shared<CesiumUtility::CreditSystem>();
  TilesetExternals externals{network, renderer, system, credits, spdlog::default_logger()};
  bool failed = false;
  TilesetOptions options;
  options.loadErrorCallback = [&](const TilesetLoadFailureDetails& details) {
    failed = true;
    std::fprintf(stderr, "%s\n", details.message.c_str());
  };
  auto tileset = std::make_unique<Tileset>(externals, argv[1], options);

  // Looks straight down. A frame of an engine: finish what threads have loaded, choose tiles, load what is missing.
  const Ellipsoid& earth = Ellipsoid::WGS84;
  const Cartographic above = Cartographic::fromDegrees(longitude, latitude, height);
  const glm::dvec3 up = earth.geodeticSurfaceNormal(above);
  const std::vector<ViewState> views{ViewState(earth.cartographicToCartesian(above), -up, glm::dvec3(0, 0, 1),
                                               glm::dvec2(1920, 1080), 1.05, 0.64, earth)};
  const auto wait = [&](const std::function<bool()>& is_done) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!failed && !is_done() && std::chrono::steady_clock::now() < end) {
      network->tick();
      system.dispatchMainThreadTasks();
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return !failed && is_done();
  };
  size_t shown = 0;
  int calm = 0;  // frames in which nothing was missing
  const bool loaded = wait([&] {
    const ViewUpdateResult& frame = tileset->updateViewGroup(tileset->getDefaultViewGroup(), views, 1 / 60.0F);
    tileset->loadTiles();
    shown = frame.tilesToRenderThisFrame.size();
    calm = shown > 0 && tileset->computeLoadProgress() >= 100 ? calm + 1 : 0;
    return calm > 10;
  });
  if (!loaded) {
    std::fprintf(stderr, "%s: not loaded\n", argv[1]);
    return 1;
  }
  std::printf("%zu tiles shown, %lld triangles loaded\n", shown, static_cast<long long>(renderer->triangles));

  // The height that an engine would place an actor at, from the deepest tile.
  bool sampled = false;
  SampleHeightResult result;
  tileset->sampleHeightMostDetailed({Cartographic::fromDegrees(longitude, latitude)})
      .thenInMainThread([&](SampleHeightResult&& found) {
        result = std::move(found);
        sampled = true;
      });
  const bool found = wait([&] {
    tileset->loadTiles();
    return sampled;
  });
  if (!found || !result.sampleSuccess.at(0)) {
    std::fprintf(stderr, "no height at %g, %g\n", latitude, longitude);
    return 1;
  }
  std::printf("height at %.6f, %.6f: %.2f m\n", latitude, longitude, result.positions.at(0).height);
  for (const auto& credit : tileset->getTilesetCredits()) {
    std::printf("credit: %s\n", credits->getHtml(credit).c_str());
  }

  // Tiles are freed by main-thread tasks.
  auto destroyed = tileset->getAsyncDestructionCompleteEvent();
  tileset.reset();
  return wait([&] { return destroyed.isReady(); }) ? 0 : 1;
}
