// Sends requests of real clients to the real binary on port 0.
import assert from 'node:assert/strict';
import { createHash } from 'node:crypto';
import fs from 'node:fs';
import net from 'node:net';
import os from 'node:os';
import path from 'node:path';
import { after, before, describe, it } from 'node:test';
import { extensionIds, json, metric, plain, request, run, samples, serve } from './harness.mjs';

const config = path.join(samples, 'samples.json');
const tileOf = (layer, base, z, x, y) =>
  new URL(layer.tiles[0].replace('{z}', z).replace('{x}', x).replace('{y}', y).replace('{version}', layer.version), base);

describe('a served dataset', () => {
  let server, base, layer;
  before(async () => {
    server = await serve('--config', config);
    base = `${server.url}/jacksboro/`;
    layer = await json(`${base}layer.json`);
  });
  after(async () => assert.deepEqual(await server.stop(), { code: 0, signal: null }));

  it('lists its datasets', async () => {
    const { datasets } = await json(`${server.url}/datasets`);
    assert.deepEqual(datasets.map((d) => d.name).sort(), ['earth', 'jacksboro']);
  });

  it('describes its levels', () => {
    assert.equal(layer.maxzoom, 13);
    assert.equal(layer.scheme, 'tms');
    assert.equal(layer.projection, 'EPSG:4326');
    assert.deepEqual(layer.available[0], [{ startX: 0, startY: 0, endX: 1, endY: 0 }]);
    assert.equal(layer.available.length, 14);
  });

  // cesium-native sends no Accept, appends its extensions to the query of the template, uses only tiles[0], and creates
  // all four children as soon as one is available.
  it('answers the requests of cesium-native', async () => {
    let [x, y] = [layer.available[13][0].startX, layer.available[13][0].startY];
    for (let z = 13; z >= 0; z--, x >>= 1, y >>= 1) {
      const url = tileOf(layer, base, z, x, y);
      url.search += `${url.search ? '&' : '?'}extensions=octvertexnormals-metadata`;
      const tile = await request(url, { headers: { 'Accept-Encoding': 'gzip, deflate' } });
      assert.equal(tile.status, 200, String(url));
      assert.deepEqual(extensionIds(plain(tile)), [1], String(url));
    }
    const deep = layer.available[13][0];
    for (const [dx, dy] of [[0, 0], [1, 0], [0, 1], [1, 1]]) {
      const url = tileOf(layer, base, 13, (deep.startX & ~1) + 2 + dx, (deep.startY & ~1) + 2 + dy);
      assert.equal((await request(url)).status, 200, String(url));
    }
  });

  it('answers the requests of CesiumJS and 3DTilesRendererJS', async () => {
    const url = tileOf(layer, base, 0, 0, 0);
    const asked = { Accept: 'application/vnd.quantized-mesh;extensions=octvertexnormals-watermask-metadata,application/octet-stream;q=0.9,*/*;q=0.01' };
    assert.deepEqual(extensionIds(plain(await request(url, { headers: asked }))), [1]);
    const odd = { Accept: 'application/vnd.quantized-mesh,application/octet-stream;q=0.9;extensions=octvertexnormals-metadata' };
    assert.deepEqual(extensionIds(plain(await request(url, { headers: odd }))), [1]);
    assert.deepEqual(extensionIds(plain(await request(url))), []);
    assert.deepEqual(extensionIds(plain(await request(`${base}0/0/0.terrain?v=1`))), []);
  });

  it('serves both roots of a regional dataset', async () => {
    for (const x of [0, 1]) assert.equal((await request(tileOf(layer, base, 0, x, 0))).status, 200);
  });

  it('refuses what has no meaning', async () => {
    for (const query of ['error=abc', 'error=nan', 'error=0', 'error=-1', 'error=inf', 'error=', 'fraction=0', 'colour=red', 'error=5&error=5', 'atleast=1', 'error=5&fraction=1']) {
      const answer = await request(`${base}9/270/360.terrain?${query}`);
      assert.equal(answer.status, 400, query);
      assert.match(answer.headers['content-type'], /^application\/problem\+json/, query);
      assert.equal(answer.headers['access-control-allow-origin'], '*', query);
    }
    for (const tile of ['9/0/0', '99/0/0', '9/99999999999999999999/0', '9/-1/0', '14/0/0', 'a/b/c', '0/2/0']) {
      const answer = await request(`${base}${tile}.terrain`);
      assert.ok([400, 404].includes(answer.status), `${tile} ${answer.status}`);
      assert.equal(answer.headers['content-encoding'], undefined, tile);
    }
    assert.equal((await request(`${server.url}/nowhere/layer.json`)).status, 404);
    assert.equal((await request(`${base}layer.json`, { method: 'DELETE' })).status, 405);
  });

  it('makes finer tiles for a smaller error and says what it reached', async () => {
    const deep = layer.available[11][0];
    const size = async (query) => {
      const answer = await request(`${base}11/${deep.startX}/${deep.startY}.terrain${query}`);
      assert.equal(answer.status, 200);
      return [plain(answer).readUInt32LE(88), Number(answer.headers['terrain-max-error'])];
    };
    const [coarse, coarseError] = await size('?error=50'), [fine, fineError] = await size('?error=3');
    assert.ok(fine > coarse, `${fine} > ${coarse}`);
    assert.ok(coarseError <= 50 && fineError <= 3, `${coarseError} ${fineError}`);
    const [atLeast] = await size('?error=3&atleast=1'), [plainly] = await size('');
    assert.equal(atLeast, plainly);
  });

  it('carries the error into the template', async () => {
    const fine = await json(`${base}layer.json?error=3`);
    assert.match(fine.tiles[0], /error=3&atleast=1/);
    const quality = await json(`${base}layer.json?fraction=0.25`);
    assert.match(quality.tiles[0], /fraction=0.25/);
  });

  it('gives 304, HEAD, identity and gzip of one and the same tile', async () => {
    const url = tileOf(layer, base, 5, 16, 22);
    const zipped = await request(url, { headers: { 'Accept-Encoding': 'gzip' } });
    const bare = await request(url, { headers: { 'Accept-Encoding': 'identity' } });
    assert.equal(zipped.headers['content-encoding'], 'gzip');
    assert.equal(bare.headers['content-encoding'], undefined);
    assert.ok(plain(zipped).equals(bare.body));
    assert.notEqual(zipped.headers.etag, bare.headers.etag);
    const again = await request(url, { headers: { 'Accept-Encoding': 'gzip', 'If-None-Match': zipped.headers.etag } });
    assert.equal(again.status, 304);
    assert.equal(again.body.length, 0);
    const head = await request(url, { method: 'HEAD', headers: { 'Accept-Encoding': 'gzip' } });
    assert.equal(head.status, 200);
    assert.equal(Number(head.headers['content-length']), zipped.body.length);
    assert.match(zipped.headers.vary, /Accept, Accept-Encoding/);
  });

  it('builds a tile once for 200 clients that ask at the same time', async () => {
    const [west, south, east, north] = layer.bounds;
    const url = tileOf(layer, base, 12, Math.floor(((west + east) / 2 + 180) / 180 * 4096), Math.floor(((south + north) / 2 + 90) / 180 * 4096)) + '&error=1';
    const builds = await metric(server.url, 'terrace_tile_builds_total');
    const answers = await Promise.all(Array.from({ length: 200 }, () => request(url)));
    assert.ok(answers.every((answer) => answer.status === 200 && answer.body.equals(answers[0].body)));
    await new Promise((resolve) => setTimeout(resolve, 1100)); // the page of metrics is cached for a second
    assert.equal((await metric(server.url, 'terrace_tile_builds_total')) - builds, 1);
  });

  it('is alive, ready and measured', async () => {
    for (const probe of ['/livez', '/readyz', '/metrics']) assert.equal((await request(server.url + probe)).status, 200, probe);
  });

  it('logs a line per request and no error', async () => {
    await request(`${base}layer.json`);
    assert.match(server.log(), /layer\.json/);
    assert.doesNotMatch(server.log(), /\[error\]|\[critical\]/i);
  });
});

