// Markers, lines and labels above the globe, as SVG: sharp, styled by the page, and drawn over everything. Ground is
// {longitude, latitude, height}: degrees, metres above the ellipsoid without exaggeration. Ground whose height is undefined
// is not drawn.
import { Cartesian2, Cartesian3, Ellipsoid, EllipsoidalOccluder, SceneTransforms } from "/viewer/cesium/index.js";

const kSvg = "http://www.w3.org/2000/svg";

const kSlack = 3200;  // metres; the horizon is that of an ellipsoid lower by this, so that no visible point is hidden

// An ellipsoid whose radii are `metres` longer.
export function raised({ radii: { x, y, z } }, metres) {
  return new Ellipsoid(x + metres, y + metres, z + metres);
}

export function svg(tag, attributes = {}, parent = undefined) {
  const element = document.createElementNS(kSvg, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  parent?.append(element);
  return element;
}

export class Overlay {
  #markers = new Map();
  #lines = new Map();
  #labels = [];

  constructor(scene, container) {
    this.scene = scene;
    this.root = svg("svg", { class: "overlay", "aria-hidden": "true" }, container);
    this.labelLayer = svg("g", { class: "contour-labels" }, this.root);
    this.lineLayer = svg("g", {}, this.root);
    this.markerLayer = svg("g", {}, this.root);
    this.lowest = 0;  // metres above the ellipsoid of the deepest ground: nothing below it hides it
    scene.postRender.addEventListener(() => this.#draw());
  }

  // Undefined ground removes the marker.
  setMarker(name, ground) {
    this.#markers.get(name)?.element.remove();
    this.#markers.delete(name);
    if (ground) {
      const element = svg("circle", { r: 6, class: `marker ${name}` }, this.markerLayer);
      this.#markers.set(name, { ground, element });
    }
    this.scene.requestRender();
  }

  // A line of several pieces: [{className, points}]. Undefined removes it.
  setLine(name, pieces) {
    this.#lines.get(name)?.forEach(({ element }) => element.remove());
    this.#lines.set(name, (pieces ?? []).map(({ className, points }) =>
      ({ points, element: svg("path", { class: `line ${className}` }, this.lineLayer) })));
    this.scene.requestRender();
  }

  // Labels that follow the ground: [{text, ground, ahead}]; the text runs from `ground` towards `ahead`.
  setLabels(labels) {
    this.#labels.forEach(({ element }) => element.remove());
    this.#labels = labels.map((label) => {
      const element = svg("text", { "text-anchor": "middle", "dominant-baseline": "central" }, this.labelLayer);
      element.textContent = label.text;
      return { ...label, element };
    });
    this.scene.requestRender();
  }

  #worldOf({ longitude, latitude, height }) {
    return Cartesian3.fromDegrees(longitude, latitude, height * this.scene.verticalExaggeration);
  }

  // Window coordinates; undefined without a height, behind the camera or beyond the horizon.
  #place(ground) {
    if (ground.height === undefined) return undefined;
    const world = this.#worldOf(ground);
    if (!this.occluder.isPointVisible(world)) return undefined;
    return SceneTransforms.worldToWindowCoordinates(this.scene, world, new Cartesian2());
  }

  #draw() {
    if (this.#markers.size + this.#labels.length === 0 && [...this.#lines.values()].every((line) => line.length === 0)) return;
    const { camera, ellipsoid, verticalExaggeration } = this.scene;
    const horizon = raised(ellipsoid, Math.min(0, this.lowest * verticalExaggeration) - kSlack);
    this.occluder = new EllipsoidalOccluder(horizon, camera.positionWC);
    for (const { ground, element } of this.#markers.values()) {
      const at = this.#place(ground);
      element.toggleAttribute("hidden", !at);
      if (at) element.setAttribute("transform", `translate(${at.x.toFixed(1)} ${at.y.toFixed(1)})`);
    }
    for (const line of this.#lines.values()) {
      for (const { points, element } of line) element.setAttribute("d", this.#path(points));
    }
    for (const { ground, ahead, element } of this.#labels) this.#turnLabel(element, this.#place(ground), this.#place(ahead));
  }

  #path(points) {
    let command = "M";
    let path = "";
    for (const point of points) {
      const at = this.#place(point);
      if (at) path += `${command}${at.x.toFixed(1)} ${at.y.toFixed(1)}`;
      command = at ? "L" : "M";
    }
    return path;
  }

  #turnLabel(element, at, to) {
    element.toggleAttribute("hidden", !at || !to);
    if (!at || !to) return;
    let angle = (Math.atan2(to.y - at.y, to.x - at.x) * 180) / Math.PI;
    if (angle > 90) angle -= 180;
    if (angle < -90) angle += 180;
    element.setAttribute("transform", `translate(${at.x.toFixed(1)} ${at.y.toFixed(1)}) rotate(${angle.toFixed(1)})`);
  }
}
