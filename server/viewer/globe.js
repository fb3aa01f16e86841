// The CesiumJS part of the page: the widget, its terrain, the camera, picking, and statistics of the drawn tiles.
import {
  BoundingSphere, CameraEventType, Cartesian3, Cartographic, CesiumTerrainProvider, CesiumWidget, Color,
  GeographicTilingScheme, GroundPolylinePrimitive, GroundPrimitive, HeadingPitchRange, Math as CesiumMath,
  QuantizedMeshTerrainData, Rectangle, Resource, ScreenSpaceEventHandler, ScreenSpaceEventType,
} from "/viewer/cesium/index.js";
import { errorQuery, layerUrl } from "/viewer/early.js";
import { boxOf, discOf, isGlobal, kGlobalDistance, pixelTolerance, viewDistance } from "/viewer/framing.js";
import { kNearest, steerByKeyboard } from "/viewer/keyboard.js";
import { niceInterval } from "/viewer/colours.js";
import { makeTerrainMaterial, setColouring, setHeights } from "/viewer/material.js";
import { Overlay, raised } from "/viewer/overlay.js";
import { Sky } from "/viewer/sky.js";
import { Tiles3d } from "/viewer/tiles3d.js";
import { Turns } from "/viewer/turns.js";

// Renderers without a GPU, for which antialiasing is too slow.
const kSoftware = /swiftshader|llvmpipe|software|basic render/i;
const kDoubleClickMs = 500;
const kDoubleClickPixels = 5;
const kWorldMiddle = [82, 18];  // longitude and latitude at the centre of a view of the whole Earth: the highest ground

// The widget fetches a table of the Earth's heights for objects that lie on the ground, which this page does not have.
for (const primitive of [GroundPrimitive, GroundPolylinePrimitive]) primitive.initializeTerrainHeights = () => Promise.resolve();

// Starts the worker that unpacks tiles, with a tile of one triangle, so that its scripts load while the scene is made.
function startTileWorker() {
  const edges = Object.fromEntries(["west", "south", "east", "north"].flatMap((edge) =>
    [[`${edge}Indices`, [0]], [`${edge}SkirtHeight`, 0]]));
  const tile = new QuantizedMeshTerrainData({
    ...edges, minimumHeight: 0, maximumHeight: 0, indices: new Uint16Array([0, 1, 2]),
    quantizedVertices: new Uint16Array([0, 32767, 0, 0, 0, 32767, 0, 0, 0]),
    boundingSphere: new BoundingSphere(), horizonOcclusionPoint: new Cartesian3(),
  });
  tile.createMesh({ tilingScheme: new GeographicTilingScheme(), x: 0, y: 0, level: 0 })?.catch(() => {});
}

export class Globe {
  #shows = new Turns();  // only the latest may set the terrain

  // `onError` gets a sentence for the user, `onTileError` one for each tile that could not be read. Throws an error named
  // NoGlobe if the browser cannot draw it.
  constructor(container, onError, onTileError) {
    startTileWorker();
    const credits = document.createElement("div");  // the page states the attribution itself
    try {
      this.widget = new CesiumWidget(container, {
        baseLayer: false, skyBox: false, creditContainer: credits, creditViewport: credits, showRenderLoopErrors: false,
        requestRenderMode: true, maximumRenderTimeChange: Infinity, useBrowserRecommendedResolution: false,
        useDefaultRenderLoop: false,  // until there is a dataset: a frame of nothing takes time as well
      });
    } catch (error) {
      container.replaceChildren();
      throw Object.assign(new Error(error.message), { name: "NoGlobe" });
    }
    const limitPixels = () => (this.widget.resolutionScale = Math.min(2, devicePixelRatio) / devicePixelRatio);
    limitPixels();
    addEventListener("resize", limitPixels);  // the window may be on another screen
    this.scene = this.widget.scene;
    this.container = container;
    Object.assign(this, { onError, onTileError });
    this.contours = false;
    this.interval = 0;
    this.loads = 0;  // how often all tiles of a view have arrived
    this.isMoving = false;
    this.#dressScene();
    this.tiles3d = new Tiles3d(this.scene, this.material);
    this.sky = new Sky(this.scene, this.material.uniforms);
    this.overlay = new Overlay(this.scene, container);
    this.onClick = undefined;  // while set, gets clicked ground instead of onPick's callback
    this.onSteer = undefined;  // called when the user begins to move the camera
    this.scene.camera.percentageChanged = 0.05;
    this.scene.camera.changed.addEventListener(() => this.adaptToCamera());
    this.scene.camera.moveStart.addEventListener(() => (this.isMoving = true));
    this.scene.camera.moveEnd.addEventListener(() => (this.isMoving = false));
    this.#awaitGround();
    this.scene.renderError.addEventListener((_, error) => onError(`Drawing stopped: ${error.message ?? error}`));
  }

