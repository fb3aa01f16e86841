// The page without WebGL 2: a flat map, drawn on a 2D canvas from the height tiles (Web Mercator PNGs, terrain-RGB), with
// colours by height or the dataset's image, shading, and contours. Dragging, wheel or two fingers, arrow keys, plus and minus
// move it; a click reads a height.
import { pendingText, UnknownToken } from "/viewer/access.js";
import { textOf } from "/viewer/attribution.js";
import { heightColour, niceInterval, waterline } from "/viewer/colours.js";
import { access, firstList } from "/viewer/early.js";
import { drawLegend } from "/viewer/legend.js";
import { formatPosition } from "/viewer/numbers.js";
import { Turns } from "/viewer/turns.js";

const kTile = 256;
const kPendingMs = 1500;
const kRetryMs = 5000;  // of tiles
const kMaxTiles = 300;  // in memory
const kWater = [51, 115, 158];
const kStep = 0.1;  // metres between heights of an image
const byId = (id) => document.getElementById(id);

// Web Mercator: the whole world is 1 wide and 1 high.
const kMaxLatitude = 85.0511;
const toX = (longitude) => (longitude + 180) / 360;
function toY(latitude) {
  const sine = Math.sin((Math.max(-kMaxLatitude, Math.min(kMaxLatitude, latitude)) * Math.PI) / 180);
  return 0.5 - Math.log((1 + sine) / (1 - sine)) / (4 * Math.PI);
}
const toLongitude = (x) => (((x % 1) + 1) % 1) * 360 - 180;
const toLatitude = (y) => (Math.atan(Math.sinh(Math.PI * (1 - 2 * y))) * 180) / Math.PI;

// Paints colours over the heights of an image, in place. `metres`: size of a pixel on the ground. `isInside(x, y)`: pixels
// outside the dataset become transparent. `photo`: pixels of the dataset's image, if any; `interval`: metres between
// contours, 0: none.
function paint(pixels, width, { heights, metres, isInside, photo, interval }) {
  const height = new Float32Array(width * width);
  const { data } = pixels;
  for (let i = 0; i < height.length; ++i) {
    height[i] = -10000 + (data[4 * i] * 65536 + data[4 * i + 1] * 256 + data[4 * i + 2]) * kStep;
  }
  const water = waterline(heights);
  // The sea is level, or follows the geoid in steps with level ground on both sides.
  const isLevel = (i) => [i - 1, i + 1, i - width, i + width].every((k) => (height[k] ?? height[i]) === height[i]);
  const isSea = (i) => height[i] < water && (isLevel(i) || [i - 1, i + 1, i - width, i + width].some((k) =>
    Math.abs(height[k] - height[i]) < 1.5 * kStep && isLevel(k)));
  const relief = Math.max(1.2, Math.min(12, metres / 40));
  for (let y = 0; y < width; ++y) {
    for (let x = 0; x < width; ++x) {
      const i = y * width + x;
      const [w, e] = [height[x > 0 ? i - 1 : i], height[x < width - 1 ? i + 1 : i]];
      const [n, s] = [height[y > 0 ? i - width : i], height[y < width - 1 ? i + width : i]];
      const [east, north] = [((w - e) / (2 * metres)) * relief, ((s - n) / (2 * metres)) * relief];
      const light = (0.643 + 0.766 * (-0.707 * east + 0.707 * north)) / (0.643 * Math.hypot(east, north, 1));
      const shade = 0.45 + 0.55 * Math.max(0, Math.min(1.6, light));
      const isPhoto = photo?.data[4 * i + 3] > 0;
      const colour = isPhoto ? photo.data.subarray(4 * i, 4 * i + 3) : isSea(i) ? kWater : heightColour(height[i], heights);
      // A line lies between two pixels on both sides of its height.
      const crossed = interval > 0 ? lineBetween(height[i], [e, s], interval) : undefined;
      const ink = crossed === undefined ? 1 : crossed % 5 === 0 ? 0.4 : 0.7;
      for (let k = 0; k < 3; ++k) data[4 * i + k] = colour[k] * (isPhoto ? 0.4 + 0.6 * shade : shade) * ink;
      if (!isInside(x, y)) data[4 * i + 3] = 0;
    }
  }
}

