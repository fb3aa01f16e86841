// Numbers as the page writes them.
const number = new Intl.NumberFormat("en");
const short = new Intl.NumberFormat("en", { notation: "compact", maximumSignificantDigits: 3 });

export const formatNumber = (value) => number.format(value + 0).replace("-", "−");  // −0 + 0 is 0
export const formatCompact = (value) => short.format(value);

export function formatMetres(metres) {
  const size = Math.abs(metres);
  const digits = size >= 100 ? 0 : size >= 10 ? 1 : 2;
  if (size >= 10000) return `${formatNumber(Math.round(metres / 100) / 10)} km`;
  return `${formatNumber(Number(metres.toFixed(digits)))} m`;
}

// Estimates, with four digits.
const fourDigits = (value) => formatNumber(Number(value.toPrecision(4)));
export const formatArea = (squareMetres) =>
  (squareMetres < 1e6 ? `${fourDigits(squareMetres)} m²` : `${fourDigits(squareMetres / 1e6)} km²`);
// One unit for all large volumes: cut and fill stand side by side.
export const formatVolume = (cubicMetres) =>
  (cubicMetres < 1e6 ? `${fourDigits(cubicMetres)} m³` : `${fourDigits(cubicMetres / 1e6)} million m³`);

// Heights are in metres however large they are.
export const formatHeight = (metres, digits = Math.abs(metres) < 10 ? 1 : 0) => `${formatNumber(Number(metres.toFixed(digits)))} m`;

export function formatBytes(bytes) {
  return bytes < 999500 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}

export function formatFraction(fraction) {
  return fraction >= 1 ? `${Number(fraction.toFixed(2))} ×` : `1/${Number((1 / fraction).toFixed(1))}`;
}

export function formatPosition({ longitude, latitude, height }) {
  const angle = (value, positive, negative) => `${Math.abs(value).toFixed(5)}° ${value < -5e-6 ? negative : positive}`;
  return `${angle(latitude, "N", "S")}  ${angle(longitude, "E", "W")}  ${formatNumber(Number(height.toFixed(1)))} m`;
}
