// Runs each page of examples/ in a real browser, with libraries from node_modules instead of the CDN, and each script,
// against the real server with the sample data. Heights that a client shows are compared with /heights.
import assert from 'node:assert/strict';
import { execFile, spawn } from 'node:child_process';
import { once } from 'node:events';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, describe, it } from 'node:test';
import { promisify } from 'node:util';
import { binary, json, request, samples, serve } from '../e2e/harness.mjs';
import { VectorTile } from './node_modules/@mapbox/vector-tile/index.js';
import Pbf from './node_modules/pbf/index.js';
import { fileOf, kExamples, kSettleMs, kSize, launchBrowser, pixels, servePages, settle, typeOf } from './pages.mjs';

const run = promisify(execFile);

async function openPage(browser, url) {
  const page = await browser.newPage({ viewport: kSize });
  page.wrongs = [];
  page.on('console', (message) => message.type() === 'error' && page.wrongs.push(`console: ${message.text()}`));
  page.on('pageerror', (error) => page.wrongs.push(`exception: ${error}`));
  page.on('response', (response) => response.status() >= 400 && page.wrongs.push(`${response.status()} ${response.url()}`));
  await page.context().route(/^https:/, (route) => {
    const file = fileOf(route.request().url());
    if (!file) page.wrongs.push(`not in node_modules: ${route.request().url()}`);
    const headers = { 'Access-Control-Allow-Origin': '*' };
    return file ? route.fulfill({ body: fs.readFileSync(file), contentType: typeOf(file), headers }) : route.abort();
  });
  await page.goto(url);
  return page;
}

const line = (page) => page.locator('#line').innerText();

// Clicks at (x, y) and reads position and height from the page's line.
async function click(page, x, y) {
  const before = await line(page);
  await page.mouse.click(x * kSize.width, y * kSize.height);
  await page.waitForFunction((text) => document.getElementById('line').innerText !== text, before, { timeout: kSettleMs });
  const found = (await line(page)).match(/\n(-?[\d.]+), (-?[\d.]+): (-?[\d.]+) m/);
  assert.ok(found, await line(page));
  const [latitude, longitude, height] = found.slice(1).map(Number);
  return { latitude, longitude, height };
}

// Number of colours below the line, at 5 bits a channel.
const colours = async (page) => new Set((await pixels(page)).map((pixel) => pixel & 0xf8f8f8)).size;

// Size of a pixel of a Web Mercator tile in metres.
const pixelMetres = (latitude, zoom, size) => 40075016 * Math.cos(latitude * Math.PI / 180) / size / 2 ** zoom;

// Runs in the page of deck.gl: height and level of the deepest mesh at a position.
function meshHeight({ longitude, latitude }) {
  const x = 512 * (longitude + 180) / 360, y = 256 + 256 / Math.PI * Math.asinh(Math.tan(latitude * Math.PI / 180));
  const level = ({ id }) => Number(id.split('-').at(-1));
  const layers = example.layerManager.getLayers().filter(({ props }) => props.mesh?.attributes).sort((a, b) => level(b) - level(a));
  for (const layer of layers) {
    const { mesh } = layer.props;
    const at = mesh.attributes.POSITION.value;
    const { value: corners } = mesh.indices;
    for (let i = 0; i < corners.length; i += 3) {
      const [a, b, c] = [corners[i] * 3, corners[i + 1] * 3, corners[i + 2] * 3];
      const area = (at[b] - at[a]) * (at[c + 1] - at[a + 1]) - (at[c] - at[a]) * (at[b + 1] - at[a + 1]);
      const v = ((x - at[a]) * (at[c + 1] - at[a + 1]) - (at[c] - at[a]) * (y - at[a + 1])) / area;
      const w = ((at[b] - at[a]) * (y - at[a + 1]) - (x - at[a]) * (at[b + 1] - at[a + 1])) / area;
      if (v >= 0 && w >= 0 && v + w <= 1) {
        return { height: at[a + 2] + v * (at[b + 2] - at[a + 2]) + w * (at[c + 2] - at[a + 2]), zoom: level(layer) };
      }
    }
  }
  return undefined;
}

