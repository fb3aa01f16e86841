// The datasets that the server shows to this page, and the token of its requests. The token is stored until the tab is
// closed. It is sent only in headers, so that no copied address contains it.
import { take } from "/viewer/begun.js";

const kKey = "terrace.token";
export const kPatienceMs = 20000;  // for replies that the page waits for before it goes on
const kMaxUrl = 4000;  // bytes; the server reads heads of 8 KiB
const kMaxTiles = 50;  // for the heights of one request; the server reads at most 64

// The server does not know the token.
export class UnknownToken extends Error {}

// A browser may forbid pages to store data.
function stored(act) {
  try {
    return act(sessionStorage);
  } catch {
    return undefined;
  }
}

export class Access {
  #token = stored((storage) => storage.getItem(kKey)) ?? "";

  // Headers of every request.
  get headers() {
    return headersOf(this.#token);
  }

  get token() {
    return this.#token;
  }

  // The token of later requests; empty: none.
  set token(token) {
    this.#token = token;
    stored((storage) => (token ? storage.setItem(kKey, token) : storage.removeItem(kKey)));
  }

  // {datasets, preparing, moreWithToken}: the datasets that are visible with this token, and {name, percent, failed} of
  // those that are not there yet.
  async list(token = this.#token) {
    if (!/^[\w.~+/=-]*$/.test(token)) throw new UnknownToken();
    const response = await fetch("/datasets", { headers: headersOf(token), signal: AbortSignal.timeout(kPatienceMs) });
    if (response.status === 401) throw new UnknownToken();
    if (!response.ok) throw Object.assign(new Error(`the server answered ${response.status} to /datasets`), { status: response.status });
    const { datasets, preparing = [], more_with_token: moreWithToken = false } = await response.json();
    return { datasets: datasets.map(withDefaults), preparing, moreWithToken };
  }

  // Whether the server refuses this URL with the current token.
  async isRefused(url) {
    return [401, 403].includes((await fetch(url, { headers: this.headers })).status);
  }

  #post(url, query) {
    const headers = { ...this.headers, "Content-Type": "application/json" };
    return readJson(url, { method: "POST", headers, body: JSON.stringify(query) });
  }

  heightUrl(dataset, longitude, latitude) {
    return heightsUrl(dataset, [{ longitude, latitude }], { locations: `${latitude},${longitude}` });
  }

  // Metres above the ellipsoid; undefined if the dataset has no height there. Throws if the server does not say.
  async heightAt(dataset, longitude, latitude) {
    const url = this.heightUrl(dataset, longitude, latitude);
    const reply = await (take(url) ?? fetch(url, { headers: this.headers, signal: AbortSignal.timeout(kPatienceMs) }));
    if (!reply.ok) throw new Error(`the server answered ${reply.status} to ${url}`);
    return (await reply.json()).results[0].elevation ?? undefined;
  }

  // Heights at {longitude, latitude}: metres, undefined where the dataset has none.
  async heights(dataset, places) {
    const { results } = await this.#post(heightsUrl(dataset, places, {}), { locations: places.map(locationOf).join("|") });
    return results.map(({ elevation }) => elevation ?? undefined);
  }

  // Heights at `samples` points along the corners, as [{longitude, latitude, distance, height}]; height is undefined where
  // the dataset has none.
  async profile(dataset, corners, samples) {
    const query = { path: corners.map(locationOf).join("|"), samples };
    const url = heightsUrl(dataset, between(corners), query);
    const { results } = await (url.length < kMaxUrl ? readJson(url, { headers: this.headers }) :
      this.#post(heightsUrl(dataset, between(corners), {}), query));
    return results.map(({ elevation, distance, location }) =>
      ({ longitude: location.lng, latitude: location.lat, distance, height: elevation ?? undefined }));
  }

  // The line from `eye` metres above the ground at the first corner to `target` metres above it at the last, as /sight
  // describes it: {visible, clearance, lowest}. Throws if the ground has no height at an end.
  async sight(dataset, corners, { eye, target, refraction }) {
    const end = (corner, above) => `${locationOf(corner)},${above}`;
    const ask = (surface) => {
      const query = new URLSearchParams({ from: end(corners[0], eye), to: end(corners.at(-1), target), heights: "ground", refraction, surface });
      return readJson(`${dataset.urls.sight}?${query}`, { headers: this.headers });
    };
    if (dataset.isArchive) return (await ask("served")).results[0];
    const reply = ask("source");
    // The sources do not contain edits: above these the server answers over tiles alone, and over few of them.
    const { results } = await (dataset.urls.edits ? reply.catch(() => ask("served")) : reply);
    return results[0];
  }
}

// About a dataset of `preparing`. `promise`: what happens when it is there.
export function pendingText({ name, percent, failed }, promise = "It is shown as soon as it is there.") {
  return failed ? `${name} cannot be opened as it is now; the server's log says why.`
    : `${name} is being prepared: ${percent} %. ${promise}`;
}

// Throws what the server says is wrong.
async function readJson(url, options) {
  const reply = await fetch(url, options);
  if (!reply.ok) throw new Error((await reply.json().catch(() => ({}))).detail ?? `the server answered ${reply.status}`);
  return reply.json();
}

function locationOf({ longitude, latitude }) {
  return `${latitude.toFixed(7)},${longitude.toFixed(7)}`;
}

// The URL of heights at or along `places`. An archive has only those of its tiles.
function heightsUrl({ urls, isArchive, max_level: deepest }, places, query) {
  const served = isArchive ? { surface: "served", level: levelOf(deepest, places) } : {};
  return `${urls.heights}?${new URLSearchParams({ ...query, ...served })}`;
}

// The deepest level on which the places lie in few tiles.
function levelOf(deepest, places) {
  const tiles = (level) => {
    const index = (degrees) => Math.floor((degrees * 2 ** level) / 180);
    return new Set(places.map(({ longitude, latitude }) => `${index(longitude)} ${index(latitude)}`)).size;
  };
  let level = deepest;
  while (level > 0 && tiles(level) > kMaxTiles) --level;
  return level;
}

// Places along the corners in steps of 1/100, as straight lines on the map.
function between(corners) {
  return corners.slice(1).flatMap((to, i) => {
    const from = corners[i];
    const turn = to.longitude - from.longitude;
    const east = turn - 360 * Math.round(turn / 360);
    return Array.from({ length: 101 }, (_, k) => ({
      longitude: from.longitude + (east * k) / 100, latitude: from.latitude + ((to.latitude - from.latitude) * k) / 100,
    }));
  });
}

function headersOf(token) {
  return token ? { Authorization: `Bearer ${token}` } : {};
}

// `isArchive`: without its sources, which /mesh needs.
function withDefaults(dataset) {
  const base = `/${encodeURIComponent(dataset.name)}`;
  return {
    ...dataset,
    isArchive: !dataset.urls?.mesh,
    bounds: dataset.bounds ?? [-180, -90, 180, 90],
    heights: { min: dataset.heights?.min ?? 0, max: dataset.heights?.max ?? 4000 },
    urls: { layer: `${base}/layer.json`, heights: `${base}/heights`, ...dataset.urls },
  };
}
