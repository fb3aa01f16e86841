// Polygons of edits as rings of {longitude, latitude}, without a repeated first corner. Uses neither CesiumJS nor the page.
const kDegree = Math.PI / 180;
// WGS 84: the equatorial radius in metres, and the eccentricity.
const kRadius = 6378137;
const kEccentricity = 0.0818191908426215;

const kMaxSide = 300;  // of a grid, for rings much longer than wide

const turned = (degrees) => degrees - 360 * Math.round(degrees / 360);

// Corners whose longitudes go on beyond 180 degrees, on the side of the first one.
function unwrapped(corners) {
  const { longitude: first } = corners[0];
  return corners.map((corner) => ({ ...corner, longitude: first + turned(corner.longitude - first) }));
}

// The area between the equator and a parallel on the ellipsoid, square metres for each radian of longitude.
function areaBelow(latitude) {
  const sine = Math.sin(latitude * kDegree);
  const square = kEccentricity * kEccentricity;
  return ((kRadius * kRadius * (1 - square)) / 2) * (sine / (1 - square * sine * sine) + Math.atanh(kEccentricity * sine) / kEccentricity);
}

const cross = ([ax, ay], [bx, by], [cx, cy]) => (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);

// Square metres on the ellipsoid; positive if the ring runs counterclockwise. Edges are straight in degrees, as those of
// GeoJSON; the area below one is integrated by Simpson's rule.
export function signedArea(corners) {
  const ring = unwrapped(corners);
  return ring.reduce((sum, from, i) => {
    const to = ring[(i + 1) % ring.length];
    const mean = (areaBelow(from.latitude) + 4 * areaBelow((from.latitude + to.latitude) / 2) + areaBelow(to.latitude)) / 6;
    return sum - (to.longitude - from.longitude) * kDegree * mean;
  }, 0);
}

// Whether the boxes around two edges meet; edges on one line may lie apart.
const areNear = ([a, b], [c, d]) => [0, 1].every((axis) =>
  Math.max(Math.min(a[axis], b[axis]), Math.min(c[axis], d[axis])) <= Math.min(Math.max(a[axis], b[axis]), Math.max(c[axis], d[axis])));

// Whether two edges of the ring that are not neighbours meet.
export function crossesItself(corners) {
  const points = unwrapped(corners).map(({ longitude, latitude }) => [longitude, latitude]);
  const n = points.length;
  const edge = (i) => [points[i], points[(i + 1) % n]];
  for (let i = 0; i < n; ++i) {
    for (let k = i + 2; k < n; ++k) {
      if ((k + 1) % n === i) continue;
      const [[a, b], [c, d]] = [edge(i), edge(k)];
      if (areNear([a, b], [c, d]) && cross(a, b, c) * cross(a, b, d) <= 0 && cross(c, d, a) * cross(c, d, b) <= 0) return true;
    }
  }
  return false;
}

// Whether the box around a ring lies beside a box [west, south, east, north] in degrees; west may be above east.
export function isBeside(corners, [west, south, east, north]) {
  const ring = unwrapped(corners);
  const [longitudes, latitudes] = ["longitude", "latitude"].map((name) => ring.map((corner) => corner[name]));
  const first = Math.min(...longitudes);
  const turn = (degrees) => degrees - 360 * Math.floor(degrees / 360);
  const start = turn(first - west);  // degrees east of the box's western side
  const isBesideInLongitude = start > (turn(east - west) || 360) && start + Math.max(...longitudes) - first < 360;
  return isBesideInLongitude || Math.max(...latitudes) < south || Math.min(...latitudes) > north;
}

// About `count` places inside the ring, on a grid over its box, as {longitude, latitude}.
export function placesInside(outline, count) {
  const corners = unwrapped(outline);
  const [longitudes, latitudes] = ["longitude", "latitude"].map((name) => corners.map((corner) => corner[name]));
  const [west, east] = [Math.min(...longitudes), Math.max(...longitudes)];
  const [south, north] = [Math.min(...latitudes), Math.max(...latitudes)];
  const doubled = corners.reduce((sum, a, k) => {
    const b = corners[(k + 1) % corners.length];
    return sum + (a.longitude - west) * (b.latitude - south) - (b.longitude - west) * (a.latitude - south);
  }, 0);
  const share = Math.abs(doubled) / 2 / ((east - west) * (north - south)) || 1;
  const side = Math.min(kMaxSide, Math.ceil(Math.sqrt(count / share)));
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
    if (isInside) places.push({ longitude: turned(longitude), latitude });
  }
  if (places.length > 0) return places;
  // Thinner than the grid.
  const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  return [...outline, { longitude: turned(mean(longitudes)), latitude: mean(latitudes) }];
}