describe('the pages of examples/', () => {
  let server, files, browser;
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'terrace-pages-'));
  const inFolder = (name, text) => {
    fs.writeFileSync(path.join(folder, name), text);
    return path.join(folder, name);
  };

  before(async () => {
    server = await serve('--config', path.join(samples, 'samples.json'));
    files = await servePages();
    browser = await launchBrowser();
  });
  after(async () => {
    await browser?.close();
    await files?.stop();
    await server?.stop();
    fs.rmSync(folder, { recursive: true });
  });

  // The server's height there, the deepest tile, and its largest permitted distance from the height.
  async function truth(dataset, { latitude, longitude }) {
    const url = `${server.url}/${dataset}/heights?certify=deepest&locations=${latitude},${longitude}`;
    const { results: [{ elevation, certified_error: error, tile }] } = await json(url);
    return { height: elevation, error, tile };
  }
  const certified = async (url) => Number((await request(url, { method: 'HEAD' })).headers['terrain-certified-error']);

  // The lowest and the highest of the server's heights within `metres` of a position.
  async function range(dataset, { latitude, longitude }, metres) {
    const steps = [-1, -0.5, 0, 0.5, 1].map((share) => share * metres / 111320);
    const points = steps.flatMap((y) => steps.map((x) => `${latitude + y},${longitude + x / Math.cos(latitude * Math.PI / 180)}`));
    const { results } = await json(`${server.url}/${dataset}/heights?locations=${points.join('|')}`);
    const heights = results.map(({ elevation }) => elevation);
    return [Math.min(...heights), Math.max(...heights)];
  }

  function within(height, [low, high], what) {
    console.log(`${what}: ${height.toFixed(2)} m, ${low.toFixed(2)} to ${high.toFixed(2)} m allowed`);
    assert.ok(height >= low && height <= high, `${what}: ${height} m is not between ${low} and ${high} m`);
  }

  // Clicks, and compares each height with `allowed` for its position.
  async function clicks(page, client, dataset, allowed) {
    for (const [x, y] of dataset === 'earth' ? [[0.46, 0.6]] : [[0.5, 0.55], [0.42, 0.65]]) {
      const place = await click(page, x, y);
      within(place.height, await allowed(place), `${client}, ${dataset} at ${place.latitude}, ${place.longitude}`);
    }
  }

  const pages = {
    'cesium-terrain': {
      ready: 'window.widget?.scene.globe.tilesLoaded && widget.scene.globe.pick(widget.camera.getPickRay({x: 165, y: 135}), widget.scene)',
      check: (page, dataset) => clicks(page, 'cesium-terrain', dataset, async (place) => {
        const { height, error } = await truth(dataset, place);
        return [height - error, height + error];
      }),
    },
    'cesium-3dtiles': {
      ready: 'window.tileset?.tilesLoaded && widget.scene.pickPosition({x: 165, y: 135})',
      check: (page, dataset) => clicks(page, 'cesium-3dtiles', dataset, async (place) => {
        const { height, tile } = await truth(dataset, place);
        const error = await certified(`${server.url}/${dataset}/${tile}.glb${dataset === 'earth' ? '?fraction=0.05' : ''}`);
        return [height - error, height + error];
      }),
    },
    three: {
      ready: 'window.example?.tiles.visibleTiles.size > 0 && !Object.entries(example.tiles.stats).some(([name, n]) => /queued|downloading|parsing/.test(name) && n > 0)',
      check: (page, dataset) => clicks(page, 'three', dataset, async (place) => {
        // The smallest drawn tile that contains the position.
        const uri = await page.evaluate(({ latitude, longitude }) => {
          const [y, x] = [latitude, longitude].map((degrees) => degrees * Math.PI / 180);
          return [...example.tiles.visibleTiles].filter(({ boundingVolume: { region } }) =>
            region && x >= region[0] && x <= region[2] && y >= region[1] && y <= region[3])
            .sort((a, b) => a.geometricError - b.geometricError)[0].content.uri;
        }, place);
        const { height } = await truth(dataset, place);
        const error = await certified(`${server.url}/${dataset}/${uri}`);
        return [height - error, height + error];
      }),
    },
    itowns: {
      ready: 'window.view?.tileLayer && view.mainLoop.scheduler.commandsWaitingExecutionCount() + view.mainLoop.scheduler.commandsRunningCount() === 0' +
        ' && view.mainLoop.renderingState === 0 && view.pickTerrainCoordinates({ x: 165, y: 132 })',
      check: async (page, dataset) => {
        if (dataset === 'jacksboro') {  // from so near that the deepest tiles are drawn
          await page.evaluate(() => itowns.CameraUtils.transformCameraToLookAtTarget(view, view.camera.camera3D,
            { coord: new itowns.Coordinates('EPSG:4326', -84.25, 36.3, 600), range: 2000, tilt: 40 }));
          await settle(page, pages.itowns.ready);
        }
        const place = await click(page, 0.5, 0.6);
        // The drawn tile, and the height of its geometry there by the depth buffer.
        const { zoom, altitude } = await page.evaluate(({ latitude, longitude }) => ({
          zoom: itowns.DEMUtils.getTerrainObjectAt(view.tileLayer, new itowns.Coordinates('EPSG:4326', longitude, latitude)).texture.extent.zoom,
          altitude: view.pickTerrainCoordinates({ x: 165, y: 132 }).as('EPSG:4326').altitude,
        }), place);
        const span = 180 / 2 ** zoom, column = Math.floor((place.longitude + 180) / span), row = Math.floor((place.latitude + 90) / span);
        const error = await certified(`${server.url}/${dataset}/${zoom}/${column}/${row}.terrain`), texel = span / 256 * 111320;
        const where = `itowns, ${dataset}, level ${zoom} at ${place.latitude}, ${place.longitude}`, [low, high] = await range(dataset, place, texel);
        within(place.height, [low - error, high + error], where);
        if (dataset === 'earth') return;  // from space the depth buffer is too coarse
        // iTowns draws 17 x 17 vertices of a tile.
        const [lowest, highest] = await range(dataset, place, 16 * texel);
        within(altitude, [lowest - error, highest + error], `${where}, as drawn`);
      },
    },
    deck: {
      ready: "window.example?.layerManager?.getLayers({layerIds: ['terrain']})[0]?.isLoaded",
      check: async (page, dataset) => {
        const place = await click(page, 0.5, 0.55);
        const { height } = await truth(dataset, place);
        within(place.height, [height - 0.01, height + 0.01], `deck, ${dataset}, as asked from the server`);
        // The mesh that is drawn there from a short distance.
        const { maxzoom } = await json(`${server.url}/${dataset}/tiles.json?size=512`);
        await page.evaluate(({ longitude, latitude, zoom }) => example.setProps({ initialViewState: { longitude, latitude, zoom } }),
                            { ...place, zoom: maxzoom + 1 });
        await settle(page, `${pages.deck.ready} && (${meshHeight})(${JSON.stringify(place)})?.zoom === ${maxzoom}`);
        const drawn = await page.evaluate(meshHeight, place);
        const [times, base] = dataset === 'earth' ? [25, 0] : [1, 236];  // the page exaggerates heights like this
        // deck.gl draws pixels up to 1.5 pixels off their positions; the page permits meshes an error of a 400th of the
        // relief.
        const { datasets } = await json(`${server.url}/datasets`), { heights } = datasets.find(({ name }) => name === dataset);
        const error = (heights.max - heights.min) / 400 + 0.1;
        const [low, high] = await range(dataset, place, 1.5 * pixelMetres(place.latitude, maxzoom, 512));
        within(drawn.height / times + base, [low - error, high + error], `deck, ${dataset} at ${place.latitude}, ${place.longitude}`);
      },
    },
    maplibre: {
      ready: 'window.map?.loaded() && map.areTilesLoaded()',
      check: async (page, dataset) => {
        const { maxzoom } = await json(`${server.url}/${dataset}/tiles.json`);
        const place = await click(page, 0.5, 0.55);
        await page.evaluate(({ place, zoom }) => map.jumpTo({ center: [place.longitude, place.latitude], zoom, pitch: 0 }), { place, zoom: maxzoom + 2 });
        await settle(page, 'map.loaded() && map.areTilesLoaded()');
        for (const there of [place, await click(page, 0.4, 0.7)]) {
          // MapLibre uses the height of a pixel as that of its corner.
          const height = await page.evaluate(({ longitude, latitude }) => map.queryTerrainElevation([longitude, latitude]), there);
          const [low, high] = await range(dataset, there, 1.5 * pixelMetres(there.latitude, maxzoom, 256));
          within(height, [low - 0.1, high + 0.1], `maplibre, ${dataset} at ${there.latitude}, ${there.longitude}`);
        }
      },
    },
    contours: {
      ready: "window.map?.loaded() && map.areTilesLoaded() && map.queryRenderedFeatures({ layers: ['lines'] }).length > 0",
      check: async (page, dataset) => {
        const found = await page.evaluate(() => {
          for (const { properties, geometry: { type, coordinates } } of map.queryRenderedFeatures({ layers: ['lines'] })) {
            for (const [longitude, latitude] of type === 'LineString' ? coordinates : coordinates.flat()) {
              const { x, y } = map.project([longitude, latitude]);
              if (x > 60 && x < 270 && y > 110 && y < 180) return { x, y, longitude, latitude, properties };
            }
          }
        });
        assert.ok(found, 'a line in the middle of the picture');
        assert.deepEqual(Object.keys(found.properties).sort(), ['ele', 'index']);
        await page.mouse.click(found.x, found.y);
        await page.waitForFunction(() => /\n-?[\d.]+ m$/.test(document.getElementById('line').innerText), null, { timeout: kSettleMs });
        // The pixels of a coarse tile are averages.
        const level = Math.floor(await page.evaluate(() => map.getZoom()));
        const metres = pixelMetres(found.latitude, level, 256), [low, high] = await range(dataset, found, 2 * metres);
        const slack = dataset === 'earth' ? 300 : 15;
        within(found.properties.ele, [low - slack, high + slack], `contours, ${dataset} at ${found.latitude}, ${found.longitude}`);
      },
    },
  };

  // Mapbox's reader of vector tiles, which MapLibre uses.
  it('contours are read by the library of MapLibre, and meet at the edges of tiles', async () => {
    const read = async (x, y) => {
      const reply = await fetch(`${server.url}/jacksboro/contours/11/${x}/${y}.mvt?interval=20`);
      const { layers } = new VectorTile(new Pbf(new Uint8Array(await reply.arrayBuffer())));
      assert.deepEqual(Object.keys(layers), ['contour']);
      assert.equal(layers.contour.extent, 4096);
      return Array.from({ length: layers.contour.length }, (_, i) => layers.contour.feature(i));
    };
    // Heights and places of the crossings with a tile's western or eastern edge.
    const crossings = (features, edge) => new Set(features.flatMap((feature) => {
      const { ele, index } = feature.properties;
      assert.equal(ele % 20, 0);
      assert.equal(index, ele % 100 === 0);
      return feature.loadGeometry().flatMap((line) => line.slice(1).flatMap((b, i) => {
        const a = line[i];
        if (Math.min(a.x, b.x) >= edge || Math.max(a.x, b.x) <= edge) return [];
        const y = a.y + (edge - a.x) / (b.x - a.x) * (b.y - a.y);
        return y > 0 && y < 4096 ? [`${ele} m at ${y.toFixed(6)}`] : [];
      }));
    }));
    const west = crossings(await read(544, 802), 4096), east = crossings(await read(545, 802), 0);
    assert.ok(west.size > 5, `${west.size} crossings`);
    assert.deepEqual([...west].sort(), [...east].sort());
  });

  for (const dataset of ['jacksboro', 'earth']) {
    for (const [name, { ready, check }] of Object.entries(pages)) {
      const how = dataset === 'earth' ? 'by http' : 'as a file';
      it(`${name} draws ${dataset}, opened ${how}`, async () => {
        const folder = dataset === 'earth' ? files.url : `file://${kExamples}`;
        const page = await openPage(browser, `${folder}/${name}.html?server=${server.url}&dataset=${dataset}`);
        await settle(page, 'true', 0);
        await page.evaluate(() => { if (window.widget) Object.assign(widget.scene, { msaaSamples: 1, requestRenderMode: true }); });  // a software renderer
        await settle(page, ready);
        assert.match(await line(page), new RegExp(`^${dataset} of ${server.url} as `));
        const count = await colours(page);
        assert.ok(count > 100, `${count} colours`);
        await check(page, dataset);
        assert.deepEqual(page.wrongs, []);
        await page.close();
      });
    }
  }

  it('cesium-terrain draws a baked folder on a plain file server', async () => {
    const site = fs.mkdtempSync(path.join(os.tmpdir(), 'terrace-site-'));
    // As docs/baking.md says, on any free port.
    await run(binary, ['bake', path.join(samples, 'jacksboro.tif'), '--form', 'folder', '--no-gzip', '--levels', '0-10', '--out', path.join(site, 'hills')]);
    fs.copyFileSync(path.join(kExamples, 'cesium-terrain.html'), path.join(site, 'index.html'));
    const host = spawn('python3', ['-u', '-m', 'http.server', '--directory', site, '--bind', '127.0.0.1', '0'], { stdio: ['ignore', 'pipe', 'ignore'] });
    try {
      const [, port] = (await once(host.stdout, 'data')).toString().match(/port (\d+)/);
      const page = await openPage(browser, `http://127.0.0.1:${port}/index.html?terrain=hills`);
      await settle(page, pages['cesium-terrain'].ready);
      assert.match(await line(page), /^jacksboro of hills as quantized-mesh terrain, levels 0 to 10/);
      const place = await click(page, 0.5, 0.55);
      const [low, high] = await range('jacksboro', place, 200);
      within(place.height, [low - 60, high + 60], 'cesium-terrain, baked');
      assert.ok(await colours(page) > 100);
      assert.deepEqual(page.wrongs, []);
      await page.close();
    } finally {
      host.kill();
      fs.rmSync(site, { recursive: true });
    }
  });

  it('a page says what is wrong', async () => {
    for (const [query, said] of [[`server=${server.url}&dataset=mars`, /no dataset mars; it has earth, jacksboro/],
                                 ['server=http://127.0.0.1:9', /^http:\/\/127.0.0.1:9: Failed to fetch/]]) {
      const page = await openPage(browser, `file://${kExamples}/maplibre.html?${query}`);
      await settle(page, 'true', 0);
      assert.match(await line(page), said);
      await page.close();
    }
  });

  it('every page says that a server shows no dataset', async () => {
    const closed = await serve('--config', inFolder('closed.json', JSON.stringify({
      datasets: [{ name: 'hills', sources: [path.join(samples, 'jacksboro.tif')] }], tokens: [{ name: 'key', token: 'k'.repeat(16) }] })));
    try {
      for (const name of Object.keys(pages)) {
        const page = await openPage(browser, `file://${kExamples}/${name}.html?server=${closed.url}`);
        await settle(page, 'true', 0);
        assert.match(await line(page), new RegExp(`^${closed.url}: shows no dataset: `), name);
        await page.close();
      }
    } finally {
      await closed.stop();
    }
  });

  it('MapLibre and three.js draw flat ground, and ground below the sea', async () => {
    const grid = (name, height) => {
      const rows = Array.from({ length: 40 }, (_, row) => Array.from({ length: 40 }, (_, column) => height(row, column)).join(' '));
      inFolder(`${name}.prj`, 'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]]');
      return inFolder(`${name}.asc`, `ncols 40\nnrows 40\nxllcorner 7\nyllcorner 46\ncellsize 0.005\n${rows.join('\n')}\n`);
    };
    const grids = [grid('flat', () => 100), grid('sea', () => 0), grid('bay', (row, column) => -300 + 200 * Math.sin(row / 5) * Math.cos(column / 7))];
    const special = await serve(...grids);
    try {
      for (const dataset of ['flat', 'sea', 'bay']) {
        for (const name of ['maplibre', 'three']) {
          const page = await openPage(browser, `file://${kExamples}/${name}.html?server=${special.url}&dataset=${dataset}`);
          await settle(page, pages[name].ready);
          assert.match(await line(page), new RegExp(`^${dataset} of ${special.url} as `));
          assert.deepEqual(page.wrongs, []);
          if (name === 'three') {
            assert.ok(await page.evaluate(() => {
              const shades = [];
              example.tiles.group.traverse(({ geometry }) => geometry && shades.push(...geometry.attributes.color.array));
              return shades.length > 0 && shades.every((shade) => shade >= 0 && shade <= 1);
            }), dataset);
          }
          await page.close();
        }
      }
    } finally {
      await special.stop();
    }
  });

  it('heights.py reads off the tile what the server says, within the tile\'s error', async () => {
    const places = ['36.3,-84.2', '36.42,-84.11', '10,10'];
    const { stdout } = await run(path.join(kExamples, 'heights.py'), ['--server', server.url, '--dataset', 'jacksboro', ...places]);
    const said = stdout.trim().split('\n');
    assert.equal(said.length, 3);
    assert.equal(said[2], '10, 10: outside jacksboro');
    for (const line of said.slice(0, 2)) {
      const [, height, tile, drawn, error] = line.match(/: ([\d.]+) m in jacksboro; tile (\S+) with .* has ([\d.]+) m, and is at most ([\d.]+) m/);
      assert.equal(Number(error), await certified(`${server.url}/jacksboro/${tile}.terrain`));
      within(Number(drawn), [height - error, Number(height) + Number(error)], `heights.py, ${line.split(':')[0]}`);
    }
    await assert.rejects(run(path.join(kExamples, 'heights.py'), ['--server', server.url, '--dataset', 'mars']), /it has earth, jacksboro/);
  });

  it('curl.sh fetches one of each', async () => {
    const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'terrace-curl-'));
    try {
      const { stdout } = await run(path.join(kExamples, 'curl.sh'), [server.url, 'jacksboro'], { env: { ...process.env, TMPDIR: folder } });
      assert.match(stdout, /\$ curl \S+\/datasets\n\{"datasets":/);
      assert.match(stdout, /Content-Type: application\/vnd.quantized-mesh;extensions=octvertexnormals\r\n/);
      assert.match(stdout, /If-None-Match.*\n304\n/);
      assert.equal(stdout.match(/"distance":/g).length, 5);
      const [made] = fs.readdirSync(folder), read = (name) => fs.readFileSync(path.join(folder, made, name));
      assert.equal(read('tile.glb').subarray(0, 4).toString(), 'glTF');
      assert.match(read('area.obj').toString(), /^v -?\d/m);
      assert.ok(read('tile.terrain').length > read('plain.terrain').length);
    } finally {
      fs.rmSync(folder, { recursive: true });
    }
  });
});
