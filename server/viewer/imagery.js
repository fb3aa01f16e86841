// The dataset's image on the globe; the terrain's material shades it.
import { GeographicTilingScheme, Rectangle, Resource, UrlTemplateImageryProvider } from "/viewer/cesium/index.js";

// `imagery`: of a dataset in /datasets. `template`: its tiles, y from the south. CesiumJS has no images across 180 degrees,
// so such a one has a layer on each side.
export function addImagery(scene, template, { bounds, geodetic_max_level: maximumLevel }, headers, onError) {
  const [west, south, east, north] = bounds;
  const boxes = east < west ? [[west, south, 180, north], [-180, south, east, north]].filter((box) => box[0] < box[2]) : [bounds];
  for (const box of boxes) {
    const provider = new UrlTemplateImageryProvider({
      url: new Resource({ url: template.replace("{y}", "{reverseY}"), headers }),
      tilingScheme: new GeographicTilingScheme(), tileWidth: 256, tileHeight: 256,
      rectangle: Rectangle.fromDegrees(...box), maximumLevel, enablePickFeatures: false,
    });
    provider.errorEvent.addEventListener((failure) => {
      if (failure.timesRetried === 0) onError(failure.message);
    });
    scene.imageryLayers.addImageryProvider(provider);
  }
}