// What flattening to `height` would do to ground of these heights, which are spread evenly over `area` square metres.
// Volumes in cubic metres, of the polygon without its blend and without the ground whose heights are undefined.
export function earthwork(heights, height, area) {
  const known = heights.filter((value) => value !== undefined);
  const differences = known.map((value) => height - value);
  const sum = (values) => values.reduce((total, value) => total + value, 0);
  const share = heights.length > 0 ? area / heights.length : 0;
  return {
    known: heights.length > 0 ? known.length / heights.length : 0,
    raised: Math.max(0, ...differences), lowered: Math.max(0, ...differences.map((value) => -value)),
    fill: share * sum(differences.filter((value) => value > 0)), cut: -share * sum(differences.filter((value) => value < 0)),
  };
}

const rounded = (value, digits) => Number(value.toFixed(digits));

// The parts of a ring on one side of a meridian, as rings: east with `side` 1, west with -1. A corner on it counts as east.
function partsBeside(ring, meridian, side) {
  const beyond = ({ longitude }) => side * (longitude - meridian || 1e-12);
  const crossing = (a, b) => {
    const share = beyond(a) / (beyond(a) - beyond(b));
    return { longitude: meridian, latitude: a.latitude + share * (b.latitude - a.latitude) };
  };
  // Pieces of the outline on this side, from crossing to crossing.
  const first = ring.findIndex((b, i) => beyond(ring.at(i - 1)) < 0 && beyond(b) > 0);
  if (first < 0) return ring.every((corner) => beyond(corner) > 0) ? [ring] : [];
  const chains = [];
  for (let i = first; i < first + ring.length; ++i) {
    const [a, b] = [ring.at((i - 1) % ring.length), ring[i % ring.length]];
    if (beyond(a) < 0 && beyond(b) > 0) chains.push([crossing(a, b)]);
    if (beyond(b) > 0) chains.at(-1).push(b);
    else if (beyond(a) > 0) chains.at(-1).push(crossing(a, b));
  }
  // Along the meridian the polygon is between the first and the second crossing, the third and the fourth, and so on.
  const crossings = chains.flatMap((chain) => [chain[0], chain.at(-1)]).sort((a, b) => a.latitude - b.latitude);
  const next = (chain) => chains.find(([start]) => start === crossings[crossings.indexOf(chain.at(-1)) ^ 1]);
  const left = new Set(chains);
  return chains.flatMap((start) => {
    const part = [];
    for (let chain = start; left.delete(chain); chain = next(chain)) part.push(...chain);
    return part.length > 0 ? [part] : [];
  });
}

// A ring as rings within -180 to 180 degrees.
function dividedAt180(corners) {
  const ring = unwrapped(corners);
  const meridian = ring[0].longitude < 0 ? -180 : 180;
  if (!ring.some(({ longitude }) => Math.abs(longitude) > 180)) return [ring];
  return [1, -1].flatMap((side) => partsBeside(ring, meridian, side).map((part) => part.map(({ longitude, latitude }) =>
    ({ longitude: longitude + (side === Math.sign(meridian) ? -2 * meridian : 0), latitude }))));
}

// A closed ring of GeoJSON; undefined if nothing is left of it.
function closed(ring) {
  const positions = ring.map(({ longitude, latitude }) => [rounded(longitude, 7), rounded(latitude, 7)]);
  const distinct = positions.filter((at, i) => String(at) !== String(positions.at(i - 1)));
  return distinct.length > 2 ? [...distinct, distinct[0]] : undefined;
}

// The file that `terrace serve --edits` takes: one polygon that is flattened. Metres.
export function flattenGeoJson(corners, height, blend) {
  const ring = signedArea(corners) < 0 ? [...corners].reverse() : corners;
  const polygons = dividedAt180(ring).map(closed).filter(Boolean).map((outline) => [outline]);
  const terrain = { op: "flatten", height: rounded(height, 3), ...(blend > 0 ? { blend_m: rounded(blend, 3) } : {}) };
  return {
    type: "FeatureCollection",
    features: [{ type: "Feature", properties: { terrain }, geometry: polygons.length > 1 ?
      { type: "MultiPolygon", coordinates: polygons } : { type: "Polygon", coordinates: polygons[0] } }],
  };
}
