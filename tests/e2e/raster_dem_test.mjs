// Height tiles and heights of the real binary, read by MapLibre in a real browser and compared with GDAL's command line
// tools.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import fs from 'node:fs';
import http from 'node:http';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { after, before, describe, it } from 'node:test';
import os from 'node:os';
import { json, request, run, samples, serve } from './harness.mjs';

const kModules = path.join(path.dirname(fileURLToPath(import.meta.url)), 'node_modules');
const kChromium = process.env.TERRACE_CHROMIUM;
const kHaveBrowser = kChromium && fs.existsSync(path.join(kModules, 'maplibre-gl')) && fs.existsSync(path.join(kModules, 'pmtiles')) &&
    fs.existsSync(path.join(kModules, 'playwright-core'));
const kFlags = ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist',
                '--disable-background-networking', '--no-first-run'];
const kDem = path.join(samples, 'jacksboro.tif');

// Raw samples of a raster at pixel coordinates, read by an independent program.
function samplesAt(dem, pixels) {
  const done = spawnSync('gdallocationinfo', ['-valonly', dem],
                         { input: pixels.map(([x, y]) => `${x} ${y}`).join('\n') + '\n', encoding: 'utf8' });
  assert.equal(done.status, 0, done.stderr);
  return done.stdout.trim().split('\n').map(Number);
}

// Pixel coordinates of longitudes and latitudes on WGS 84.
function pixelsOf(dem, points) {
  const done = spawnSync('gdaltransform', ['-i', '-t_srs', 'EPSG:4326', dem],
                         { input: points.map(([lon, lat]) => `${lon} ${lat}`).join('\n') + '\n', encoding: 'utf8' });
  assert.equal(done.status, 0, done.stderr);
  return done.stdout.trim().split('\n').map((line) => line.split(' ').slice(0, 2).map(Number));
}

// Bilinear heights of points well inside a raster without voids there.
function bilinear(dem, points) {
  const cells = pixelsOf(dem, points).map(([x, y]) => {
    const column = Math.floor(x - 0.5), row = Math.floor(y - 0.5);
    return { column, row, dx: x - 0.5 - column, dy: y - 0.5 - row };
  });
  const corners = cells.flatMap(({ column, row }) => [[column, row], [column + 1, row], [column, row + 1], [column + 1, row + 1]]);
  const heights = samplesAt(dem, corners);
  return cells.map(({ dx, dy }, i) => {
    const [a, b, c, d] = heights.slice(4 * i, 4 * i + 4);
    return (a * (1 - dx) + b * dx) * (1 - dy) + (c * (1 - dx) + d * dx) * dy;
  });
}

// What a map shows from Web Mercator pixels of this depth: bilinear between pixels with the DEM's heights at their
// centres. MapLibre uses the height of a pixel as that of its north-western corner.
function asMapLibreReads(points, depth) {
  const size = 256 * 2 ** depth;
  const cells = points.map(([lon, lat]) => {
    const x = size * (lon + 180) / 360, y = size * (1 - Math.asinh(Math.tan(lat * Math.PI / 180)) / Math.PI) / 2;
    return { x: Math.floor(x), y: Math.floor(y), dx: x % 1, dy: y % 1 };
  });
  const centreOf = (x, y) =>
    [(x + 0.5) / size * 360 - 180, Math.atan(Math.sinh(Math.PI * (1 - 2 * (y + 0.5) / size))) * 180 / Math.PI];
  const heights = bilinear(kDem, cells.flatMap(({ x, y }) => [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]].map((c) => centreOf(...c))));
  return cells.map(({ dx, dy }, i) => {
    const [a, b, c, d] = heights.slice(4 * i, 4 * i + 4);
    return (a * (1 - dx) + b * dx) * (1 - dy) + (c * (1 - dx) + d * dx) * dy;
  });
}

function grid([west, south, east, north], count) {
  const points = [];
  for (let j = 1; j <= count; j++) {
    for (let i = 1; i <= count; i++) {
      points.push([west + (east - west) * (i / (count + 1)), south + (north - south) * (j / (count + 1))]);
    }
  }
  return points.map(([lon, lat]) => [Number(lon.toFixed(7)), Number(lat.toFixed(7))]);
}

