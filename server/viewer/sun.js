// Where the sun stands: a low-precision solar position (Astronomical Almanac; good to 0.01 degrees until 2050).
const kDegree = Math.PI / 180;

// Direction towards the sun, Earth-centred and Earth-fixed, length 1. `milliseconds`: since 1970, UTC.
export function sunDirection(milliseconds) {
  const days = milliseconds / 86400000 - 10957.5;  // since noon of 1 January 2000
  const mean = (280.46 + 0.9856474 * days) * kDegree;
  const anomaly = (357.528 + 0.9856003 * days) * kDegree;
  const ecliptic = mean + (1.915 * Math.sin(anomaly) + 0.02 * Math.sin(2 * anomaly)) * kDegree;
  const tilt = (23.439 - 0.0000004 * days) * kDegree;
  const declination = Math.asin(Math.sin(tilt) * Math.sin(ecliptic));
  const ascension = Math.atan2(Math.cos(tilt) * Math.sin(ecliptic), Math.cos(ecliptic));
  const sidereal = (280.46061837 + 360.98564736629 * days) * kDegree;
  const longitude = ascension - sidereal;
  const ring = Math.cos(declination);
  return { x: ring * Math.cos(longitude), y: ring * Math.sin(longitude), z: Math.sin(declination) };
}

// "2026-06-21T18:30" in local mean time at a longitude (degrees), as milliseconds since 1970, UTC.
export function fromLocalMeanTime(text, longitude) {
  return Date.parse(`${text}:00Z`) - longitude * 240000;
}

// Degrees above the horizon.
export function sunAltitude(direction, longitude, latitude) {
  const [l, b] = [longitude * kDegree, latitude * kDegree];
  const up = [Math.cos(b) * Math.cos(l), Math.cos(b) * Math.sin(l), Math.sin(b)];
  return Math.asin(direction.x * up[0] + direction.y * up[1] + direction.z * up[2]) / kDegree;
}
