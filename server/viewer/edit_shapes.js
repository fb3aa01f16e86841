// Polygons of edits as rings of {longitude, latitude}, without a repeated first corner. Uses neither CesiumJS nor the page.
const kMetresPerDegree = 111320;

// Corners in metres east and north of the first one; good for shapes much smaller than the Earth.
function inMetres(corners) {
  const [first] = corners;
  const east = kMetresPerDegree * Math.cos((first.latitude * Math.PI) / 180);
  const turned = (degrees) => degrees - 360 * Math.round(degrees / 360);
  return corners.map(({ longitude, latitude }) =>
    [turned(longitude - first.longitude) * east, (latitude - first.latitude) * kMetresPerDegree]);
}

const cross = ([ax, ay], [bx, by], [cx, cy]) => (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);

// Square metres; positive if the ring runs counterclockwise.
export function signedArea(corners) {
  const points = inMetres(corners);
  return points.reduce((sum, [x, y], i) => {
    const [nextX, nextY] = points[(i + 1) % points.length];
    return sum + (x * nextY - nextX * y) / 2;
  }, 0);
}

// Whether two edges of the ring that are not neighbours meet.
export function crossesItself(corners) {
  const points = inMetres(corners);
  const n = points.length;
  const edge = (i) => [points[i], points[(i + 1) % n]];
  for (let i = 0; i < n; ++i) {
    for (let k = i + 2; k < n; ++k) {
      if ((k + 1) % n === i) continue;
      const [[a, b], [c, d]] = [edge(i), edge(k)];
      if (cross(a, b, c) * cross(a, b, d) <= 0 && cross(c, d, a) * cross(c, d, b) <= 0) return true;
    }
  }
  return false;
}

// Places inside the ring on a grid of about `count` over its box, as {longitude, latitude}.
export function placesInside(corners, count) {
  const [longitudes, latitudes] = ["longitude", "latitude"].map((name) => corners.map((corner) => corner[name]));
  const [west, east] = [Math.min(...longitudes), Math.max(...longitudes)];
  const [south, north] = [Math.min(...latitudes), Math.max(...latitudes)];
  const side = Math.ceil(Math.sqrt(count));
  const places = [];
  for (let i = 0; i < side * side; ++i) {
    const longitude = west + ((east - west) * ((i % side) + 0.5)) / side;
    const latitude = south + ((north - south) * (Math.floor(i / side) + 0.5)) / side;
    let isInside = false;
    corners.forEach((a, k) => {
      const b = corners[(k + 1) % corners.length];
      if (a.latitude > latitude === b.latitude > latitude) return;
      const at = a.longitude + ((latitude - a.latitude) / (b.latitude - a.latitude)) * (b.longitude - a.longitude);
      if (longitude < at) isInside = !isInside;
    });
    if (isInside) places.push({ longitude, latitude });
  }
  if (places.length > 0) return places;
  // Thinner than the grid.
  const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  return [...corners, { longitude: mean(longitudes), latitude: mean(latitudes) }];
}

// What flattening to `height` would do to ground of these heights on `area` square metres. Volumes in cubic metres, of
// the polygon without its blend. Heights that are undefined do not count.
export function earthwork(heights, height, area) {
  const known = heights.filter((value) => value !== undefined);
  const differences = known.map((value) => height - value);
  const sum = (values) => values.reduce((total, value) => total + value, 0);
  const share = known.length > 0 ? area / known.length : 0;
  return {
    samples: known.length,
    raised: Math.max(0, ...differences), lowered: Math.max(0, ...differences.map((value) => -value)),
    fill: share * sum(differences.filter((value) => value > 0)), cut: -share * sum(differences.filter((value) => value < 0)),
  };
}

const rounded = (value, digits) => Number(value.toFixed(digits));

// The file that `terrace serve --edits` takes: one polygon that is flattened. Metres.
export function flattenGeoJson(corners, height, blend) {
  const ring = signedArea(corners) < 0 ? [...corners].reverse() : [...corners];
  const coordinates = [...ring, ring[0]].map(({ longitude, latitude }) => [rounded(longitude, 7), rounded(latitude, 7)]);
  const terrain = { op: "flatten", height: rounded(height, 3), ...(blend > 0 ? { blend_m: rounded(blend, 3) } : {}) };
  return {
    type: "FeatureCollection",
    features: [{ type: "Feature", properties: { terrain }, geometry: { type: "Polygon", coordinates: [coordinates] } }],
  };
}
