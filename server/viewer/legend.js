// The strip of colours in the panel and the numbers below it.
import { heightTicks, kColourings } from "/viewer/colours.js";
import { formatHeight } from "/viewer/numbers.js";

const kNames = { height: "Colours by height", slope: "Colours by slope, degrees", aspect: "Colours by the direction that the ground faces" };
const kNearest = 0.24;  // of the width, between two numbers

// `colouring`: a key of kColourings. `heights`: {min, max} of the dataset.
export function drawLegend(figure, colouring, heights) {
  kColourings[colouring].draw(figure.querySelector("canvas"), heights);
  const ticks = kColourings[colouring].ticks ?? ticksOfHeights(heights);
  figure.setAttribute("aria-label", kNames[colouring]);
  figure.querySelector("figcaption").replaceChildren(...ticks.map(([at, text]) => {
    const tick = Object.assign(document.createElement("span"), { textContent: text });
    tick.style.left = `${100 * at}%`;
    tick.className = at < 0.03 ? "first" : at > 0.97 ? "last" : "";
    return tick;
  }));
}

// The ends are the dataset's own; round heights between them where there is room.
function ticksOfHeights(heights) {
  const inner = heightTicks(heights).filter(([at]) => at > kNearest && at < 1 - kNearest);
  const apart = inner.filter(([at], i) => i === 0 || at - inner[i - 1][0] >= kNearest);
  return [[0, heights.min], ...apart, [1, heights.max]].map(([at, metres]) => [at, formatHeight(metres)]);
}
