// The controls and the numbers beside the globe. Uses the page's elements, but not CesiumJS.
import { textOf } from "/viewer/attribution.js";
import { fractionOfStep, kCoarsest, kFinest, stepOfFraction } from "/viewer/framing.js";
import { drawLegend } from "/viewer/legend.js";
import {
  formatBytes, formatCompact, formatFraction, formatHeight, formatMetres, formatNumber, formatPosition,
} from "/viewer/numbers.js";
import { Splitter } from "/viewer/splitter.js";
import { kPhases } from "/viewer/traffic.js";

const byId = (id) => document.getElementById(id);
const kSwitches = ["contours", "wireframe", "tiles3d", "compare", "sunny", "edits", "imagery"];
const kTools = ["distance", "sight", "draft"];

export class Panel {
  // `actions`: dataset(name), home(), whole(), token(), fraction(value), right(value), exaggeration(value), colouring(name),
  // contours(on), wireframe(on), tiles3d(on), compare(on), sunny(on), edits(on), imagery(on), sun(text), split(share),
  // tool(name), link().
  constructor(actions) {
    byId("dataset").addEventListener("change", (event) => actions.dataset(event.target.value));
    byId("home").addEventListener("click", actions.home);
    byId("whole").addEventListener("click", actions.whole);
    byId("use-token").addEventListener("click", actions.token);
    for (const name of ["fraction", "right"]) {
      Object.assign(byId(name), { min: kCoarsest, max: kFinest, step: 1 });
      let settle;
      byId(name).addEventListener("input", (event) => {
        const { target } = event;
        const step = target.valueAsNumber;
        this.setFraction(fractionOfStep(step), name);
        clearTimeout(settle);  // steps passed during a drag should not be fetched
        settle = setTimeout(() => {
          // Another dataset or switch may have moved or hidden the slider.
          if (target.valueAsNumber === step && !target.closest(".field").hidden) actions[name](fractionOfStep(step));
        }, 250);
      });
    }
    byId("exaggeration").addEventListener("input", (event) => {
      this.setExaggeration(event.target.valueAsNumber);
      actions.exaggeration(event.target.valueAsNumber);
    });
    byId("colouring").addEventListener("change", (event) => actions.colouring(event.target.value));
    for (const id of ["sun-date", "sun-hour"]) byId(id).addEventListener("input", ({ target }) => this.#readSun(target, actions));
    for (const tool of kTools) byId(`tool-${tool}`).addEventListener("click", () => actions.tool(tool));
    byId("link").addEventListener("click", actions.link);
    byId("help").addEventListener("click", () => byId("keys").showModal());
    for (const name of kSwitches) {
      byId(name).addEventListener("change", (event) => actions[name](event.target.checked));
    }
    this.splitter = new Splitter(byId("splitter"), actions.split);
  }

  // A date that is being typed is incomplete; then the hour belongs to the last complete one.
  #readSun(changed, actions) {
    const date = byId("sun-date");
    const isComplete = date.value !== "" && date.validity.valid;
    if (changed === date && !isComplete) return;
    const hour = byId("sun-hour").valueAsNumber;
    const two = (value) => String(Math.floor(value)).padStart(2, "0");
    actions.sun(`${isComplete ? date.value : this.day}T${two(hour)}:${two((hour % 1) * 60)}`);
  }

  // `text`: "2026-06-21T18:30"; undefined: no sun.
  setSun(text) {
    byId("sunny").checked = Boolean(text);
    byId("sun-field").hidden = !text;
    if (!text) return;
    const [hour, minute] = text.slice(11).split(":").map(Number);
    this.day = text.slice(0, 10);
    byId("sun-date").value = this.day;
    byId("sun-hour").value = hour + minute / 60;
    byId("sun-value").textContent = text.slice(11);
    byId("sun-hour").setAttribute("aria-valuetext", text.slice(11));
  }

  setTool(name) {
    for (const tool of kTools) byId(`tool-${tool}`).setAttribute("aria-pressed", String(tool === name));
  }

  // A passing remark.
  note(text) {
    byId("note").textContent = text;
    byId("note").hidden = !text;
    clearTimeout(this.noteTimer);
    this.noteTimer = setTimeout(() => (byId("note").hidden = true), 4000);
  }

  // `preparing`: datasets that are not there yet. `moreWithToken`: a token may show others. `shown`: name of the dataset
  // that is drawn.
  setDatasets(datasets, preparing, moreWithToken, shown) {
    const absent = (name, why) => Object.assign(new Option(`${name} (${why})`, name), { disabled: true });
    const pending = preparing.map(({ name }) => absent(name, "being prepared"));
    const isGone = shown !== undefined && ![...datasets, ...preparing].some(({ name }) => name === shown);
    if (isGone) pending.push(absent(shown, "no longer there"));
    const names = [...datasets, {}, ...preparing, { name: isGone }].map(({ name }) => name).join("\n");
    byId("use-token").hidden = !moreWithToken;
    if (names === this.names) return;  // an open list must not close
    this.names = names;
    byId("dataset").replaceChildren(...datasets.map(({ name }) => new Option(name, name)), ...pending);
    if (shown) byId("dataset").value = shown;
  }