describe('the same bytes', () => {
  it('after a restart, with one worker and with eight', async () => {
    const fetchAll = async (workers) => {
      const server = await serve('--config', config, '--worker-threads', String(workers));
      const base = `${server.url}/jacksboro/`, layer = await json(`${base}layer.json`);
      const urls = layer.available.flatMap((ranges, z) => ranges.map((r) => tileOf(layer, base, z, r.endX, r.startY)));
      const tiles = await Promise.all(urls.map((url) => request(`${url}&extensions=octvertexnormals`)));
      await server.stop();
      return tiles.map((tile) => [tile.status, tile.headers.etag, createHash('sha256').update(tile.body).digest('hex')]);
    };
    const one = await fetchAll(1);
    assert.ok(one.length > 10 && one.every(([status]) => status === 200));
    assert.deepEqual(one, await fetchAll(8));
  });
});

describe('a source that goes away', () => {
  it('fails its own tiles with 503 and harms no other dataset', async () => {
    const dir = fs.mkdtempSync(path.join(os.tmpdir(), 'terrace-'));
    const copy = path.join(dir, 'gone.tif');
    fs.copyFileSync(path.join(samples, 'jacksboro.tif'), copy);
    const server = await serve(copy, path.join(samples, 'etopo5.tif'));
    try {
      assert.equal((await request(`${server.url}/gone/0/0/0.terrain`)).status, 200);
      fs.rmSync(copy);
      const answer = await request(`${server.url}/gone/1/1/1.terrain`);
      assert.equal(answer.status, 503);
      assert.ok(answer.headers['retry-after']);
      assert.match(answer.headers['content-type'], /problem\+json/);
      assert.match(server.log(), /gone/);
      assert.equal((await request(`${server.url}/etopo5/1/1/1.terrain`)).status, 200);
      fs.copyFileSync(path.join(samples, 'jacksboro.tif'), copy);
    } finally {
      await server.stop();
      fs.rmSync(dir, { recursive: true });
    }
  });
});

