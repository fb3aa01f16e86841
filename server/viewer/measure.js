// Measuring on the globe: distance over the ground with a profile, and line of sight. Heights are the dataset's own, from
// /heights, not those of the drawn triangles.
import { kRefraction, measurePath, seenGround } from "/viewer/ground_path.js";
import { formatHeight, formatMetres } from "/viewer/numbers.js";
import { ProfilePlot } from "/viewer/profile_plot.js";

const kSamples = 400;
const kTitles = { distance: "Distance", sight: "Line of sight" };
const kHints = {
  distance: ["Click the ground to set the first point.", "Click the next point."],
  sight: ["Click the ground to set the observer.", "Click what the observer looks at."],
};

const byId = (id) => document.getElementById(id);

export class Measure {
  #turn = 0;  // of overlapping requests only the latest is shown

  // `access`: the server. `dataset()`: the shown dataset. `onMode(name)`: a mode begins, or undefined: it ends.
  constructor({ globe, access, dataset, onMode }) {
    Object.assign(this, { globe, access, dataset, onMode, mode: undefined, corners: [], points: [] });
    this.plot = new ProfilePlot(byId("plot"), (index) => this.#showPlace(index));
    byId("dock-close").addEventListener("click", () => this.end());
    byId("dock-undo").addEventListener("click", () => this.undo());
    for (const id of ["eye", "target"]) byId(id).addEventListener("input", () => this.#describe());
  }

  // Begins "distance" or "sight"; ends the mode if it is under way.
  toggle(mode) {
    const isEnd = this.mode === mode;
    this.end();
    if (isEnd) return;
    this.mode = mode;
    this.globe.overlay.setMarker("picked", undefined);
    this.globe.onClick = (ground) => ground && this.add(ground);
    document.querySelectorAll(".eye").forEach((label) => (label.hidden = mode !== "sight"));
    byId("dock").hidden = false;
    byId("dock-title").textContent = kTitles[mode];
    this.onMode(mode);
    this.#update();
  }

  end() {
    if (!this.mode) return;
    this.mode = undefined;
    this.globe.onClick = undefined;
    this.corners = [];
    this.#clear();
    byId("dock").hidden = true;
    this.onMode(undefined);
  }

  // Points of the measurement as [longitude, latitude].
  get places() {
    return this.corners.map(({ longitude, latitude }) => [longitude, latitude]);
  }

  add(ground) {
    if (this.mode === "sight" && this.corners.length === 2) this.corners = [];
    this.corners.push(ground);
    return this.#update();
  }

  undo() {
    this.corners.pop();
    return this.#update();
  }

  #clear() {
    ++this.#turn;
    this.points = [];
    this.globe.overlay.setLine("measured", undefined);
    for (const name of ["start", "end", "place"]) this.globe.overlay.setMarker(name, undefined);
    byId("plot").hidden = true;
  }

  async #update() {
    this.#clear();
    const { corners, mode } = this;
    this.globe.overlay.setMarker("start", corners[0]);
    if (corners.length > 1) this.globe.overlay.setMarker("end", corners.at(-1));
    byId("dock-undo").hidden = corners.length === 0;
    byId("dock-text").textContent = kHints[mode][Math.min(1, corners.length)];
    if (corners.length < 2) return;
    const turn = this.#turn;
    try {
      const points = await this.access.profile(this.dataset(), corners, kSamples);
      if (turn !== this.#turn) return;
      this.points = points;
      this.#describe();
    } catch (error) {
      if (turn === this.#turn) byId("dock-text").textContent = `The heights could not be read: ${error.message}.`;
    }
  }

  #describe() {
    const { points, mode } = this;
    if (points.length < 2) return;
    byId("plot").hidden = false;
    if (mode === "sight") return this.#describeSight();
    const { length, along, up, down, min, max } = measurePath(points);
    const isKnown = min <= max;
    byId("dock-text").textContent = `${formatMetres(length)} straight, ` + (isKnown ?
      `${formatMetres(along)} along the ground, ${formatHeight(up)} up, ${formatHeight(down)} down, between ${formatHeight(min)} and ${formatHeight(max)}` :
      "no heights there");
    this.globe.overlay.setLine("measured", [{ className: "path", points: this.#onGround(points) }]);
    this.plot.show(points);
  }

  // The server has the verdict: it compares the line with all ground below it, not with samples.
  async #describeSight() {
    const turn = ++this.#turn;
    const { points, corners } = this;
    const [eye, target] = ["eye", "target"].map((id) => Math.max(0, byId(id).valueAsNumber || 0));
    try {
      const { visible, clearance, lowest } = await this.access.sight(this.dataset(), corners, { eye, target, refraction: kRefraction });
      if (turn !== this.#turn) return;
      const seen = seenGround(points, eye);
      const share = seen.filter(Boolean).length / seen.length;
      const verdict = visible ? "Visible" : `Hidden: the ground at ${formatMetres(lowest.distance)} stands ${formatMetres(-clearance)} above the line`;
      byId("dock-text").textContent = `${verdict}. ${formatMetres(points.at(-1).distance)} away; ${Math.round(100 * share)} % of the ground between is seen.`;
      this.#drawSeen(seen);
      this.plot.show(points, { seen, eye, target, isTargetSeen: visible });
    } catch (error) {
      if (turn === this.#turn) byId("dock-text").textContent = `The line of sight could not be computed: ${error.message}.`;
    }
  }

  #drawSeen(seen) {
    const { points } = this;
    const pieces = [];
    points.forEach((point, i) => {
      const className = seen[i] ? "seen" : "unseen";
      if (pieces.at(-1)?.className !== className) pieces.push({ className, points: i > 0 ? [points[i - 1]] : [] });
      pieces.at(-1).points.push(point);
    });
    this.globe.overlay.setLine("measured", pieces.map((piece) => ({ ...piece, points: this.#onGround(piece.points) })));
  }

  #onGround(points) {
    return points.map((point) => ({ ...point, height: point.height ?? 0 }));
  }

  #showPlace(index) {
    const point = this.points[index];
    this.globe.overlay.setMarker("place", point && this.#onGround([point])[0]);
  }
}
