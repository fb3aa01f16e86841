// The page begins here: the globe if the browser can draw it, else a flat map. Only the one that is needed is loaded.
import { allBegun } from "/viewer/early.js";
import { startTheme } from "/viewer/theme.js";

function hasWebGl2() {
  try {
    return Boolean(document.createElement("canvas").getContext("webgl2"));
  } catch {
    return false;
  }
}

startTheme();
if (matchMedia("(max-width: 560px)").matches) document.getElementById("panel").open = false;
if (innerHeight < 760) document.getElementById("costs").open = false;
// The globe keeps this thread busy: before, the panel is painted and the first tiles are asked for. A page in the background
// has no frames, and a server may be slow.
const isReady = Promise.all([allBegun, new Promise(requestAnimationFrame)]);
await Promise.race([isReady, new Promise((resolve) => setTimeout(resolve, 150))]);

// Returns whether the browser can draw the globe.
async function startGlobe() {
  try {
    await import("/viewer/app.js");
    return true;
  } catch (error) {
    if (error.name === "NoGlobe") return false;
    throw error;
  }
}

async function reasonOf(error) {
  const cesium = await fetch("/viewer/cesium/index.js", { method: "HEAD" }).catch(() => undefined);
  if (cesium?.status === 404) return "The viewer is incomplete on this server: it was built without CesiumJS, because npm was missing or could not fetch it.";
  return `The page could not be loaded completely; reload it. (${error.message})`;
}

try {
  if (!hasWebGl2() || !await startGlobe()) {
    const { startFlatMap } = await import("/viewer/flat_map.js");
    await startFlatMap();
  }
} catch (error) {
  const message = document.getElementById("message");
  if (message.hidden) Object.assign(message, { textContent: await reasonOf(error), hidden: false });
  throw error;
}
