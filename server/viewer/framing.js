// The best view of a dataset: distance of the camera and fineness of the mesh. Does not use CesiumJS, so that the first
// requests begin before it is loaded.
const kMetresPerDegree = 111320;
const kGlobalWidth = 1.1e7;  // metres: a dataset wider than this is shown as a whole globe
const kFullTurn = 350;  // degrees of width from which a region goes all around the Earth
export const kGlobalDistance = 1.75e7;  // metres from which the whole globe fits
const radians = (degrees) => (degrees * Math.PI) / 180;

// The slider of the mesh error has steps of half powers of two, finer to the right: 4, 2.83, ... 1/32.
export const kCoarsest = -4;
export const kFinest = 10;
export const fractionOfStep = (step) => 2 ** (-step / 2);
export const stepOfFraction = (fraction) =>
  Math.min(kFinest, Math.max(kCoarsest, Math.round(-2 * Math.log2(fraction))));

// Centre and size of [west, south, east, north] in degrees; east < west means across the antimeridian. The centre's
// longitude is within -180 to 180.
export function boxOf([west, south, east, north]) {
  const width = east >= west ? east - west : east - west + 360;
  const middle = west + width / 2;
  return { longitude: middle > 180 ? middle - 360 : middle, latitude: (south + north) / 2, width, height: north - south };
}

// Degrees between the equator and what of [west, south, east, north] is nearest to it.
function distanceFromEquator([, south, , north]) {
  return south <= 0 && north >= 0 ? 0 : Math.min(Math.abs(south), Math.abs(north));
}

export function isGlobal({ bounds }) {
  return boxOf(bounds).width * kMetresPerDegree * Math.cos(radians(distanceFromEquator(bounds))) > kGlobalWidth;
}

// The share of the Earth that [west, south, east, north] cover.
function shareOfEarth(bounds) {
  const sine = (degrees) => Math.sin(radians(degrees));
  return (boxOf(bounds).width / 360) * ((sine(bounds[3]) - sine(bounds[1])) / 2);
}

// The region of a first view of a dataset: all of it, or for one of the whole Earth the region with the finest data, if
// that is a small part of it. `isPart`: it is such a part.
export function firstRegion(dataset) {
  const finest = { ...dataset, bounds: dataset.finest_bounds ?? dataset.bounds };
  const isPart = isGlobal(dataset) && shareOfEarth(finest.bounds) < shareOfEarth(dataset.bounds) / 4;
  return { ...(isPart ? finest : dataset), isPart };
}

// What a dataset that is not global is within: centre in degrees, diameter in metres. The middle of what goes all around
// the Earth there is the pole.
export function discOf({ bounds }) {
  const { longitude, latitude, width, height } = boxOf(bounds);
  if (width > kFullTurn) {
    return { longitude, latitude: 90 * Math.sign(latitude), diameter: 2 * (90 - distanceFromEquator(bounds)) * kMetresPerDegree };
  }
  return { longitude, latitude, diameter: Math.hypot(width * Math.cos(radians(latitude)), height) * kMetresPerDegree };
}

// Metres between the camera and the centre of a dataset that is completely in view.
export function viewDistance(dataset) {
  if (isGlobal(dataset)) return kGlobalDistance;
  const { diameter } = discOf(dataset);
  return diameter * (0.62 + 0.2 * Math.min(1, diameter / 5e6));
}

// Pixels of error at which CesiumJS goes a level deeper, for a distance in metres. A whole planet gets more tiles,
// because colours need them.
export function pixelTolerance(distance) {
  return 1.5 - Math.min(1, Math.max(0, (Math.log10(distance) - 5.5) / 1.5));
}

// The fraction of the level error for a good first view of the dataset: one half, or less if the relief is so small for
// the extent that the level error (pixelTolerance pixels of 1.6 mm at one metre) exceeds 1/40 of it.
export function suggestedFraction(dataset) {
  const visible = (dataset.heights.max - dataset.heights.min) / 40;
  return Math.min(0.5, visible / (0.0016 * pixelTolerance(viewDistance(dataset)) * viewDistance(dataset)));
}

// The fraction that a dataset is first shown at: the slider's step next to the suggested one.
export function defaultFraction(dataset) {
  return fractionOfStep(stepOfFraction(suggestedFraction(firstRegion(dataset))));
}