// The number of the contour between a pixel and one of its neighbours; undefined: there is none.
function lineBetween(height, neighbours, interval) {
  const step = Math.floor(height / interval);
  const other = neighbours.map((value) => Math.floor(value / interval)).find((value) => value !== step);
  return other === undefined ? undefined : Math.max(step, other);
}

class FlatMap {
  #tiles = new Map();  // "z/x/y": canvas, or undefined while it is loading and where there is none

  constructor(container, access) {
    Object.assign(this, { access, contours: false, imagery: false });
    this.canvas = document.createElement("canvas");
    container.append(this.canvas);
    container.tabIndex = 0;
    new ResizeObserver(() => this.draw()).observe(container);
    this.#steer(container);
  }

  async show(dataset) {
    if (this.dataset?.name !== dataset.name) {  // nothing is drawn until this dataset's tiles are known
      this.template = undefined;
      this.canvas.width = 0;
    }
    this.dataset = dataset;
    const [west, south, east, north] = dataset.bounds;
    const [top, bottom] = [toY(north), toY(south)];
    if (top === bottom) throw new Error(`${dataset.name} is beyond 85 degrees, where the flat map ends.`);
    if (!dataset.urls.tiles_json) throw new Error(`${dataset.name} has no height images, of which the flat map is made.`);
    const reply = await fetch(dataset.urls.tiles_json, { headers: this.access.headers });
    if (!reply.ok) throw new Error(`the server answered ${reply.status} to tiles.json`);
    const description = await reply.json();
    if (this.dataset !== dataset) return;
    this.#tiles.clear();
    this.template = description.tiles[0];
    this.maxLevel = description.maxzoom ?? 14;
    const [left, right] = [toX(west), toX(east) + (east < west ? 1 : 0)];
    this.box = { left, right, top, bottom };
    this.centre = [(left + right) / 2, (top + bottom) / 2];
    const { clientWidth, clientHeight } = this.canvas.parentElement;
    this.scale = Math.min(clientWidth / (right - left), clientHeight / (bottom - top));  // pixels of the whole world
    this.draw();
  }

