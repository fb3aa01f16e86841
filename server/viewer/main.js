// The page begins here: the globe if the browser can draw it, else a flat map. Only the one that is needed is loaded.
import { startTheme } from "/viewer/theme.js";

function hasWebGl2() {
  try {
    return Boolean(document.createElement("canvas").getContext("webgl2"));
  } catch {
    return false;
  }
}

startTheme();
if (hasWebGl2()) {
  await import("/viewer/app.js");
} else {
  const { startFlatMap } = await import("/viewer/flat_map.js");
  await startFlatMap();
}
