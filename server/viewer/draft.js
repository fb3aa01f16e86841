// A draft of an edit: a polygon drawn on the globe, what flattening it would do, and the file that the server takes. Only
// the operator of a server can edit its terrain: the page sends nothing.
import {
  Cartesian3, Color, ColorGeometryInstanceAttribute, GeometryInstance, PerInstanceColorAppearance, PolygonGeometry,
  PolygonHierarchy, Primitive,
} from "/viewer/cesium/index.js";
import { crossesItself, earthwork, flattenGeoJson, isBeside, placesInside, signedArea } from "/viewer/edit_shapes.js";
import { formatArea, formatHeight, formatVolume } from "/viewer/numbers.js";
import { Turns } from "/viewer/turns.js";

const kSamples = 400;
const kMaxHeight = 20000;  // metres; the server takes no others
const kMaxBlend = 100000;  // metres; likewise
const kMinArea = 0.01;  // square metres; less has corners on one line
const kSurface = Color.fromCssColorString("#ff8a5c").withAlpha(0.55);
const byId = (id) => document.getElementById(id);

export class Draft {
  #requests = new Turns();
  #markers = 0;

  // `access`: the server. `dataset()`: the shown dataset. `onMode(name)`: "draft" begins, or undefined: it ends.
  constructor({ globe, access, dataset, onMode }) {
    Object.assign(this, { globe, access, dataset, onMode, isOpen: false, corners: [], isHeightChosen: false });
    byId("draft-close").addEventListener("click", () => this.end());
    byId("draft-undo").addEventListener("click", () => this.undo());
    byId("draft-save").addEventListener("click", () => this.#save());
    byId("draft-height").addEventListener("input", () => {
      this.isHeightChosen = true;
      this.#show();
    });
    byId("draft-blend").addEventListener("input", () => this.#show());
  }

  toggle() {
    if (this.isOpen) return this.end();
    this.isOpen = true;
    this.globe.scene.globe.depthTestAgainstTerrain = true;  // ground hides what is below it
    this.globe.overlay.setMarker("picked", undefined);
    this.globe.onClick = (ground) => ground && this.add(ground);
    byId("draft").hidden = false;
    this.onMode("draft");
    this.#change();
  }

  end() {
    if (!this.isOpen) return;
    if (byId("draft").contains(document.activeElement)) byId("tool-draft").focus();
    this.isOpen = false;
    this.globe.scene.globe.depthTestAgainstTerrain = false;
    this.globe.onClick = undefined;
    this.corners = [];
    this.isHeightChosen = false;
    this.#change();
    byId("draft").hidden = true;
    this.onMode(undefined);
  }

  // The last corner again, as by a double click, is ignored.
  add(ground) {
    const last = this.corners.at(-1);
    if (last && last.longitude === ground.longitude && last.latitude === ground.latitude) return undefined;
    this.corners.push(ground);
    return this.#change();
  }

  undo() {
    if (!this.isOpen) return undefined;
    this.corners.pop();
    return this.#change();
  }

  // The dataset has another version: its heights are read anew.
  refresh() {
    return this.isOpen && this.#change();
  }

  // The exaggeration has changed.
  stretch() {
    if (this.isOpen) this.#drawSurface();
  }

  get height() {
    return Math.max(-kMaxHeight, Math.min(kMaxHeight, byId("draft-height").valueAsNumber || 0));
  }

  get blend() {
    return Math.max(0, Math.min(kMaxBlend, byId("draft-blend").valueAsNumber || 0));
  }

  get #hasHeight() {
    return !Number.isNaN(byId("draft-height").valueAsNumber);
  }

  // Why the corners make no polygon; undefined: they make one.
  get #fault() {
    if (this.corners.length === 0) return "Click the ground to set the first corner of a polygon.";
    if (this.corners.length < 3) return "Click the next corner.";
    if (crossesItself(this.corners)) return "The outline crosses itself: remove the last corner.";
    return Math.abs(signedArea(this.corners)) < kMinArea ? "The corners are on one line: click another one." : undefined;
  }