describe('heights', () => {
  let server;
  const rasters = [kDem, ...['bigtujunga_30m_utm11.tif', 'webmercator_sf_float32.tif', 'greenland_80N_100m_custom_tm.tif']
      .map((name) => path.join(process.env.TERRACE_TEST_DATA ?? '/nonexistent', name)).filter((file) => fs.existsSync(file))];
  before(async () => (server = await serve(...rasters)));
  after(async () => assert.deepEqual(await server.stop(), { code: 0, signal: null }));

  for (const dem of rasters) {
    const name = path.basename(dem, '.tif');
    it(`are those of GDAL: ${name}`, async () => {
      const { datasets } = await json(`${server.url}/datasets`);
      const { bounds } = datasets.find((dataset) => dataset.name === name);
      const [w, s, e, n] = bounds, inner = [w + (e - w) * 0.3, s + (n - s) * 0.3, e - (e - w) * 0.3, n - (n - s) * 0.3];
      const points = grid(inner, 6);
      const expected = bilinear(dem, points);
      const { results, status } = await json(
          `${server.url}/${name}/heights?locations=${points.map(([lon, lat]) => `${lat},${lon}`).join('|')}`);
      assert.equal(status, 'OK');
      assert.equal(results.length, points.length);
      for (const [i, { elevation, location, dataset }] of results.entries()) {
        assert.deepEqual(location, { lat: points[i][1], lng: points[i][0] });
        assert.equal(dataset, name);
        // Allows 2^-10 m of rounding, and the rounded coordinates of gdaltransform on a slope.
        assert.ok(Math.abs(elevation - expected[i]) < 0.01, `${points[i]}: ${elevation}, GDAL ${expected[i]}`);
      }
    });
  }

  it('follow a profile of a path', async () => {
    const { results } = await json(`${server.url}/jacksboro/heights?path=36.2,-84.3|36.4,-84.2&step=1000`);
    const expected = bilinear(kDem, results.map(({ location }) => [location.lng, location.lat]));
    assert.equal(results.length, Math.ceil(results.at(-1).distance / 1000) + 1);
    assert.ok(Math.abs(results.at(-1).distance - 23929) < 200, results.at(-1).distance);
    results.forEach(({ elevation, distance }, i) => {
      assert.ok(Math.abs(elevation - expected[i]) < 0.01);
      if (i < results.length - 1) assert.equal(distance, 1000 * i);
    });
  });

  it('are null outside', async () => {
    const { results } = await json(`${server.url}/jacksboro/heights?locations=0,0|36.3,-84.2`);
    assert.equal(results[0].elevation, null);
    assert.equal(typeof results[1].elevation, 'number');
  });

  it('come by POST as well', async () => {
    const post = (type, body) => fetch(`${server.url}/jacksboro/heights`,
                                       { method: 'POST', headers: { 'Content-Type': type }, body });
    const asked = await json(`${server.url}/jacksboro/heights?locations=36.3,-84.2|36.31,-84.21`);
    const locations = '36.3,-84.2|36.31,-84.21';
    assert.deepEqual(await (await post('application/json', JSON.stringify({ locations }))).json(), asked);
    assert.deepEqual(await (await post('application/x-www-form-urlencoded', new URLSearchParams({ locations }).toString())).json(), asked);
    const many = Array(10001).fill('36.3,-84.2').join('|');
    const refused = await post('application/json', JSON.stringify({ locations: many }));
    assert.equal(refused.status, 400);
    assert.match((await refused.json()).detail, /more than 10000 points/);
  });

  it('have tiles wherever tiles.json says so', async () => {
    const { tilejson, tiles, minzoom, maxzoom, bounds } = await json(`${server.url}/jacksboro/tiles.json`);
    assert.equal(tilejson, '3.0.0');
    assert.equal(minzoom, 0);
    const row = (lat, z) => Math.floor(2 ** z * (1 - Math.asinh(Math.tan(lat * Math.PI / 180)) / Math.PI) / 2);
    const column = (lon, z) => Math.floor(2 ** z * (lon + 180) / 360);
    const tile = (z, x, y) => request(tiles[0].replace('{z}', z).replace('{x}', x).replace('{y}', y));
    for (let z = minzoom; z <= maxzoom; z++) {
      const [west, south, east, north] = bounds;
      for (const [lon, lat] of [[west, south], [west, north], [east, south], [east, north]]) {
        const reply = await tile(z, column(lon, z), row(lat, z));
        assert.equal(reply.status, 200);
        assert.equal(reply.headers['content-type'], 'image/png');
        assert.deepEqual((await tile(z, column(lon, z), row(lat, z))).body, reply.body);
      }
    }
    assert.equal((await tile(maxzoom + 1, column(bounds[0], maxzoom + 1), row(bounds[3], maxzoom + 1))).status, 404);
    assert.equal((await tile(maxzoom, 0, 0)).status, 404);
  });
});