  #dressScene() {
    const { globe, screenSpaceCameraController: controller } = this.scene;
    this.scene.skyAtmosphere.atmosphereLightIntensity = 22;
    this.scene.backgroundColor = Color.fromCssColorString("#05080d");
    controller.tiltEventTypes.push(CameraEventType.RIGHT_DRAG);
    controller.zoomEventTypes = controller.zoomEventTypes.filter((type) => type !== CameraEventType.RIGHT_DRAG);
    globe.baseColor = Color.fromCssColorString("#1b232d");
    globe.enableLighting = false;  // the material shades, and has its own haze
    globe.showGroundAtmosphere = false;
    this.scene.fog.renderable = false;
    if (kSoftware.test(this.#renderer())) this.scene.msaaSamples = 1;
    globe.showWaterEffect = false;
    globe.show = false;  // nothing is asked for before there is a dataset
    globe.material = this.material = makeTerrainMaterial();
  }

  // The air is drawn once ground is drawn and every tile of level 0 is there: without one of them the air makes that part
  // of the globe white. The stars follow when all ground is there: their shaders and images take longer than the ground's.
  #awaitGround() {
    this.hasGround = false;
    this.#hideAir();
    const stop = this.scene.postRender.addEventListener(() => {
      const { _tilesToRender: drawn, _levelZeroTiles: roots } = this.scene.globe._surface;
      if (drawn.length === 0 || !roots.every(({ renderable }) => renderable)) return;
      stop();
      this.hasGround = true;
      performance.mark("terrace.ground");
      this.#hideAir();
      this.scene.requestRender();
    });
    this.scene.globe.tileLoadProgressEvent.addEventListener((queued) => {
      if (queued > 0) return;
      this.loads += 1;
      if (this.hasGround) this.adaptToCamera();
    });
  }

