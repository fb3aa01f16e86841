// A view as the page's URL fragment: #dataset=maui&fraction=0.25&camera=-156.2,20.6,9000,30,-25&contours&wireframe
// With another error to the right of the line it also has &right=2, with 3D Tiles &tiles3d, and &split=0.4 if the line was
// moved. &colours=slope, &sun=2026-06-21T18:30 in the dataset's local mean time.
import { fractionOfStep, kCoarsest, kFinest } from "/viewer/framing.js";

const kFractions = [fractionOfStep(kFinest), fractionOfStep(kCoarsest)];
const kSwitches = ["contours", "wireframe", "tiles3d", "edits", "imagery"];
const kColourings = ["height", "slope", "aspect"];

export function encodeView({ dataset, fraction, exaggeration, camera, split, right, colouring, sun, ...switches }) {
  const parts = [`dataset=${encodeURIComponent(dataset)}`, `fraction=${Number(fraction.toPrecision(6))}`];
  if (camera) parts.push(`camera=${camera.map((value, i) => Number(value.toFixed(i < 2 ? 6 : 1))).join(",")}`);
  if (exaggeration !== 1) parts.push(`exaggeration=${exaggeration}`);
  if (colouring && colouring !== "height") parts.push(`colours=${colouring}`);
  if (sun) parts.push(`sun=${sun}`);
  for (const name of kSwitches) if (switches[name]) parts.push(name);
  if (right) parts.push(`right=${Number(right.toPrecision(6))}`);
  if ((switches.tiles3d || right) && split !== 0.5) parts.push(`split=${Number(split.toFixed(3))}`);
  return `#${parts.join("&")}`;
}

const within = (value, [low, high]) => Math.min(high, Math.max(low, value));
// A camera below all ground or far beyond the Earth would show nothing.
const cameraRanges = (exaggeration) => [[-360, 360], [-90, 90], [-12000 * exaggeration, 1e8], [-360, 360], [-90, 90]];

// Leaves out values that are missing or invalid, and a camera that would see nothing. Takes errors and exaggeration to the
// nearest ends of their sliders.
export function decodeView(fragment) {
  const query = new URLSearchParams(fragment.replace(/^#/, ""));
  const view = {};
  const camera = query.get("camera")?.split(",").map((part) => (part.trim() ? Number(part) : NaN));
  const kRanges = { fraction: kFractions, right: kFractions, exaggeration: [1, 10] };
  if (query.get("dataset")) view.dataset = query.get("dataset");
  for (const [name, range] of Object.entries(kRanges)) {
    if (Number(query.get(name)) > 0) view[name] = within(Number(query.get(name)), range);
  }
  view.colouring = kColourings.includes(query.get("colours")) ? query.get("colours") : "height";
  const sun = query.get("sun") ?? "";
  const time = new Date(`${sun}:00Z`);
  if (/^\d{4}-\d\d-\d\dT\d\d:\d\d$/.test(sun) && !Number.isNaN(time.getTime()) && time.toISOString().startsWith(sun)) view.sun = sun;
  const split = Number(query.get("split") ?? 0.5);
  view.split = split >= 0 && split <= 1 ? split : 0.5;
  const ranges = cameraRanges(view.exaggeration ?? 1);
  if (camera?.length === 5 && camera.every((value, i) => value === within(value, ranges[i]))) view.camera = camera;
  for (const name of kSwitches) view[name] = query.has(name);
  return view;
}
