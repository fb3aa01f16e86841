// Lengths and visibility along a path of heights. Plain numbers: no page, no CesiumJS.
const kEarthRadius = 6371000;  // metres
export const kRefraction = 0.13;  // share of the Earth's curvature that the air's refraction undoes, for light by day

// Metres by which the Earth falls away below a level line of sight.
export function drop(distance) {
  return ((1 - kRefraction) * distance * distance) / (2 * kEarthRadius);
}

// `points`: [{distance, height}] with metres from the start; height is undefined where nothing was measured. Returns
// {length, along, up, down, min, max, gaps}: `length` over the ellipsoid, `along` over the ground; `gaps`: a height is undefined.
export function measurePath(points) {
  const gaps = points.some(({ height }) => height === undefined);
  const sum = { length: points.at(-1)?.distance ?? 0, along: 0, up: 0, down: 0, min: Infinity, max: -Infinity, gaps };
  points.forEach(({ distance, height }, i) => {
    if (height !== undefined) {
      sum.min = Math.min(sum.min, height);
      sum.max = Math.max(sum.max, height);
    }
    if (i === 0) return;
    const run = distance - points[i - 1].distance;
    const known = height !== undefined && points[i - 1].height !== undefined;
    const rise = known ? height - points[i - 1].height : 0;
    sum.along += Math.hypot(run, rise);
    if (rise > 0) sum.up += rise;
    else sum.down -= rise;
  });
  return sum;
}

// Whether each point of the ground is seen from `eye` metres above the first: [bool], undefined where the height is.
// Between two points nothing hides. The first point has a height.
export function seenGround(points, eye) {
  const origin = points[0].height + eye;
  let horizon = -Infinity;
  return points.map(({ distance, height }) => {
    if (height === undefined) return undefined;
    if (distance === 0) return true;
    const slope = (height - drop(distance) - origin) / distance;
    const isSeen = slope >= horizon;
    horizon = Math.max(horizon, slope);
    return isSeen;
  });
}
