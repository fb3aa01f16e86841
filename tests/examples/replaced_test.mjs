// A source is replaced while clients show it. A page that is reloaded shows only the new terrain, although the browser's cache has
// the old tiles. A proxy records the requests that reach the server.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, describe, it } from 'node:test';
import { fileURLToPath } from 'node:url';
import { json, serve } from '../e2e/harness.mjs';
import { kSize, launchBrowser, pixels, servePages, settle } from './pages.mjs';
import { kFaults, startProxy } from './recording_proxy.mjs';

const kSrtm = path.join(path.dirname(fileURLToPath(import.meta.url)), '../e2e/srtm.py');
const kPlaces = [[7.5, 46.5], [7.3, 46.4], [7.62, 46.55]];  // longitude, latitude
const kLift = 1500;  // by which the new hills lie above the old ones
const kTile = /\.(terrain|glb|png|subtree)(\?|$)/;

// In a page: the edges of the drawn tiles in degrees, each a list of [place along it, height].
function cesiumEdges() {
  const degrees = Cesium.Math.toDegrees;
  return widget.scene.globe._surface._tilesToRender.map(({ level, rectangle, data: { renderedMesh: mesh, terrainData } }) => {
    const [west, south, east, north] = ['west', 'south', 'east', 'north'].map((side) => degrees(rectangle[side]));
    const at = (index, along) => {
      const uv = mesh.encoding.decodeTextureCoordinates(mesh.vertices, index, new Cesium.Cartesian2());
      return [along === 'x' ? west + uv.x * (east - west) : south + uv.y * (north - south), mesh.encoding.decodeHeight(mesh.vertices, index)];
    };
    const edge = (indices, along) => [...indices].map((index) => at(index, along));
    // Outside the data CesiumJS upsamples tiles from their parents; their edges match no tile of the level.
    return { level: terrainData?.wasCreatedByUpsampling() ? NaN : level, west, south, east, north, edges: {
      west: edge(mesh.westIndicesSouthToNorth, 'y'), east: edge(mesh.eastIndicesNorthToSouth, 'y'),
      south: edge(mesh.southIndicesEastToWest, 'x'), north: edge(mesh.northIndicesWestToEast, 'x'),
    } };
  });
}