describe('bad input at the start', () => {
  const dir = fs.mkdtempSync(path.join(os.tmpdir(), 'terrace-'));
  after(() => fs.rmSync(dir, { recursive: true }));
  const file = (name, text) => (fs.writeFileSync(path.join(dir, name), text), path.join(dir, name));
  const refuses = (what, args, code, message) =>
    it(what, () => {
      const { code: got, out, err } = run('serve', '--listen', '127.0.0.1:0', ...args());
      assert.equal(got, code, err);
      assert.match(err, message);
      assert.equal(out, '');
    });
  refuses('a missing file', () => [path.join(dir, 'nothing.tif')], 1, /nothing\.tif/);
  refuses('an empty file', () => [file('empty.tif', '')], 1, /empty\.tif/);
  refuses('a file that is no raster', () => [file('text.tif', 'not a raster')], 1, /text\.tif/);
  refuses('a raster without georeference', () => [file('flat.asc.pgm', 'P5\n4 4\n255\n' + 'abcdefghijklmnop')], 1, /gdal_translate .*-a_srs .*-a_ullr/s);
  refuses('two datasets of one name', () => [path.join(samples, 'jacksboro.tif'), path.join(samples, 'jacksboro.tif')], 2, /jacksboro/);
  refuses('a config typo', () => ['--config', file('typo.json', '{"lisen": "127.0.0.1:0", "datasets": [{"name": "a b", "sources": []}]}')], 2, /\/lisen.*listen[\s\S]*\/datasets\/0\/name[\s\S]*\/datasets\/0\/sources/);
  refuses('an unknown flag', () => ['--colour', 'red'], 2, /colour/);
  it('a port in use', async () => {
    const blocker = net.createServer().listen(0, '127.0.0.1');
    await new Promise((resolve) => blocker.on('listening', resolve));
    const { code, err } = run('serve', '--listen', `127.0.0.1:${blocker.address().port}`, path.join(samples, 'jacksboro.tif'));
    blocker.close();
    assert.equal(code, 1);
    assert.match(err, new RegExp(`${blocker.address()?.port ?? ''}.*in use|in use`));
  });
});

describe('terrace mesh and terrace info', () => {
  it('mesh keeps its bound and says so', () => {
    const out = path.join(fs.mkdtempSync(path.join(os.tmpdir(), 'terrace-')), 'out.obj');
    const { code, out: stdout, err } = run('mesh', path.join(samples, 'jacksboro.tif'), '--out', out, '--max-error', '10', '--json');
    assert.equal(code, 0, err);
    const stats = JSON.parse(stdout);
    assert.equal(stats.input.width, 403);
    assert.ok(stats.max_error <= 10, stats.max_error);
    const lines = fs.readFileSync(out, 'utf8').split('\n');
    assert.equal(lines.filter((line) => line.startsWith('v ')).length, stats.points);
    assert.equal(lines.filter((line) => line.startsWith('f ')).length, stats.triangles);
  });
  it('mesh refuses a run without a goal', () => assert.equal(run('mesh', path.join(samples, 'jacksboro.tif'), '--out', '/tmp/x.obj').code, 2));
  it('info names the levels', () => {
    const { code, out } = run('info', path.join(samples, 'jacksboro.tif'));
    assert.equal(code, 0);
    assert.match(out, /403 x 344[\s\S]*13/);
  });
});