  // `hasPart`: the first view shows a part of the dataset.
  setDataset({ name, heights, attribution, urls, imagery, isArchive }, hasPart) {
    byId("edits").parentElement.hidden = !urls.edits;
    byId("imagery").parentElement.hidden = !urls.imagery_geodetic;
    byId("tiles3d").parentElement.hidden = !urls.tileset;
    for (const id of ["fraction", "compare"]) byId(id).parentElement.hidden = isArchive;  // which has one error
    byId("dataset").value = name;
    byId("whole").hidden = !hasPart;
    document.title = `${name} · terrace`;
    this.heights = heights;
    this.setColouring(byId("colouring").value);
    byId("attribution").textContent = textOf(attribution, imagery?.attribution, "drawn with CesiumJS");
  }

  setColouring(name) {
    byId("colouring").value = name;
    if (this.heights) drawLegend(byId("legend"), name, this.heights);
  }

  // `name`: "fraction", or "right" of the line.
  setFraction(fraction, name = "fraction") {
    byId(name).value = stepOfFraction(fraction);
    const text = `${formatFraction(fraction)} of the level's`;
    byId(`${name}-value`).textContent = text;
    byId(name).setAttribute("aria-valuetext", text);
  }

  setExaggeration(factor) {
    byId("exaggeration").value = factor;
    byId("exaggeration-value").textContent = factor === 1 ? "true to scale" : `${factor} ×`;
  }

  setSwitches({ contours, wireframe, tiles3d, edits, imagery, fraction, right }) {
    byId("edits").checked = edits;
    byId("imagery").checked = imagery;
    byId("contours").checked = contours;
    byId("wireframe").checked = wireframe;
    byId("tiles3d").checked = tiles3d;
    byId("compare").checked = right !== undefined;
    byId("right-field").hidden = right === undefined;
    byId("splitter").hidden = !tiles3d && right === undefined;
    const names = right === undefined ? ["quantized-mesh", "3D Tiles"] : [fraction, right].map((value) => `error ${formatFraction(value)}`);
    byId("splitter").querySelectorAll("span").forEach((label, i) => (label.textContent = names[i]));
    if (right !== undefined) this.setFraction(right, "right");
  }

  setInterval(metres) {
    byId("interval").textContent = metres > 0 ? formatMetres(metres) : "";
  }

  setActivity(text) {
    if (byId("activity").textContent !== text) byId("activity").textContent = text;
  }

  // `measured`: metres at full resolution, beside the height of the drawn triangle.
  setReadout(position, measured) {
    byId("readout").hidden = !position;
    const data = measured === undefined ? "" : `  ·  data ${formatHeight(measured)}`;
    byId("readout").textContent = position ? formatPosition(position) + data : "";
  }

  // No later message takes its place.
  setLastMessage(text) {
    this.setMessage(text);
    this.setMessage = () => {};
  }

  setMessage(text) {
    byId("message").hidden = !text;
    byId("message").textContent = text ?? "";
  }

  // `tiles3d`: statistics of the drawn 3D Tiles, if any. `isErrors`: they are there for their error.
  setStats(drawn, traffic, tiles3d, isErrors) {
    const error = (keys) => {
      const worst = traffic.worstError(keys);
      return worst === undefined ? "–" : formatMetres(worst);
    };
    const perTile = (phase) => traffic.milliseconds[phase] / Math.max(1, traffic.computed);
    const total = kPhases.reduce((sum, phase) => sum + perTile(phase), 0);
    const rows = tiles3d ? [
      ["", ...(isErrors ? ["left", "right"] : ["mesh", "3D Tiles"])],
      ["Triangles, skirts too", formatCompact(drawn.withSkirts), formatCompact(tiles3d.triangles)],
      ["Tiles shown", formatNumber(drawn.tiles), formatNumber(tiles3d.tiles)],
      ["Tiles fetched", formatNumber(traffic.tiles), formatNumber(traffic.tiles3d.tiles)],
      ["Over the wire", formatBytes(traffic.bytes), formatBytes(traffic.tiles3d.bytes)],
      ["Worst error shown", error(drawn.keys), error(tiles3d.keys)],
    ] : [
      ["Triangles", formatCompact(drawn.triangles)],
      ["Vertices", formatCompact(drawn.vertices)],
      ["Tiles shown", `${drawn.tiles} · level ${drawn.deepest}`],
      ["Tiles fetched", formatNumber(traffic.tiles)],
      ["Over the wire", formatBytes(traffic.bytes)],
      ["Cache hits", traffic.answers ? `${Math.round((100 * traffic.hits) / traffic.answers)} %` : "–"],
      ["Worst error shown", error(drawn.keys)],
      ["Server per tile", traffic.computed ? `${total.toFixed(1)} ms` : "–"],
    ];
    byId("stats").classList.toggle("two", tiles3d !== undefined);
    byId("stats").replaceChildren(...rows.flatMap(([name, ...values]) => [["dt", name], ...values.map((value) => ["dd", value])]
      .map(([tag, textContent]) => Object.assign(document.createElement(tag), { textContent, className: name ? "" : "heading" }))));
    const spans = (make) => kPhases.map((phase) => {
      const span = Object.assign(document.createElement("span"), { className: phase });
      make(span, phase);
      return span;
    });
    byId("phases").firstElementChild.replaceChildren(...spans((bar, phase) => {
      bar.style.flexGrow = total > 0 ? perTile(phase) / total : 0;
    }));
    byId("phases").lastElementChild.replaceChildren(...spans((name, phase) => {
      name.textContent = `${phase} ${perTile(phase).toFixed(1)}`;
    }));
  }
}
