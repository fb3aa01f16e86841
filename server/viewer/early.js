// What the page asks of the server before CesiumJS is loaded: the list of datasets, and of the dataset that will be shown
// first layer.json, the tiles of level 0, and the height in the middle of the view.
import { Access, kPatienceMs, UnknownToken } from "/viewer/access.js";
import { begin } from "/viewer/begun.js";
import { defaultFraction, discOf, firstRegion } from "/viewer/framing.js";
import { decodeView } from "/viewer/view_url.js";

const kRoots = ["0/0/0", "0/1/0"];
// CesiumJS sends the same: replies depend on it.
const kAccept = "application/vnd.quantized-mesh;extensions=octvertexnormals,application/octet-stream;q=0.9,*/*;q=0.01";

export const access = new Access();

// The dataset that `view` names, else the first one, and the fraction to show it at.
export function startOf(view, datasets) {
  const named = datasets.find((dataset) => dataset.name === view.dataset);
  const dataset = named ?? datasets[0];
  return { isNamed: named !== undefined, dataset, fraction: (named && view.fraction) ?? defaultFraction(dataset) };
}

// The query of layer.json and tileset.json for a fraction of the level error. An archive has one error.
export function errorQuery({ isArchive }, fraction) {
  return isArchive ? "" : `?fraction=${fraction}`;
}

export function layerUrl(dataset, fraction) {
  return `${dataset.urls.layer.replace(/layer\.json.*$/, "")}layer.json${errorQuery(dataset, fraction)}`;
}

async function beginTiles(layer, headers) {
  const response = await begin(layer, headers);
  if (!response.ok) return;
  const { tiles: [template], extensions } = await response.json();
  if (extensions?.join() !== "octvertexnormals") return;  // CesiumJS would ask for other ones
  for (const root of kRoots) {
    const [z, x, y] = root.split("/");
    const url = template.replace("{z}", z).replace("{x}", x).replace("{y}", y);
    begin(new URL(url, response.url).href, { ...headers, Accept: kAccept }).catch(() => {});
  }
}

async function beginView({ datasets }) {
  if (datasets.length === 0) return;
  const view = decodeView(location.hash);
  const { isNamed, dataset, fraction } = startOf(view, datasets);
  const region = firstRegion(dataset);
  if (region.isPart && !(isNamed && view.camera)) {
    const { longitude, latitude } = discOf(region);
    begin(access.heightUrl(dataset, longitude, latitude), access.headers, AbortSignal.timeout(kPatienceMs)).catch(() => {});
  }
  await beginTiles(layerUrl(dataset, fraction), access.headers);
}

// Uses the token of this tab, if it has a valid one.
async function list() {
  try {
    return await access.list();
  } catch (error) {
    if (!(error instanceof UnknownToken)) throw error;
    access.token = "";
    return access.list();
  }
}

// {datasets, moreWithToken}, as Access.list() returns them.
export const firstList = list();
// Resolves when all has been asked for.
export const allBegun = firstList.then(beginView).catch(() => {});
