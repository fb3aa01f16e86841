// The dataset's image on the globe; the terrain's material shades it.
import { GeographicTilingScheme, Rectangle, Resource, UrlTemplateImageryProvider } from "/viewer/cesium/index.js";

// `imagery`: of a dataset in /datasets. `template`: its tiles, y from the south.
export function addImagery(scene, template, { bounds, attribution, geodetic_max_level: maximumLevel }, headers, onError) {
  const provider = new UrlTemplateImageryProvider({
    url: new Resource({ url: template.replace("{y}", "{reverseY}"), headers }),
    tilingScheme: new GeographicTilingScheme(), tileWidth: 256, tileHeight: 256,
    rectangle: Rectangle.fromDegrees(...bounds), maximumLevel, credit: attribution, enablePickFeatures: false,
  });
  provider.errorEvent.addEventListener((failure) => {
    if (failure.timesRetried === 0) onError(failure.message);
  });
  return scene.imageryLayers.addImageryProvider(provider);
}
