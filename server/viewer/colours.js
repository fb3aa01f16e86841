// Colours by height, slope and aspect, as strips of pixels and as numbers. Uses neither CesiumJS nor WebGL.

// Depth and height as fractions of the dataset's range, and sRGB. Low ground has most of the colours, because most land
// is low.
const kSea = [
  [0.0, 5, 16, 48], [0.25, 10, 44, 98], [0.5, 20, 78, 138], [0.75, 38, 112, 168], [0.93, 78, 154, 196],
  [1.0, 136, 196, 212],
];
const kLand = [
  [0.0, 74, 122, 84], [0.07, 98, 144, 88], [0.16, 146, 166, 98], [0.28, 200, 184, 118], [0.42, 198, 154, 94],
  [0.56, 166, 116, 74], [0.7, 134, 96, 76], [0.82, 158, 142, 136], [0.92, 222, 219, 217], [1.0, 255, 255, 255],
];
// If the lowest height is above this, it counts as land below the ellipsoid, not as a sea floor.
const kShallowestSeaFloor = -200;
// Datasets of land store the sea as a plain: level ground below this fraction of the heights is drawn as water, if the
// dataset reaches sea level.
const kWaterShare = 0.025;
const kHighestSea = 50;
const kMinRelief = 300;

function colourAt(stops, t) {
  const next = Math.max(1, stops.findIndex((stop) => stop[0] >= t));
  const [t0, ...a] = stops[next - 1];
  const [t1, ...b] = stops[next];
  const s = Math.min(1, Math.max(0, (t - t0) / (t1 - t0)));
  return a.map((channel, i) => Math.round(channel + s * (b[i] - channel)));
}

// sRGB colour of a height in a dataset whose heights run from `min` to `max`, metres.
export function heightColour(height, { min, max }) {
  if (min > kShallowestSeaFloor) return colourAt(kLand, (height - min) / Math.max(max - min, 1));
  return height < 0 ? colourAt(kSea, 1 - height / min) : colourAt(kLand, Math.pow(height / Math.max(max, 1), 0.8));
}

export function waterline({ min, max }) {
  const coastal = min > kShallowestSeaFloor && min < kHighestSea && max - min > kMinRelief;
  return coastal ? min + kWaterShare * (max - min) : -1e5;
}

// A one-pixel-high strip; `colourOf` gets fractions from 0 on the left to 1.
function drawStrip(canvas, colourOf) {
  const pixels = canvas.getContext("2d").createImageData(canvas.width, 1);
  for (let x = 0; x < canvas.width; ++x) pixels.data.set([...colourOf(x / (canvas.width - 1)), 255], 4 * x);
  canvas.getContext("2d").putImageData(pixels, 0, 0);
  return canvas;
}

// The strip of a dataset's heights, min on the left.
export function drawRamp(canvas, heights) {
  return drawStrip(canvas, (t) => heightColour(heights.min + t * (heights.max - heights.min), heights));
}

// Slope in degrees, 0 to kSteepest; the steps that avalanche maps use are easy to tell apart.
export const kSteepest = 60;
const kSlope = [
  [0.0, 232, 238, 226], [0.25, 190, 214, 150], [0.42, 240, 222, 110], [0.5, 244, 180, 76], [0.6, 226, 108, 62],
  [0.72, 176, 52, 80], [0.85, 110, 36, 110], [1.0, 48, 22, 72],
];
// The direction that a slope faces: north, east, south, west, north.
const kAspect = [
  [0.0, 92, 128, 196], [0.25, 122, 196, 168], [0.5, 244, 206, 98], [0.75, 214, 108, 104], [1.0, 92, 128, 196],
];

// What the ground can be coloured by, with the ticks of the legend as [fraction, text].
const kCompass = ["N", "E", "S", "W", "N"];
export const kColourings = {
  height: { draw: drawRamp },
  slope: {
    draw: (canvas) => drawStrip(canvas, (t) => colourAt(kSlope, t)),
    ticks: [0, 15, 30, 45, 60].map((degrees) => [degrees / kSteepest, `${degrees}°`]),
  },
  aspect: {
    draw: (canvas) => drawStrip(canvas, (t) => colourAt(kAspect, t)),
    ticks: kCompass.map((name, i) => [i / 4, name]),
  },
};

// 1, 2 or 5 times a power of ten.
export function niceInterval(metres) {
  const power = 10 ** Math.floor(Math.log10(metres));
  const lead = metres / power;
  return (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10) * power;
}

// Round heights for the legend as [fraction of the range, metres]; the highest and lowest are at round numbers inside.
export function heightTicks({ min, max }) {
  if (max <= min) return [];
  const step = niceInterval((max - min) / 4);
  const ticks = [];
  for (let height = Math.ceil(min / step) * step; height <= max; height += step) {
    ticks.push([(height - min) / (max - min), Math.round(height * 100) / 100]);
  }
  return ticks;
}