  get #isPolygon() {
    return this.#fault === undefined;
  }

  // The corners have changed: their ground is read anew.
  async #change() {
    const isLatest = this.#requests.begin();
    const { corners } = this;
    this.ground = undefined;
    if (corners.length > 0 && !this.isHeightChosen) {
      const mean = corners.reduce((sum, { height }) => sum + height, 0) / corners.length;
      byId("draft-height").value = mean.toFixed(1);
    }
    this.#show();
    if (!this.#isPolygon) return;
    try {
      const ground = await this.access.heights(this.dataset(), placesInside(corners, kSamples));
      if (!isLatest()) return;
      this.ground = ground;
      this.#describe();
    } catch (error) {
      if (isLatest()) byId("draft-text").textContent = `The heights could not be read: ${error.message}.`;
    }
  }

  #show() {
    this.#drawOutline();
    this.#drawSurface();
    this.#describe();
  }

  #drawOutline() {
    const { overlay } = this.globe;
    const { corners } = this;
    for (; this.#markers > corners.length; --this.#markers) overlay.setMarker(`corner-${this.#markers - 1}`, undefined);
    corners.forEach((corner, i) => overlay.setMarker(`corner-${i}`, corner));
    this.#markers = corners.length;
    if (corners.length < 2) return overlay.setLine("draft", undefined);
    const ring = corners.length > 2 ? [...corners, corners[0]] : corners;
    const isWrong = corners.length > 2 && !this.#isPolygon;
    const pieces = [{ className: isWrong ? "unseen" : "draft", points: ring }];
    if (!isWrong && corners.length > 2) {
      const raise = (corner) => ({ ...corner, height: this.height });
      pieces.push({ className: "draft level", points: ring.map(raise) });
      for (const corner of corners) pieces.push({ className: "draft level", points: [corner, raise(corner)] });
    }
    return overlay.setLine("draft", pieces);
  }

  // The chosen height as a surface, which the ground hides where it is higher.
  #drawSurface() {
    const { scene } = this.globe;
    if (this.surface) scene.primitives.remove(this.surface);  // which destroys it
    this.surface = undefined;
    if (this.#isPolygon) {
      const positions = this.corners.map(({ longitude, latitude }) => Cartesian3.fromDegrees(longitude, latitude));
      const geometry = new PolygonGeometry({
        polygonHierarchy: new PolygonHierarchy(positions), height: this.height * this.globe.exaggeration,
        vertexFormat: PerInstanceColorAppearance.FLAT_VERTEX_FORMAT,
      });
      const attributes = { color: ColorGeometryInstanceAttribute.fromColor(kSurface) };
      this.surface = scene.primitives.add(new Primitive({
        geometryInstances: new GeometryInstance({ geometry, attributes }), asynchronous: false,
        appearance: new PerInstanceColorAppearance({ flat: true, translucent: true }),
      }));
    }
    scene.requestRender();
  }

  #describe() {
    byId("draft-undo").hidden = this.corners.length === 0;
    // The server refuses a file with features outside the data.
    byId("draft-save").disabled = !this.#isPolygon || !this.#hasHeight || isBeside(this.corners, this.dataset().bounds);
    byId("draft-text").textContent = this.#text();
  }

  #text() {
    const { corners, ground } = this;
    if (!this.#isPolygon) return this.#fault;
    const area = Math.abs(signedArea(corners));
    const size = formatArea(area);
    if (!this.#hasHeight) return `${size}. Enter the height.`;
    if (!ground) return `${size}.`;
    const { known, raised, lowered, fill, cut } = earthwork(ground, this.height, area);
    if (known === 0) return `${size}; no heights there.`;
    const remark = known < 1 ? ` ${Math.max(1, Math.min(99, Math.round(100 * (1 - known))))} % of the area has no heights and does not count.` : "";
    return `${size}. Raises the ground by up to ${formatHeight(raised)}, ${formatVolume(fill)}; lowers it by up to ${formatHeight(lowered)}, ${formatVolume(cut)}.${remark}`;
  }

  #save() {
    const text = JSON.stringify(flattenGeoJson(this.corners, this.height, this.blend), undefined, 1);
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "application/geo+json" }));
    link.download = `${this.dataset().name}-edits.geojson`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }
}