  #tile(z, x, y) {
    const key = `${z}/${x}/${y}`;
    if (this.#tiles.has(key)) return this.#tiles.get(key);
    if (this.#tiles.size > kMaxTiles) this.#tiles.delete(this.#tiles.keys().next().value);
    this.#tiles.set(key, undefined);
    this.#load(key, z, x, y, this.dataset).catch(() => setTimeout(() => {
      if (this.#tiles.get(key)) return;
      this.#tiles.delete(key);
      this.draw();
    }, kRetryMs));
    return undefined;
  }

  // The image at `url`; undefined where there is none. Throws if it may be there later.
  async #image(url, options) {
    const reply = await fetch(url, { headers: this.access.headers });
    if (reply.status === 429 || reply.status >= 500) throw new Error(`the server answered ${reply.status} to ${url}`);
    return reply.ok ? createImageBitmap(await reply.blob(), options) : undefined;
  }

  // The part of the dataset's image for a tile of heights; undefined where there is none.
  async #photo(z, x, y, width, dataset) {
    if (!this.imagery || !dataset.urls.imagery || z > dataset.imagery.max_level) return undefined;
    const url = `${dataset.urls.imagery.replace("tiles.json", `${z}/${x}/${y}.webp`)}?v=${dataset.version}`;
    const image = await this.#image(url);
    if (!image) return undefined;
    const context = new OffscreenCanvas(width, width).getContext("2d");
    context.drawImage(image, 0, 0, width, width);
    return context.getImageData(0, 0, width, width);
  }

  // Draws anew with other switches.
  setLook(look) {
    Object.assign(this, look);
    this.look = (this.look ?? 0) + 1;
    this.#tiles.clear();
    this.draw();
  }

  async #load(key, z, x, y, dataset) {
    const { look } = this;
    const url = this.template.replace("{z}", z).replace("{x}", x).replace("{y}", y);
    const image = await this.#image(url, { colorSpaceConversion: "none", premultiplyAlpha: "none" });
    if (!image) return;
    const tile = Object.assign(document.createElement("canvas"), { width: image.width, height: image.height });
    const context = tile.getContext("2d", { willReadFrequently: true });
    context.drawImage(image, 0, 0);
    const pixels = context.getImageData(0, 0, tile.width, tile.height);
    const metres = (40075017 * Math.cos((toLatitude((y + 0.5) / 2 ** z) * Math.PI) / 180)) / 2 ** z / tile.width;
    const share = (of, pixel) => (of + (pixel + 0.5) / tile.width) / 2 ** z;
    const photo = await this.#photo(z, x, y, tile.width, dataset);
    if (dataset !== this.dataset || look !== this.look) return;
    paint(pixels, tile.width, {
      heights: dataset.heights, metres, isInside: (i, j) => this.#isInside(share(x, i), share(y, j)), photo,
      interval: this.contours ? niceInterval(metres * 8) : 0,
    });
    context.putImageData(pixels, 0, 0);
    this.#tiles.set(key, tile);
    this.draw();
  }

  // `x`, `y`: a place in the world, or the nearest one in a square of `margin` around it.
  #isInside(x, y, margin = 0) {
    const { left, right, top, bottom } = this.box;
    const isAcross = [x, x + 1].some((place) => place > left - margin && place < right + margin);
    return isAcross && y > top - margin && y < bottom + margin;
  }

  draw() {
    if (!this.template || this.frame) return;
    this.frame = requestAnimationFrame(() => {
      this.frame = undefined;
      if (this.template) this.#paint();
    });
  }

  #paint() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    Object.assign(this.canvas, { width, height });
    const context = this.canvas.getContext("2d");
    const z = Math.max(0, Math.min(this.maxLevel, Math.round(Math.log2(this.scale / kTile))));
    const side = 2 ** z;
    const size = this.scale / side;
    const [left, top] = [this.centre[0] * this.scale - width / 2, this.centre[1] * this.scale - height / 2];
    for (let y = Math.max(0, Math.floor(top / size)); y < side && y * size < top + height; ++y) {
      for (let x = Math.floor(left / size); x * size < left + width; ++x) {
        const column = ((x % side) + side) % side;
        const half = 0.5 / side;
        if (!this.#isInside(column / side + half, y / side + half, half)) continue;
        const tile = this.#tile(z, column, y);
        if (tile) context.drawImage(tile, Math.floor(x * size - left), Math.floor(y * size - top), Math.ceil(size) + 1, Math.ceil(size) + 1);
      }
    }
  }

  move(right, down) {
    this.centre = [this.centre[0] + right / this.scale, Math.max(0, Math.min(1, this.centre[1] + down / this.scale))];
    this.draw();
  }

  zoom(factor) {
    this.scale = Math.max(kTile / 2, Math.min(kTile * 2 ** (this.maxLevel + 2), this.scale * factor));
    this.draw();
  }

  // Longitude and latitude of a place on the page.
  placeOf(x, y) {
    const { clientWidth, clientHeight } = this.canvas.parentElement;
    return [toLongitude(this.centre[0] + (x - clientWidth / 2) / this.scale), toLatitude(this.centre[1] + (y - clientHeight / 2) / this.scale)];
  }

  #steer(element) {
    const pointers = new Map();  // by id: the last place of the mouse, or of each finger
    let moved = 0;
    const hull = () => {
      const [first, second = first] = pointers.values();
      return { x: (first.x + second.x) / 2, y: (first.y + second.y) / 2, size: Math.hypot(second.x - first.x, second.y - first.y) };
    };
    element.addEventListener("pointerdown", ({ pointerId, x, y }) => {
      element.setPointerCapture(pointerId);
      if (pointers.size === 0) moved = 0;
      if (pointers.size < 2) pointers.set(pointerId, { x, y });
    });
    element.addEventListener("pointermove", ({ pointerId, x, y }) => {
      if (!pointers.has(pointerId)) return;
      const before = hull();
      pointers.set(pointerId, { x, y });
      const after = hull();
      moved += Math.abs(after.x - before.x) + Math.abs(after.y - before.y) + Math.abs(after.size - before.size);
      this.move(before.x - after.x, before.y - after.y);
      if (before.size > 0 && after.size > 0) this.zoom(after.size / before.size);
    });
    element.addEventListener("pointercancel", ({ pointerId }) => pointers.delete(pointerId));
    element.addEventListener("pointerup", ({ pointerId, x, y }) => {
      if (pointers.delete(pointerId) && pointers.size === 0 && moved < 4) this.onPick?.(...this.placeOf(x, y));
    });
    element.addEventListener("wheel", (event) => {
      this.zoom(2 ** (-event.deltaY / 300));
      event.preventDefault();
    }, { passive: false });
    const arrows = { ArrowLeft: [-60, 0], ArrowRight: [60, 0], ArrowUp: [0, -60], ArrowDown: [0, 60] };
    const zooms = { "+": 1.5, "=": 1.5, "-": 1 / 1.5 };
    element.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key in arrows) this.move(...arrows[event.key]);
      else if (event.key in zooms) this.zoom(zooms[event.key]);
      else if (event.key === "Enter") this.onPick?.(toLongitude(this.centre[0]), toLatitude(this.centre[1]));
      else return;
      event.preventDefault();
    });
  }
}

