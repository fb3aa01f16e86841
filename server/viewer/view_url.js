// A view as the page's URL fragment: #dataset=maui&fraction=0.25&camera=-156.2,20.6,9000,30,-25&contours&wireframe
// With another error to the right of the line it also has &right=2, with 3D Tiles &tiles3d, and &split=0.4 if the line was
// moved. &colours=slope, &sun=2026-06-21T18:30 in the dataset's local mean time.
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

// Leaves out values that are missing or invalid.
export function decodeView(fragment) {
  const query = new URLSearchParams(fragment.replace(/^#/, ""));
  const view = {};
  const camera = query.get("camera")?.split(",").map(Number);
  if (query.get("dataset")) view.dataset = query.get("dataset");
  if (Number(query.get("fraction")) > 0) view.fraction = Number(query.get("fraction"));
  if (Number(query.get("exaggeration")) > 0) view.exaggeration = Number(query.get("exaggeration"));
  if (Number(query.get("right")) > 0) view.right = Number(query.get("right"));
  view.colouring = kColourings.includes(query.get("colours")) ? query.get("colours") : "height";
  const sun = query.get("sun") ?? "";
  if (/^\d{4}-\d\d-\d\dT\d\d:\d\d$/.test(sun) && Date.parse(`${sun}:00Z`)) view.sun = sun;
  const split = Number(query.get("split") ?? 0.5);
  view.split = split >= 0 && split <= 1 ? split : 0.5;
  if (camera?.length === 5 && camera.every(Number.isFinite)) view.camera = camera;
  for (const name of kSwitches) view[name] = query.has(name);
  return view;
}