describe('a map with terrain', { skip: kHaveBrowser ? false : 'needs TERRACE_CHROMIUM and npm ci in tests/e2e' }, () => {
  let server, pages, browser, page;
  const centre = [-84.24, 36.3];
  const wrongs = [];
  const scratch = fs.mkdtempSync(path.join(os.tmpdir(), 'terrace-map-'));
  const archive = path.join(scratch, 'dem.pmtiles');

  before(async () => {
    const done = run('bake', kDem, '--form', 'single', '--format', 'png', '--out', archive);
    assert.equal(done.code, 0, done.err);
    const { chromium } = await import('playwright-core');
    server = await serve(kDem, '--attribution', 'USGS');
    const html = '<!doctype html><meta charset="utf-8"><link rel="stylesheet" href="/maplibre-gl.css">' +
        '<style>html,body,#map{margin:0;height:100%}</style><div id="map"></div><script src="/maplibre-gl.js"></script><script src="/pmtiles.js"></script>';
    pages = http.createServer((asked, reply) => {
      if (asked.url === '/dem.pmtiles') {  // as a static host serves a file
        const [, first, last] = asked.headers.range.match(/bytes=(\d+)-(\d+)/).map(Number), data = fs.readFileSync(archive);
        const part = data.subarray(first, last + 1);
        reply.writeHead(206, { 'Content-Range': `bytes ${first}-${first + part.length - 1}/${data.length}`, 'Content-Length': part.length });
        return reply.end(part);
      }
      if (asked.url === '/pmtiles.js') return reply.end(fs.readFileSync(path.join(kModules, 'pmtiles/dist/pmtiles.js')));
      const file = asked.url.match(/^\/(maplibre-gl\.(js|css))$/);
      reply.setHeader('Content-Type', !file ? 'text/html' : file[2] === 'js' ? 'text/javascript' : 'text/css');
      reply.end(file ? fs.readFileSync(path.join(kModules, 'maplibre-gl/dist', file[1])) : html);
    });
    await new Promise((resolve) => pages.listen(0, '127.0.0.1', resolve));
    browser = await chromium.launch({ executablePath: kChromium, args: kFlags });
    page = await browser.newPage({ viewport: { width: 500, height: 400 } });
    page.on('pageerror', (error) => wrongs.push(`exception: ${error}`));
    page.on('response', (response) => {
      if (response.status() >= 400 && !response.url().endsWith('favicon.ico')) wrongs.push(`${response.status()} ${response.url()}`);
    });
    await page.goto(`http://127.0.0.1:${pages.address().port}/`);
  });
  after(async () => {
    await browser?.close();
    pages?.close();
    await server?.stop();
    fs.rmSync(scratch, { recursive: true });
  });

  for (const query of ['', '?encoding=terrarium&size=512', 'pmtiles']) {
    it(`tells the heights of the DEM${query && ` with ${query}`}`, { timeout: 120000 }, async () => {
      const isArchive = query === 'pmtiles';
      if (isArchive) await server.stop();  // the file alone
      const seen = await page.evaluate(async ({ url, centre, isArchive }) => {
        if (isArchive) maplibregl.addProtocol('pmtiles', new pmtiles.Protocol().tile);
        const of = isArchive ? { url: `pmtiles://${location.origin}/dem.pmtiles`, encoding: 'mapbox', tileSize: 256 } : { url };
        window.shown?.remove();
        window.shown = new maplibregl.Map({
          container: 'map', center: centre, zoom: 14, pitch: 60, maxPitch: 80, fadeDuration: 0,
          style: {
            version: 8,
            sources: { dem: { type: 'raster-dem', ...of }, shade: { type: 'raster-dem', ...of } },
            layers: [{ id: 'ground', type: 'background', paint: { 'background-color': '#808080' } },
                     { id: 'shade', type: 'hillshade', source: 'shade' }],
            terrain: { source: 'dem', exaggeration: 1 },
          },
        });
        const errors = [];
        shown.on('error', ({ error }) => errors.push(String(error)));
        await new Promise((resolve) => shown.once('idle', resolve));
        const points = [];
        for (let i = -3; i <= 3; i++) for (let j = -3; j <= 3; j++) points.push([centre[0] + i * 0.002, centre[1] + j * 0.0015]);
        // Heights relative to the centre of the map, which is on the terrain.
        const heights = points.map((point) => shown.queryTerrainElevation(point) + shown.transform.elevation);
        const source = shown.getSource('dem');
        return { points, heights, errors, maxzoom: source.maxzoom, tileSize: source.tileSize, encoding: source.encoding };
      }, { url: `${server.url}/jacksboro/tiles.json${query}`, centre, isArchive });
      assert.deepEqual(seen.errors, []);
      assert.deepEqual([seen.tileSize, seen.encoding], query && !isArchive ? [512, 'terrarium'] : [256, 'mapbox']);
      const expected = asMapLibreReads(seen.points, 11);
      const off = seen.heights.map((height, i) => Math.abs(height - expected[i]));
      const relief = Math.max(...expected) - Math.min(...expected);
      console.log(`relief ${relief.toFixed(0)} m, largest difference ${Math.max(...off).toFixed(2)} m`);
      assert.ok(relief > 100, `relief ${relief}`);
      assert.ok(Math.max(...off) < 0.2, JSON.stringify(off));
    });
  }

  it('draws relief', async () => {
    const shot = (await page.screenshot()).toString('base64');
    const shades = await page.evaluate(async (base64) => {
      const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${base64}`)).blob());
      const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
      context.drawImage(image, 0, 0);
      return new Set(context.getImageData(0, 0, image.width, image.height).data.filter((_, i) => i % 4 === 0)).size;
    }, shot);
    assert.ok(shades > 40, `${shades} shades of grey`);
  });

  it('has raised no error', () => assert.deepEqual(wrongs, []));
});