  #renderer() {
    const gl = this.scene.canvas.getContext("webgl2");  // the scene's own
    const names = gl?.getExtension("WEBGL_debug_renderer_info");
    return names ? gl.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  }

  // Shows `dataset` at `fraction` of the level error, and its 3D Tiles at `compared` unless that is undefined. `headers`
  // go with every request. Throws a readable message if the server does not describe it.
  async show(dataset, fraction, compared, headers) {
    const url = layerUrl(dataset, fraction).replace("layer.json", "");
    const isLatest = this.#shows.begin();
    const provider = await CesiumTerrainProvider.fromUrl(new Resource({ url, headers }), { requestVertexNormals: true });
    // If layer.json is missing, CesiumJS assumes an old server of height maps.
    if (!provider.availability) throw new Error(`${url} does not describe any terrain`);
    if (!isLatest()) return;
    provider.errorEvent.addEventListener((failure) => isLatest() && this.onTileError(failure.message));

    this.#drawCurtain();
    const { longitude, latitude, width, height } = boxOf(dataset.bounds);
    setHeights(this.material, this.scene.context, dataset.heights);
    this.overlay.lowest = dataset.heights.min;
    const [x, y, z, w] = [longitude, latitude, width / 2, height / 2].map(CesiumMath.toRadians);
    this.material.uniforms.box = { x, y, z, w };
    this.material.uniforms.shading = provider.hasVertexNormals ? 1 : 0;
    this.widget.terrainProvider = provider;
    this.shownVersion = dataset.version;
    this.scene.globe.show = true;
    this.widget.useDefaultRenderLoop = true;
    this.adaptToCamera();
    const tileset = `${dataset.urls.tileset}${errorQuery(dataset, compared)}`;
    await this.compare(compared ? new Resource({ url: tileset, headers }) : undefined);
  }

  // Lays the image of `dataset` on the ground; undefined, or without an image: none. Another token may show more of it.
  async drape(dataset, headers) {
    const url = dataset?.urls.imagery_geodetic;
    const wanted = url && `${url} ${headers.Authorization}`;
    if (this.draped === wanted) return;
    this.draped = wanted;
    this.scene.imageryLayers.removeAll();
    this.material.uniforms.draped = 0;
    this.scene.requestRender();
    if (!wanted) return;
    const part = await import("/viewer/imagery.js").catch(() => undefined);
    if (this.draped !== wanted) return;
    if (!part) {
      this.draped = undefined;
      return this.onTileError("The image could not be loaded: the server does not answer.");
    }
    part.addImagery(this.scene, url, dataset.imagery, headers, this.onTileError);
    const { longitude, latitude, width, height } = boxOf(dataset.imagery.bounds);
    const [x, y, z, w] = [longitude, latitude, width / 2, height / 2].map(CesiumMath.toRadians);
    Object.assign(this.material.uniforms, { draped: 1, imageBox: { x, y, z, w } });
    this.scene.requestRender();
  }

  // 3D Tiles from this resource to the right of the splitter; without one, terrain everywhere.
  async compare(tileset) {
    this.material.uniforms.split = tileset ? 1 : 0;
    this.#hideAir();
    if (tileset) await this.tiles3d.show(tileset, this.onTileError);
    else this.tiles3d.hide();
    this.scene.requestRender();
  }

  // The air makes the background white where no ground covers it: in wireframe, on the side of 3D Tiles that are still
  // loading, and before there is any ground.
  #hideAir() {
    const { wire, split } = this.material.uniforms;
    this.scene.skyAtmosphere.show = this.hasGround && wire === 0 && split === 0;
  }

  get split() {
    return this.scene.splitPosition;
  }

  // The position of the splitter as a fraction of the width.
  set split(share) {
    this.scene.splitPosition = share;
    this.scene.requestRender();
  }

  // Shows the last frame as a still image until the new terrain is drawn or the camera moves. In a flight there is none.
  #drawCurtain() {
    const { canvas, globe, camera } = this.scene;
    if (globe.terrainProvider.availability === undefined || this.isMoving) return;
    this.scene.render();
    const { width, height } = canvas;
    const curtain = Object.assign(document.createElement("canvas"), { className: "curtain", width, height });
    curtain.getContext("2d").drawImage(canvas, 0, 0);
    canvas.parentElement.append(curtain);
    const stop = [];
    const lift = () => {
      stop.forEach((remove) => remove());
      curtain.classList.add("lifted");
      setTimeout(() => curtain.remove(), 400);
    };
    stop.push(globe.tileLoadProgressEvent.addEventListener((queued) => queued === 0 && lift()));
    stop.push(camera.moveStart.addEventListener(lift));
  }

  // Shows a region from the south-west, low enough to see its relief, and a global dataset as a whole planet. `region`:
  // a dataset, or a part of it with `ground`, the height at its centre.
  lookAt(region, seconds) {
    const { camera } = this.scene;
    camera.cancelFlight();
    const { longitude, latitude, width, height } = boxOf(region.bounds);
    const narrow = Math.max(1, 0.8 * this.scene.canvas.clientHeight / this.scene.canvas.clientWidth);
    if (isGlobal(region)) {
      const eastward = width > 350 ? kWorldMiddle[0] : longitude;
      const northward = width > 350 && height > 100 ? kWorldMiddle[1] : latitude;  // except for regions around a pole
      const destination = Cartesian3.fromDegrees(eastward, northward, kGlobalDistance * narrow);
      return seconds > 0 ? camera.flyTo({ destination, duration: seconds }) : camera.setView({ destination });
    }
    const disc = discOf(region);
    const pitch = -28 - 45 * Math.min(1, disc.diameter / 5e6);
    const { min, max } = region.heights;
    const low = max > 0 ? Math.max(0, min) : min;  // where there is land, the view is of it
    const ground = this.exaggeration * (region.ground ?? low + 0.2 * (max - low));
    const sphere = new BoundingSphere(Cartesian3.fromDegrees(disc.longitude, disc.latitude, ground), disc.diameter / 2);
    const [heading, tilt] = [32, pitch].map(CesiumMath.toRadians);
    const offset = new HeadingPitchRange(heading, tilt, viewDistance(region) * narrow);
    camera.flyToBoundingSphere(sphere, { offset, duration: seconds });
  }

  get camera() {
    const { camera } = this.scene;
    const { longitude, latitude, height } = camera.positionCartographic;
    const degrees = CesiumMath.toDegrees;
    return [degrees(longitude), degrees(latitude), height, degrees(camera.heading), degrees(camera.pitch)];
  }

  set camera([longitude, latitude, height, heading, pitch]) {
    const radians = CesiumMath.toRadians;
    this.scene.camera.cancelFlight();  // setView lets it go on
    this.scene.camera.setView({
      destination: Cartesian3.fromDegrees(longitude, latitude, height),
      orientation: { heading: radians(heading), pitch: radians(pitch), roll: 0 },
    });
  }

  get wireframe() {
    return this.material.uniforms.wire === 1;
  }

  // CesiumJS has wireframes only in its inspector.
  set wireframe(on) {
    this.scene.globe._surface.tileProvider._debug.wireframe = on;
    this.scene.globe.showSkirts = !on;
    this.material.uniforms.wire = on ? 1 : 0;
    this.#hideAir();
    this.scene.requestRender();
  }

  get exaggeration() {
    return this.scene.verticalExaggeration;
  }

  set exaggeration(factor) {
    this.scene.verticalExaggeration = factor;
    this.material.uniforms.exaggeration = factor;
    this.scene.requestRender();
  }

  // "height", "slope" or "aspect".
  set colouring(name) {
    setColouring(this.material, this.scene.context, name);
    this.scene.requestRender();
  }

  // Around the dataset: paper instead of slate.
  set isLight(on) {
    this.material.uniforms.paper = on ? 1 : 0;
    this.scene.requestRender();
  }

  // Metres from the camera to the ground in the middle of the view. If no ground is drawn there, the ellipsoid counts as
  // ground. If the camera is below the ellipsoid, a lower one counts, on which the ground below the camera lies.
  get #distance() {
    const { camera, canvas, ellipsoid } = this.scene;
    const at = { x: canvas.clientWidth / 2, y: canvas.clientHeight * 0.6 };
    const above = Math.max(this.clearance, kNearest);
    const level = Math.min(0, camera.positionCartographic.height - above);
    const middle = this.#pickWorld(at) ?? camera.pickEllipsoid(at, raised(ellipsoid, level));
    return middle ? Cartesian3.distance(middle, camera.positionWC) : above * 3;
  }

  // Adapts to the distance: depth of tiles, contour interval, strength of shading, roundness of the globe.
  adaptToCamera() {
    const distance = this.#distance;
    this.scene.globe.maximumScreenSpaceError = pixelTolerance(distance);
    const { uniforms } = this.material;
    this.interval = niceInterval(Math.max(1, Math.min(distance * 0.0022, 2000)));
    uniforms.contourInterval = this.contours ? this.interval : 0;
    uniforms.relief = CesiumMath.clamp(Math.pow(distance / 45000, 0.55), 1.15, 14);
    uniforms.farness = CesiumMath.clamp((Math.log10(distance) - 6.2) / 0.8, 0, 1);
    uniforms.hazeDistance = Math.max(150000, distance * 5);
    if (this.hasGround) this.sky.adapt(distance);
    uniforms.graticule = CesiumMath.toRadians(distance > 3e6 ? 10 : distance > 2e5 ? 1 : 0.1);
    this.scene.requestRender();
  }

  // Calls back with {longitude, latitude, height} of the clicked ground (degrees, metres above the ellipsoid), or
  // undefined outside the globe.
  onPick(callback) {
    const { canvas, camera } = this.scene;
    const handler = new ScreenSpaceEventHandler(canvas);
    const middle = () => ({ x: canvas.clientWidth / 2, y: canvas.clientHeight / 2 });
    const steer = () => this.onSteer?.();
    canvas.addEventListener("wheel", steer, { passive: true });
    canvas.addEventListener("pointermove", ({ buttons }) => buttons && steer());
    // The second click of a double click is ignored. A slow machine handles both late, so the time of the event counts.
    let released = 0;
    let last = { at: -Infinity };
    canvas.addEventListener("pointerup", ({ timeStamp }) => (released = timeStamp), true);
    const isSecond = ({ x, y }) => {
      const { at, ...before } = last;
      last = { x, y, at: released };
      return released - at < kDoubleClickMs && Math.hypot(x - before.x, y - before.y) < kDoubleClickPixels;
    };
    const click = (position) => {
      const ground = this.pick(position);
      if (this.onClick) return this.onClick(ground);
      this.overlay.setMarker("picked", ground);
      callback(ground);
    };
    steerByKeyboard(this.container, camera, {
      clearance: () => this.clearance, onSteer: steer, onEnter: () => click(middle()), onKey: (key) => this.onKey?.(key) ?? false,
    });
    handler.setInputAction(({ position }) => isSecond(position) || click(position), ScreenSpaceEventType.LEFT_CLICK);
  }

  #pickWorld(windowPosition) {
    const ray = this.scene.camera.getPickRay(windowPosition);
    return ray && this.scene.globe.pick(ray, this.scene);
  }

  pick(windowPosition) {
    const point = this.#pickWorld(windowPosition);
    if (!point) return undefined;
    const ground = Cartographic.fromCartesian(point);
    return { longitude: CesiumMath.toDegrees(ground.longitude), latitude: CesiumMath.toDegrees(ground.latitude),
             height: ground.height / this.exaggeration };
  }

  // Metres from the camera down to the drawn ground, or to the ellipsoid where none is drawn. Negative: it is below.
  get clearance() {
    const { camera, globe } = this.scene;
    return camera.positionCartographic.height - (globe.getHeight(camera.positionCartographic) ?? 0);
  }

  // Moves a camera from below the ground, whose height is known only when it is drawn, to above it.
  lift() {
    const { camera, globe } = this.scene;
    if (globe.getHeight(camera.positionCartographic) === undefined) return;
    const { clearance } = this;
    if (clearance < 0) camera.move(Cartesian3.normalize(camera.positionWC, new Cartesian3()), kNearest - clearance);
  }

  // Metres above the ellipsoid of the drawn ground; undefined where none is drawn.
  heightAt(longitude, latitude) {
    const height = this.scene.globe.getHeight(Cartographic.fromDegrees(longitude, latitude));
    return height === undefined ? undefined : height / this.exaggeration;
  }

  // A function that tells whether a place may be in view.
  viewTest() {
    const { camera, ellipsoid } = this.scene;
    const box = camera.computeViewRectangle(ellipsoid);
    const kMargin = 1e-6;  // degrees: a line along a parallel has no area
    return ([west, south, east, north]) => !box || Rectangle.intersection(box, Rectangle.fromDegrees(
      Math.max(west - kMargin, -180), Math.max(south - kMargin, -90), Math.min(east + kMargin, 180), Math.min(north + kMargin, 90))) !== undefined;
  }

  get loading() {
    return !this.scene.globe.tilesLoaded || this.tiles3d.loading;
  }

  // Statistics of the current frame, without skirts unless stated. `keys` are the tiles' "z/x/y", y from the south.
  drawn() {
    const sum = { tiles: 0, triangles: 0, withSkirts: 0, vertices: 0, deepest: 0, keys: [] };
    for (const tile of this.scene.globe._surface._tilesToRender) {
      const mesh = tile.data?.renderedMesh;
      if (!mesh) continue;
      sum.tiles += 1;
      sum.triangles += mesh.indexCountWithoutSkirts / 3;
      sum.withSkirts += mesh.indices.length / 3;
      sum.vertices += mesh.vertexCountWithoutSkirts;
      let sent = tile;  // below the deepest tiles of the server CesiumJS draws parts of them
      while (sent.upsampledFromParent && sent.parent) sent = sent.parent;
      sum.keys.push(`${sent.level}/${sent.x}/${2 ** sent.level - 1 - sent.y}`);
      sum.deepest = Math.max(sum.deepest, sent.level);
    }
    return sum;
  }
}