// The list of datasets. While it cannot be read, or the server prepares the only ones, tells so and asks again.
async function listWhenThere(fail) {
  for (let asked = firstList; ; asked = access.list()) {
    try {
      const list = await asked;
      byId("message").hidden = true;
      if (list.datasets.length > 0 || list.preparing.length === 0) return list;
      fail(list.preparing.map((pending) => pendingText(pending)).join(" "));
    } catch (error) {
      if (error instanceof UnknownToken) access.token = "";  // there is no field for another one
      else fail(`The list of datasets could not be read: ${error.message}. Is the server running?`);
    }
    await new Promise((resolve) => setTimeout(resolve, kPendingMs));
  }
}

export async function startFlatMap() {
  document.body.classList.add("flat");
  const map = new FlatMap(byId("globe"), access);
  byId("globe").setAttribute("aria-label", "Map. Arrow keys move it, plus and minus zoom, Enter reads the height in the middle.");
  const say = (text) => Object.assign(byId("note"), { textContent: text, hidden: !text });
  const fail = (error) => Object.assign(byId("message"), { textContent: error.message ?? String(error), hidden: false });
  say("This browser has no WebGL 2 that the globe can use. This is a flat map of the same heights.");
  try {
    const { datasets, preparing, moreWithToken } = await listWhenThere(fail);
    if (datasets.length === 0) throw new Error("There is no dataset that this page may show.");
    byId("dataset").replaceChildren(...datasets.map(({ name }) => new Option(name, name)));
    const named = () => new URLSearchParams(location.hash.slice(1)).get("dataset");
    const shows = new Turns();
    const clicks = new Turns();
    // Returns whether no other dataset was wanted meanwhile.
    const show = async (name) => {
      const isLatest = shows.begin();
      const dataset = datasets.find((candidate) => candidate.name === name) ?? datasets[0];
      byId("dataset").value = dataset.name;
      byId("readout").hidden = true;
      document.title = `${dataset.name} · terrace`;
      if (named() !== dataset.name) history.replaceState(undefined, "", `#dataset=${encodeURIComponent(dataset.name)}`);
      byId("attribution").textContent = textOf(dataset.attribution, dataset.imagery?.attribution);
      byId("imagery").parentElement.hidden = !dataset.urls.imagery;
      drawLegend(byId("legend"), "height", dataset.heights);
      byId("message").hidden = true;
      await map.show(dataset).catch((error) => isLatest() && fail(error));
      return isLatest();
    };
    byId("dataset").addEventListener("change", (event) => show(event.target.value));
    for (const name of ["contours", "imagery"]) {
      byId(name).addEventListener("change", ({ target }) => map.setLook({ [name]: target.checked }));
    }
    byId("home").addEventListener("click", () => show(byId("dataset").value));
    map.onPick = async (longitude, latitude) => {
      if (!map.template) return;
      const isLatest = clicks.begin();
      const { dataset } = map;
      const text = await access.heightAt(dataset, longitude, latitude).then((height) =>
        (height === undefined ? "No height there" : formatPosition({ longitude, latitude, height })), () => "The height could not be read");
      if (!isLatest() || dataset !== map.dataset) return;
      byId("readout").hidden = false;
      byId("readout").textContent = text;
    };
    const open = async () => {
      const wanted = named();
      if (!await show(wanted)) return;
      if (!wanted || wanted === map.dataset.name || !byId("message").hidden) return;
      const pending = preparing.find(({ name }) => name === wanted);
      if (pending) fail(pendingText(pending, `Reload the page then; this is ${map.dataset.name}.`));
      else if (moreWithToken) fail(`${wanted} needs a token, or is not on this server; this is ${map.dataset.name}.`);
      else fail(`There is no dataset ${wanted} on this server; this is ${map.dataset.name}.`);
    };
    addEventListener("hashchange", open);
    await open();
  } catch (error) {
    fail(error);
  }
}
