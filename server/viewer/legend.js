// The strip of colours in the panel and the numbers below it.
import { heightTicks, kColourings } from "/viewer/colours.js";
import { formatHeight } from "/viewer/numbers.js";

const kNames = { height: "Colours by height above the ellipsoid", slope: "Colours by slope, degrees", aspect: "Colours by the direction that the ground faces" };
const kShareOfLetter = 0.028;  // of the width of the strip

// `colouring`: a key of kColourings. `heights`: {min, max} of the dataset.
export function drawLegend(figure, colouring, heights) {
  kColourings[colouring].draw(figure.querySelector("canvas"), heights);
  const ticks = kColourings[colouring].ticks ?? ticksOfHeights(heights);
  figure.setAttribute("aria-label", kNames[colouring]);
  figure.title = kNames[colouring];
  figure.querySelector("figcaption").replaceChildren(...ticks.map(([at, text]) => {
    const tick = Object.assign(document.createElement("span"), { textContent: text });
    tick.style.left = `${100 * at}%`;
    tick.className = at < 0.03 ? "first" : at > 0.97 ? "last" : "";
    return tick;
  }));
}

// The ends are the dataset's own; round heights between them where there is room, first of all zero.
function ticksOfHeights(heights) {
  const text = (metres) => formatHeight(metres);
  const room = (a, b) => (kShareOfLetter * (text(a).length + text(b).length + 1)) / 2;
  const ticks = [[0, heights.min]];
  const end = (metres) => kShareOfLetter * (text(metres).length / 2);  // the texts at the ends are inside
  const rounds = heightTicks(heights);
  const zero = rounds.find(([, metres]) => metres === 0);
  for (const [at, metres] of rounds) {
    if (zero && at < zero[0] && zero[0] - at <= room(metres, 0)) continue;
    const [last, value] = ticks.at(-1);
    const before = last + (ticks.length === 1 ? end(value) : 0);
    if (at - before > room(value, metres) && 1 - end(heights.max) - at > room(metres, heights.max)) ticks.push([at, metres]);
  }
  return [...ticks, [1, heights.max]].map(([at, metres]) => [at, text(metres)]);
}