async function threeEdges() {
  const { Vector3 } = await import('three');
  const degrees = 180 / Math.PI, point = new Vector3();
  return [...example.tiles.visibleTiles].map((tile) => {
    const [west, south, east, north] = tile.boundingVolume.region.slice(0, 4).map((radians) => radians * degrees);
    const [, root, level] = tile.content.uri.match(/3dtiles\/(\d+)-\d+-\d+\/(\d+)\//);
    const { geometry, matrixWorld } = tile.engineData.scene.getObjectByProperty('isMesh', true), { position } = geometry.attributes;
    const edges = { west: [], east: [], south: [], north: [] };
    const near = 1e-4 * (north - south);
    for (let i = 0; i < position.count; i++) {
      const { lon, lat, height } = example.tiles.ellipsoid.getPositionToCartographic(point.fromBufferAttribute(position, i).applyMatrix4(matrixWorld), {});
      const [x, y] = [lon * degrees, lat * degrees];
      if (Math.abs(x - west) < near) edges.west.push([y, height]);
      if (Math.abs(x - east) < near) edges.east.push([y, height]);
      if (Math.abs(y - south) < near) edges.south.push([x, height]);
      if (Math.abs(y - north) < near) edges.north.push([x, height]);
    }
    return { level: Number(root) + Number(level), west, south, east, north, edges };
  });
}

function mapEdges() {
  const manager = map.style.tileManagers.dem, unit = (z) => 360 / 2 ** z;
  return manager.getRenderableIds().map((id) => manager.getTileByID(id)).filter(({ dem }) => dem).map(({ tileID: { canonical: { z, x, y } }, dem }) => {
    // Rows and columns of Web Mercator as degrees of longitude; only agreement counts.
    const box = { west: x * unit(z), east: (x + 1) * unit(z), north: -y * unit(z), south: -(y + 1) * unit(z) }, last = dem.dim - 1;
    const along = (edge) => Array.from({ length: dem.dim }, (_, i) => edge((i + 0.5) / dem.dim, i));
    return { level: z, ...box, edges: {
      west: along((t, i) => [box.north - t * unit(z), dem.get(0, i)]), east: along((t, i) => [box.north - t * unit(z), dem.get(last, i)]),
      north: along((t, i) => [box.west + t * unit(z), dem.get(i, 0)]), south: along((t, i) => [box.west + t * unit(z), dem.get(i, last)]),
    } };
  });
}

// Each client: its page, when that is ready, a height it has, its edges, how it takes the document anew in a running page, and
// by how much edges of equal levels may differ: by rounding, but pixels of height tiles lie a pixel apart.
const kClients = {
  CesiumJS: {
    page: 'cesium-terrain', document: 'layer.json', edges: cesiumEdges, slack: 0.3,
    ready: 'window.widget?.scene.globe.tilesLoaded && widget.scene.globe._surface._tilesToRender.length > 3',
    height: async ([longitude, latitude]) =>
      (await Cesium.sampleTerrainMostDetailed(widget.scene.terrainProvider, [Cesium.Cartographic.fromDegrees(longitude, latitude)]))[0].height,
    renew: async (url) => { widget.scene.terrainProvider = await Cesium.CesiumTerrainProvider.fromUrl(url.replace('/layer.json', ''), { requestVertexNormals: true }); },
  },
  '3DTilesRendererJS': {
    page: 'three', document: 'tileset.json', edges: threeEdges, slack: 0.3,
    ready: 'window.example?.tiles.visibleTiles.size > 3 && !Object.entries(example.tiles.stats).some(([name, n]) => /queued|downloading|parsing/.test(name) && n > 0)',
    height: async ([longitude, latitude]) => {
      const { Raycaster } = await import('three'), { tiles } = example, ray = new Raycaster(), [y, x] = [latitude, longitude].map((angle) => angle * Math.PI / 180);
      tiles.ellipsoid.getCartographicToPosition(y, x, 20000, ray.ray.origin);
      tiles.ellipsoid.getCartographicToNormal(y, x, ray.ray.direction).negate();
      return tiles.ellipsoid.getPositionToCartographic(ray.intersectObject(tiles.group)[0].point, {}).height;
    },
  },
  MapLibre: {
    page: 'maplibre', document: 'tiles.json?encoding=terrarium', edges: mapEdges, slack: 150,
    ready: 'window.map?.loaded() && map.areTilesLoaded() && map.style.tileManagers.dem.getRenderableIds().length > 1',
    view: () => map.jumpTo({ center: [7.5, 46.5], zoom: 12, pitch: 60 }),
    height: ([longitude, latitude]) => map.queryTerrainElevation([longitude, latitude]),
    renew: async (url) => { for (const source of ['dem', 'shades']) map.getSource(source).setUrl(url); },
  },
};

// An edge in order, without the lower ends of skirts.
function ground(edge) {
  const line = [];
  for (const [place, height] of [...edge].sort(([s, low], [t, high]) => s - t || low - high)) {
    if (line.length && place - line.at(-1)[0] < 1e-7) line.at(-1)[1] = Math.max(height, line.at(-1)[1]);
    else line.push([place, height]);
  }
  return line;
}

// The largest difference between edges that drawn tiles have in common: of tiles of one level, and of different ones.
function cracks(tiles) {
  const found = { pairs: 0, vertices: 0, equal: 0, unequal: 0 };
  for (const [side, other, low, high] of [['east', 'west', 'south', 'north'], ['north', 'south', 'west', 'east']]) {
    for (const a of tiles) for (const b of tiles) {
      const from = Math.max(a[low], b[low]), to = Math.min(a[high], b[high]);
      if (Math.abs(a[side] - b[other]) > 1e-7 || to - from < 1e-7) continue;
      found.pairs++;
      const line = ground(a.edges[side]);
      for (const [place, height] of ground(b.edges[other])) {
        const i = line.findIndex(([t]) => t >= place - 1e-9);
        if (place < from || place > to || i < 0) continue;
        found.vertices++;
        const [t1, h1] = line[i], [t0, h0] = line[Math.max(0, i - 1)];
        const off = Math.abs(height - (t1 - t0 > 1e-9 ? h0 + (h1 - h0) * Math.min(1, (place - t0) / (t1 - t0)) : h1));
        const kind = a.level === b.level ? 'equal' : 'unequal';
        found[kind] = Math.max(found[kind], off);
      }
    }
  }
  return found;
}

const differing = (a, b) => a.filter((pixel, i) => pixel !== b[i]).length / a.length;

describe('a replaced source', () => {
  let pages, browser, folder;

  before(async () => {
    folder = fs.mkdtempSync(path.join(os.tmpdir(), 'terrace-replaced-'));
    for (const [name, phase, base] of [['old', 0, 1000], ['new', 1, 1000 + kLift]]) {
      execFileSync('python3', [kSrtm, path.join(folder, name), phase, base]);
    }
    pages = await servePages({ libraries: true });
    browser = await launchBrowser();
  });
  after(async () => {
    await browser?.close();
    await pages?.stop();
    fs.rmSync(folder, { recursive: true, force: true });
  });

  // A server of its own behind a proxy, and a source that can be replaced.
  async function start(fault) {
    const source = path.join(fs.mkdtempSync(path.join(folder, 'server-')), 'N46E007.hgt');
    const put = (name) => {
      fs.copyFileSync(path.join(folder, name), `${source}.beside`);
      fs.utimesSync(`${source}.beside`, 978307200, 978307200);
      fs.renameSync(`${source}.beside`, source);
    };
    put('old');
    const server = await serve(source);
    const proxy = await startProxy(server.url, fault);
    const version = async () => (await json(`${server.url}/datasets`)).datasets[0].version;
    const replace = async (name) => {
      const before = await version();
      put(name);
      for (const end = Date.now() + 20000; await version() === before;) {
        assert.ok(Date.now() < end, `the server has not taken the source: ${server.log()}`);
        await new Promise((resolve) => setTimeout(resolve, 50));
      }
      return version();
    };
    const truth = async ([longitude, latitude]) =>
      (await json(`${server.url}/N46E007/heights?locations=${latitude},${longitude}`)).results[0].elevation;
    return { proxy, version, replace, truth, stop: () => Promise.all([server.stop(), proxy.stop()]) };
  }

  // What a client did from `action` until it was calm: tiles that the page asked for, that reached the server, and what it shows.
  async function look(page, client, { proxy, truth }, action) {
    const before = proxy.asked.length, wanted = [];
    const note = (request) => wanted.push(request.url());
    page.on('request', note);
    await action();
    await settle(page, 'true', 0);
    await page.evaluate(() => { if (window.widget) widget.scene.requestRenderMode = true; });  // a software renderer
    await settle(page, client.ready);
    if (client.view) {
      await page.evaluate(client.view);
      await settle(page, client.ready);
    }
    const shown = await pixels(page);
    const off = [];
    for (const place of kPlaces) off.push(await page.evaluate(client.height, place) - await truth(place));
    page.off('request', note);
    const fetched = proxy.asked.slice(before).filter((asked) => kTile.test(asked.path));
    return {
      wanted: [...new Set(wanted.filter((url) => url.startsWith(proxy.url) && kTile.test(url)).map((url) => url.slice(proxy.url.length)))],
      fetched: fetched.map((asked) => asked.path), shown, off, crack: cracks(await page.evaluate(client.edges)),
    };
  }

  const open = async (client, { proxy }) => {
    const context = await browser.newContext({ viewport: kSize }), page = await context.newPage();
    page.wrongs = [];
    page.on('pageerror', (error) => page.wrongs.push(`exception: ${error}`));
    page.on('response', (response) => response.status() >= 400 && page.wrongs.push(`${response.status()} ${response.url()}`));
    return { page, close: () => context.close(), load: () => page.goto(`${pages.url}/${client.page}.html?server=${proxy.url}&dataset=N46E007`) };
  };

  // Throws if a client shows anything but what the server has now.
  function check(name, { wanted, fetched, off, crack }, version) {
    const client = kClients[name];
    console.log(`${name}: ${wanted.length} tiles, ${fetched.length} from the server, off by ${off.map((metres) => metres.toFixed(1))} m, ` +
                `${crack.pairs} common edges, apart by ${crack.equal.toFixed(2)} m, of other levels ${crack.unequal.toFixed(1)} m`);
    assert.ok(wanted.length > 3, `${wanted.length} tiles`);
    for (const url of [...wanted, ...fetched]) {
      assert.equal(new URL(url, 'http://host').searchParams.get('v'), version, `${url} is not of version ${version}`);
    }
    for (const metres of off) assert.ok(Math.abs(metres) < kLift / 5, `a height is off by ${metres} m`);
    assert.ok(crack.pairs >= 2, `${crack.pairs} common edges`);
    assert.ok(crack.vertices >= 2 * crack.pairs, `${crack.vertices} compared vertices on ${crack.pairs} edges`);
    assert.ok(crack.equal < client.slack && crack.unequal < kLift / 5, `a crack of ${crack.equal}, ${crack.unequal} m`);
  }

  async function run(name, fault) {
    const client = kClients[name], terrace = await start(fault), { page, close, load } = await open(client, terrace);
    try {
      const old = await terrace.version();
      const first = await look(page, client, terrace, load);
      check(name, first, old);
      const again = await look(page, client, terrace, () => page.reload());
      check(name, again, old);
      assert.deepEqual(again.fetched, [], 'the cache has every tile of the page');

      const version = await terrace.replace('new');
      const replaced = await look(page, client, terrace, () => page.reload());
      check(name, replaced, version);
      for (const url of replaced.wanted) assert.ok(replaced.fetched.includes(url), `${url} came from a cache`);
      assert.ok(differing(first.shown, replaced.shown) > 0.2, 'another picture');
      const fresh = await open(client, terrace);
      const other = await look(fresh.page, client, terrace, fresh.load);
      assert.ok(differing(replaced.shown, other.shown) < 0.01, 'as a browser sees it that never saw the old terrain');
      await fresh.close();

      if (client.renew) {
        // The old source again, its document taken by a page that stays: the version of before, and tiles of before out of the cache.
        assert.equal(await terrace.replace('old'), old);
        const renewed = await look(page, client, terrace, () => page.evaluate(client.renew, `${terrace.proxy.url}/N46E007/${client.document}`));
        check(name, renewed, old);
        assert.deepEqual(renewed.fetched.filter((url) => first.wanted.includes(url)), [], 'what is asked again');
      }
      assert.deepEqual(page.wrongs, []);
    } finally {
      await close();
      await terrace.stop();
    }
  }

  for (const name of Object.keys(kClients)) {
    it(`shows in ${name} from the next document on`, () => run(name));
    // Faults that must make the test fail. By default only the fastest client runs them.
    const faults = name === '3DTilesRendererJS' || process.env.TERRACE_LONG_TESTS ? Object.entries(kFaults) : [];
    for (const [fault, mutate] of faults) {
      it(`would not in ${name} with ${fault}`, () => assert.rejects(run(name, mutate), { name: 'AssertionError' }));
    }
  }
});
