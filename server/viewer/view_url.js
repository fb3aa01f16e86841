// A view as the page's URL fragment: #dataset=maui&fraction=0.25&camera=-156.2,20.6,9000,30,-25&contours&wireframe
const kSwitches = ["contours", "wireframe"];

export function encodeView({ dataset, fraction, exaggeration, camera, ...switches }) {
  const parts = [`dataset=${encodeURIComponent(dataset)}`, `fraction=${Number(fraction.toPrecision(6))}`];
  if (camera) parts.push(`camera=${camera.map((value, i) => Number(value.toFixed(i < 2 ? 6 : 1))).join(",")}`);
  if (exaggeration !== 1) parts.push(`exaggeration=${exaggeration}`);
  for (const name of kSwitches) if (switches[name]) parts.push(name);
  return `#${parts.join("&")}`;
}

// Leaves out whatever is missing or does not parse.
export function decodeView(fragment) {
  const query = new URLSearchParams(fragment.replace(/^#/, ""));
  const view = {};
  const camera = query.get("camera")?.split(",").map(Number);
  if (query.get("dataset")) view.dataset = query.get("dataset");
  if (Number(query.get("fraction")) > 0) view.fraction = Number(query.get("fraction"));
  if (Number(query.get("exaggeration")) > 0) view.exaggeration = Number(query.get("exaggeration"));
  if (camera?.length === 5 && camera.every(Number.isFinite)) view.camera = camera;
  for (const name of kSwitches) view[name] = query.has(name);
  return view;
}
