// Statistics of loaded tiles by format, from the browser's resource timing: bytes, cache hits, and the server's time by
// stage.
import { take } from "/viewer/begun.js";
import { Resource } from "/viewer/cesium/index.js";

export const kPhases = ["read", "refine", "encode", "compress"];

// What the server says is wrong, in the reply to a request of CesiumJS; undefined if it says nothing.
function detailOf({ status, response }) {
  if (status < 400) return undefined;
  try {
    return JSON.parse(typeof response === "string" ? response : new TextDecoder().decode(response)).detail;
  } catch {
    return undefined;
  }
}

export class Traffic {
  // `problem`: what the server said is wrong with the first terrain tile that failed since the last reset, if anything.
  constructor() {
    this.reset();
    const observer = new PerformanceObserver((list) => list.getEntries().forEach((entry) => this.#add(entry)));
    observer.observe({ type: "resource", buffered: true });
    this.since = 0;  // requests that began before this page's code count
    this.#watchRequests();
  }

  reset() {
    Object.assign(this, { problem: undefined, since: performance.now(), tiles: 0, bytes: 0, hits: 0, answers: 0, computed: 0 });
    this.tiles3d = { tiles: 0, bytes: 0 };  // the same for 3D Tiles, including the bytes of subtrees and tileset.json
    this.errors = new Map();  // metres, by "z/x/y", of 3D Tiles by "root/level/x/y"
    this.milliseconds = Object.fromEntries(kPhases.map((phase) => [phase, 0]));
  }

  #add(entry) {
    if (entry.startTime < this.since) return;
    const kind = /\.(terrain|glb|subtree)(\?|$)|\/(tileset)\.json/.exec(entry.name);
    if (!kind) return;
    if (kind[1] !== "terrain") {
      this.tiles3d.tiles += kind[1] === "glb" ? 1 : 0;
      this.tiles3d.bytes += entry.transferSize || 0;
      return;
    }
    this.tiles += 1;
    this.bytes += entry.transferSize || 0;  // 0 for entries from the browser's cache
    const timing = new Map((entry.serverTiming ?? []).map((metric) => [metric.name, metric]));
    const cache = timing.get("cache")?.description;
    if (!cache || entry.transferSize === 0) return;
    this.answers += 1;
    if (cache === "hit") this.hits += 1;
    if (!kPhases.some((phase) => timing.has(phase))) return;
    this.computed += 1;
    for (const phase of kPhases) this.milliseconds[phase] += timing.get(phase)?.duration ?? 0;
  }

  // The largest Terrain-Max-Error of these tiles in metres; undefined if none has one.
  worstError(keys) {
    const errors = keys.filter((key) => this.errors.has(key)).map((key) => this.errors.get(key));
    return errors.length > 0 ? Math.max(...errors) : undefined;
  }

  // Resource timing has no response headers, and errors of CesiumJS have no bodies, so this reads both from its requests.
  // Requests that have begun already are not sent again.
  #watchRequests() {
    const load = Resource._Implementations.loadWithXhr;
    const note = (url, header) => {
      const error = Number.parseFloat(header);
      const tile = /(\d+\/\d+\/\d+)\.terrain/.exec(url) ?? /3dtiles\/(\S+)\.glb/.exec(url);
      if (error >= 0 && tile) this.errors.set(tile[1], error);
    };
    const send = (url, ...rest) => {
      const request = load(url, ...rest);
      request?.addEventListener?.("load", () => {
        note(url, request.getResponseHeader("Terrain-Max-Error"));
        if (/\.terrain(\?|$)/.test(url)) this.problem ??= detailOf(request);
      });
      return request;
    };
    Resource._Implementations.loadWithXhr = (url, responseType, method, data, headers, deferred, mimeType) => {
      const again = () => send(url, responseType, method, data, headers, deferred, mimeType);
      const begun = method === "GET" ? take(url) : undefined;
      if (!begun) return again();
      const read = async (response) => {
        if (!response.ok) return again();  // CesiumJS handles failures of its own requests
        const body = await (responseType === "arraybuffer" ? response.arrayBuffer() : response.text());
        note(url, response.headers.get("Terrain-Max-Error"));
        deferred.resolve(body);
      };
      begun.then(read).catch(again);
      return undefined;
    };
  }
}
