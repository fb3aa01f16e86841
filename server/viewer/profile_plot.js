// Draws a profile as SVG and tells the place under the pointer.
import { niceInterval } from "/viewer/colours.js";
import { drop } from "/viewer/ground_path.js";
import { formatHeight, formatMetres } from "/viewer/numbers.js";
import { svg } from "/viewer/overlay.js";

const kMargin = { left: 76, right: 14, top: 10, bottom: 22 };
const kKeys = { ArrowLeft: -1, ArrowRight: 1, PageDown: -10, PageUp: 10, Home: -Infinity, End: Infinity };

// Round values between two ends, and the digits behind the point that tell them apart.
function ticks(low, high, count) {
  const step = niceInterval(Math.max(1e-3, (high - low) / count));
  const values = [];
  for (let value = Math.ceil(low / step) * step; value <= high; value += step) values.push(value);
  return { values, digits: Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)) };
}

export class ProfilePlot {
  // `onPlace` gets the index of a point, or undefined if there is none.
  constructor(element, onPlace) {
    Object.assign(this, { element, onPlace, points: [], index: undefined });
    const follow = (event) => this.#choose(this.#indexAt(event.clientX - element.getBoundingClientRect().left));
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      follow(event);
    });
    element.addEventListener("pointermove", follow);
    element.addEventListener("keydown", (event) => {
      if (!(event.key in kKeys) || event.ctrlKey || event.metaKey || event.altKey) return;
      this.#choose((this.index ?? 0) + kKeys[event.key]);
      event.preventDefault();
    });
    new ResizeObserver(() => this.points.length > 1 && this.#draw()).observe(element);
  }

  // `points`: [{distance, height}]. `sight`, optional: {eye, target, seen, isTargetSeen}, metres above the ends, and what seenGround returns.
  show(points, sight) {
    Object.assign(this, { points, sight, index: undefined });
    this.element.setAttribute("aria-valuemax", Math.max(0, points.length - 1));
    this.element.setAttribute("aria-valuenow", 0);
    this.element.removeAttribute("aria-valuetext");
    this.#draw();
  }

  // The height as drawn: with a line of sight, the Earth falls away below it.
  #drawn({ distance, height }) {
    return height === undefined ? undefined : height - (this.sight ? drop(distance) : 0);
  }

  #draw() {
    const { clientWidth: width, clientHeight: height } = this.element;
    const { points, sight } = this;
    const heights = points.map((point) => this.#drawn(point));
    const known = heights.filter((value) => value !== undefined);
    if (known.length === 0) return this.element.replaceChildren();
    const ends = sight ? [heights[0] + sight.eye, heights.at(-1) + sight.target].filter(Number.isFinite) : [];
    const [low, high] = [Math.min(...known, ...ends), Math.max(...known, ...ends)];
    const air = Math.max(1, 0.08 * (high - low));
    const [bottom, top] = [low - air, high + air];
    const length = points.at(-1).distance || 1;  // 0 between equal points
    this.x = (distance) => kMargin.left + (distance / length) * (width - kMargin.left - kMargin.right);
    this.y = (value) => kMargin.top + ((top - value) / (top - bottom)) * (height - kMargin.top - kMargin.bottom);

    const root = svg("svg", { width, height, "aria-hidden": "true" });
    const levels = ticks(bottom, top, 4);
    for (const value of levels.values) {
      svg("path", { class: "grid", d: `M${kMargin.left} ${this.y(value)}H${width - kMargin.right}` }, root);
      svg("text", { x: kMargin.left - 6, y: this.y(value), "text-anchor": "end", "dominant-baseline": "central" }, root)
        .textContent = formatHeight(value, levels.digits);
    }
    for (const value of ticks(0, points.at(-1).distance, Math.max(2, width / 140)).values) {
      const anchor = this.x(value) > width - 50 ? "end" : this.x(value) < kMargin.left + 10 ? "start" : "middle";
      svg("text", { x: this.x(value), y: height - 5, "text-anchor": anchor }, root).textContent = formatMetres(value);
    }
    this.#drawGround(root, heights, height - kMargin.bottom);
    if (sight) {
      const d = `M${this.x(0)} ${this.y(ends[0])}L${this.x(points.at(-1).distance)} ${this.y(ends.at(-1))}`;
      svg("path", { class: sight.isTargetSeen ? "sight clear" : "sight blocked", d }, root);
    }
    this.cursor = svg("path", { class: "cursor" }, root);
    this.value = svg("text", { class: "value", y: kMargin.top + 4 }, root);
    this.element.replaceChildren(root);
    this.#mark();
  }

  // Pieces of the ground between voids, and of one visibility.
  #drawGround(root, heights, base) {
    const { points, sight } = this;
    for (let from = 0; from < points.length - 1; ) {
      if (heights[from] === undefined) {
        ++from;
        continue;
      }
      let to = from;
      const isHidden = sight && !sight.seen[from + 1];
      while (to < points.length - 1 && heights[to + 1] !== undefined && (sight && !sight.seen[to + 1]) === isHidden) ++to;
      if (to > from) {
        const line = [];
        for (let i = from; i <= to; ++i) line.push(`${this.x(points[i].distance).toFixed(1)} ${this.y(heights[i]).toFixed(1)}`);
        const d = `M${line.join("L")}`;
        const kind = isHidden ? "hidden-ground" : "ground";
        svg("path", { class: `${kind} fill`, d: `${d}V${base}H${this.x(points[from].distance)}Z` }, root);
        svg("path", { class: kind, d }, root);
      }
      from = Math.max(to, from + 1);
    }
  }

  #indexAt(x) {
    const { left, right } = kMargin;
    const share = (x - left) / (this.element.clientWidth - left - right);
    return Math.round(share * (this.points.length - 1));
  }

  #choose(index) {
    if (this.points.length < 2) return;
    this.index = Math.min(this.points.length - 1, Math.max(0, index));
    this.#mark();
    this.onPlace(this.index);
  }

  #mark() {
    const point = this.points[this.index];
    if (!point || !this.cursor) return;
    const text = `${formatMetres(point.distance)}: ${point.height === undefined ? "no height" : formatHeight(point.height)}`;
    const x = this.x(point.distance);
    this.cursor.setAttribute("d", `M${x} ${kMargin.top}V${this.element.clientHeight - kMargin.bottom}`);
    const isRight = x > this.element.clientWidth - 130;
    this.value.setAttribute("x", x + (isRight ? -6 : 6));
    this.value.setAttribute("text-anchor", isRight ? "end" : "start");
    this.value.textContent = text;
    this.element.setAttribute("aria-valuenow", this.index);
    this.element.setAttribute("aria-valuetext", text);
  }
}
