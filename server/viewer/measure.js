// Measuring on the globe: distance over the ground with a profile, and line of sight. Heights are the dataset's own, from
// /heights, not those of the drawn triangles.
import { kRefraction, measurePath, seenGround } from "/viewer/ground_path.js";
import { formatHeight, formatMetres } from "/viewer/numbers.js";
import { ProfilePlot } from "/viewer/profile_plot.js";
import { Turns } from "/viewer/turns.js";

const kSamples = 400;
const kTitles = { distance: "Distance", sight: "Line of sight" };
const kHints = {
  distance: ["Click the ground to set the first point.", "Click the next point."],
  sight: ["Click the ground to set the observer.", "Click what the observer looks at."],
};

const byId = (id) => document.getElementById(id);

export class Measure {
  #requests = new Turns();

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
    if (byId("dock").contains(document.activeElement)) byId(`tool-${this.mode}`).focus();
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
    if (!this.mode) return undefined;
    this.corners.pop();
    return this.#update();
  }

  // The dataset has another version: its heights are read anew.
  refresh() {
    return this.mode && this.#update();
  }

  #clear() {
    this.#requests.begin();  // no reply under way counts any more
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
    const isLatest = this.#requests.begin();
    try {
      const points = await this.access.profile(this.dataset(), corners, kSamples);
      if (!isLatest()) return;
      this.points = points;
      this.#describe();
    } catch (error) {
      if (isLatest()) byId("dock-text").textContent = `The heights could not be read: ${error.message}.`;
    }
  }

  #describe() {
    const { points, mode } = this;
    if (points.length < 2) return;
    byId("plot").hidden = false;
    if (mode === "sight") return this.#describeSight();
    const { length, along, up, down, min, max, gaps } = measurePath(points);
    const isKnown = min <= max;
    byId("dock-text").textContent = `${formatMetres(length)} straight, ` + (isKnown ?
      `${formatMetres(along)} along the ground, ${formatHeight(up)} up, ${formatHeight(down)} down, between ${formatHeight(min)} and ${formatHeight(max)}` :
      "no heights there") + (isKnown && gaps ? ". Parts of the ground have no heights; they count as level." : "");
    this.globe.overlay.setLine("measured", [{ className: "path", points }]);
    this.plot.show(points);
  }

  // The server has the verdict: it compares the line with all ground below it, not with samples.
  async #describeSight() {
    const isLatest = this.#requests.begin();
    const { points, corners } = this;
    const [eye, target] = ["eye", "target"].map((id) => Math.max(0, byId(id).valueAsNumber || 0));
    const unknown = [["observer", points[0]], ["target", points.at(-1)]].filter(([, { height }]) => height === undefined);
    if (unknown.length > 0) return this.#showNoVerdict(`the dataset has no height at the ${unknown.map(([end]) => end).join(" and the ")}`);
    if (this.plot.points !== points) this.plot.show(points);  // not the measurement before
    try {
      const sight = await this.access.sight(this.dataset(), corners, { eye, target, refraction: kRefraction });
      if (!isLatest()) return;
      const seen = seenGround(points, eye);
      byId("dock-text").textContent = this.#textOf(sight, seen);
      this.#drawSeen(seen);
      this.plot.show(points, { seen, eye, target, isTargetSeen: sight.visible });
    } catch (error) {
      if (isLatest()) this.#showNoVerdict(error.message);
    }
  }

  #showNoVerdict(reason) {
    byId("dock-text").textContent = `The line of sight is not known: ${reason}.`;
    this.globe.overlay.setLine("measured", undefined);
    this.plot.show(this.points);
  }

  #textOf({ visible, clearance, lowest, gaps }, seen) {
    const known = seen.filter((value) => value !== undefined);
    const share = Math.round((100 * known.filter(Boolean).length) / known.length);
    const verdict = visible ? "Visible" : `Hidden: the ground at ${formatMetres(lowest.distance)} stands ${formatMetres(-clearance)} above the line`;
    const remark = gaps || known.length < seen.length ? " Parts of the ground have no heights; what they hide is unknown." : "";
    return `${verdict}. ${formatMetres(this.points.at(-1).distance)} away; ${share} % of the ground between is seen.${remark}`;
  }

  #drawSeen(seen) {
    const { points } = this;
    const pieces = [];
    points.forEach((point, i) => {
      if (seen[i] === undefined) return;
      const className = seen[i] ? "seen" : "unseen";
      const isAfterGap = i === 0 || seen[i - 1] === undefined;
      if (isAfterGap || pieces.at(-1).className !== className) pieces.push({ className, points: isAfterGap ? [] : [points[i - 1]] });
      pieces.at(-1).points.push(point);
    });
    this.globe.overlay.setLine("measured", pieces);
  }

  #showPlace(index) {
    this.globe.overlay.setMarker("place", this.points[index]);
  }
}
