// The controls and the numbers beside the globe. Uses the page's elements, but not CesiumJS.
import { drawRamp } from "/viewer/material.js";
import { Splitter } from "/viewer/splitter.js";
import { kPhases } from "/viewer/traffic.js";

// The slider has steps of half powers of two, finer to the right: 4, 2.83, ... 1/32.
const kCoarsest = -4;
const kFinest = 10;
export const fractionOfStep = (step) => 2 ** (-step / 2);
export const stepOfFraction = (fraction) =>
  Math.min(kFinest, Math.max(kCoarsest, Math.round(-2 * Math.log2(fraction))));

const byId = (id) => document.getElementById(id);
const number = new Intl.NumberFormat("en");
const plain = { format: (value) => number.format(value).replace("-", "−") };
const compact = new Intl.NumberFormat("en", { notation: "compact", maximumSignificantDigits: 3 });

function formatMetres(metres) {
  const size = Math.abs(metres);
  const digits = size >= 100 ? 0 : size >= 10 ? 1 : 2;
  if (size >= 10000) return `${plain.format(Math.round(metres / 100) / 10)} km`;
  return `${plain.format(Number(metres.toFixed(digits)))} m`;
}

function formatBytes(bytes) {
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}

function formatFraction(fraction) {
  return fraction >= 1 ? `${Number(fraction.toFixed(2))} ×` : `1/${Number((1 / fraction).toFixed(1))}`;
}

function formatPosition({ longitude, latitude, height }) {
  const angle = (value, positive, negative) => `${Math.abs(value).toFixed(5)}° ${value < 0 ? negative : positive}`;
  return `${angle(latitude, "N", "S")}  ${angle(longitude, "E", "W")}  ${plain.format(Number(height.toFixed(1)))} m`;
}

export class Panel {
  // `actions`: dataset(name), home(), whole(), token(), fraction(value), exaggeration(value), contours(on), wireframe(on),
  // tiles3d(on), split(share).
  constructor(actions) {
    byId("dataset").addEventListener("change", (event) => actions.dataset(event.target.value));
    byId("home").addEventListener("click", actions.home);
    byId("whole").addEventListener("click", actions.whole);
    byId("use-token").addEventListener("click", actions.token);
    Object.assign(byId("fraction"), { min: kCoarsest, max: kFinest, step: 1 });
    let settle;
    byId("fraction").addEventListener("input", (event) => {
      const fraction = fractionOfStep(event.target.valueAsNumber);
      this.setFraction(fraction);
      clearTimeout(settle);  // steps passed during a drag should not be fetched
      settle = setTimeout(() => actions.fraction(fraction), 250);
    });
    byId("exaggeration").addEventListener("input", (event) => {
      this.setExaggeration(event.target.valueAsNumber);
      actions.exaggeration(event.target.valueAsNumber);
    });
    for (const name of ["contours", "wireframe", "tiles3d"]) {
      byId(name).addEventListener("change", (event) => actions[name](event.target.checked));
    }
    this.splitter = new Splitter(byId("splitter"), actions.split);
    if (matchMedia("(max-width: 560px)").matches) byId("panel").open = false;
  }

  // `moreWithToken`: a token may show others.
  setDatasets(datasets, moreWithToken) {
    byId("dataset").replaceChildren(...datasets.map(({ name }) => new Option(name, name)));
    byId("use-token").hidden = !moreWithToken;
  }

  // `hasPart`: the first view shows a part of the dataset.
  setDataset({ name, heights, attribution }, hasPart) {
    byId("dataset").value = name;
    byId("whole").hidden = !hasPart;
    document.title = `${name} · terrace`;
    drawRamp(byId("ramp"), heights);
    byId("lowest").textContent = formatMetres(heights.min);
    byId("highest").textContent = formatMetres(heights.max);
    byId("attribution").textContent = [attribution, "drawn with CesiumJS"].filter(Boolean).join(" · ");
  }

  setFraction(fraction) {
    byId("fraction").value = stepOfFraction(fraction);
    const text = `${formatFraction(fraction)} of the level's`;
    byId("fraction-value").textContent = text;
    byId("fraction").setAttribute("aria-valuetext", text);
  }

  setExaggeration(factor) {
    byId("exaggeration").value = factor;
    byId("exaggeration-value").textContent = factor === 1 ? "true to scale" : `${factor} ×`;
  }

  setSwitches({ contours, wireframe, tiles3d }) {
    byId("contours").checked = contours;
    byId("wireframe").checked = wireframe;
    byId("tiles3d").checked = tiles3d;
    byId("splitter").hidden = !tiles3d;
  }

  setInterval(metres) {
    byId("interval").textContent = metres > 0 ? formatMetres(metres) : "";
  }

  setActivity(text) {
    if (byId("activity").textContent !== text) byId("activity").textContent = text;
  }

  setReadout(position) {
    byId("readout").hidden = !position;
    byId("readout").textContent = position ? formatPosition(position) : "";
  }

  setMessage(text) {
    byId("message").hidden = !text;
    byId("message").textContent = text ?? "";
  }

  // `tiles3d`: statistics of the drawn 3D Tiles, if any.
  setStats(drawn, traffic, tiles3d) {
    const error = (keys) => {
      const worst = traffic.worstError(keys);
      return worst === undefined ? "–" : formatMetres(worst);
    };
    const perTile = (phase) => traffic.milliseconds[phase] / Math.max(1, traffic.computed);
    const total = kPhases.reduce((sum, phase) => sum + perTile(phase), 0);
    const rows = tiles3d ? [
      ["", "mesh", "3D Tiles"],
      ["Triangles, skirts too", compact.format(drawn.withSkirts), compact.format(tiles3d.triangles)],
      ["Tiles shown", plain.format(drawn.tiles), plain.format(tiles3d.tiles)],
      ["Tiles fetched", plain.format(traffic.tiles), plain.format(traffic.tiles3d.tiles)],
      ["Over the wire", formatBytes(traffic.bytes), formatBytes(traffic.tiles3d.bytes)],
      ["Worst error shown", error(drawn.keys), error(tiles3d.keys)],
    ] : [
      ["Triangles", compact.format(drawn.triangles)],
      ["Vertices", compact.format(drawn.vertices)],
      ["Tiles shown", `${drawn.tiles} · level ${drawn.deepest}`],
      ["Tiles fetched", plain.format(traffic.tiles)],
      ["Over the wire", formatBytes(traffic.bytes)],
      ["Cache hits", traffic.answers ? `${Math.round((100 * traffic.hits) / traffic.answers)} %` : "–"],
      ["Worst error shown", error(drawn.keys)],
      ["Server per tile", traffic.computed ? `${total.toFixed(1)} ms` : "–"],
    ];
    byId("stats").classList.toggle("two", tiles3d !== undefined);
    byId("stats").replaceChildren(...rows.flatMap(([name, ...values]) => [["dt", name], ...values.map((value) => ["dd", value])]
      .map(([tag, textContent]) => Object.assign(document.createElement(tag), { textContent, className: name ? "" : "heading" }))));
    byId("phases").replaceChildren(...kPhases.map((phase) => {
      const bar = document.createElement("span");
      bar.className = phase;
      bar.style.flexGrow = total > 0 ? perTile(phase) / total : 0;
      bar.title = `${phase} ${perTile(phase).toFixed(1)} ms`;
      bar.textContent = phase;
      return bar;
    }));
  }
}
