// Vertical datums and the rules for opening files, with the real binary. Served heights must be those of the source
// plus the undulation of PROJ's cs2cs.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, describe, it } from 'node:test';
import { binary, json, metric, request, run, samples, serve } from './harness.mjs';

const places = {
  Aconcagua: [-32.6532, -70.0112],
  Gotthard: [46.5592, 8.5667],
  Haleakala: [20.7097, -156.2533],
  'Mount Everest': [27.9881, 86.925],
  Male: [4.1755, 73.5093],
  Reykjavik: [64.1265, -21.8174],
  Suva: [-18.1416, 178.4419],
  Amchitka: [51.5, 179],
  'South Pole': [-90, 0],
  'Port Moresby': [-9.4438, 147.1803],
};
const locations = Object.values(places).map((place) => place.join(',')).join('|');

function cs2cs(latitude, longitude) {
  const done = spawnSync('cs2cs', ['-f', '%.6f', 'EPSG:4326+5773', 'EPSG:4979'], {
    input: `${latitude} ${longitude} 0\n`,
    env: { ...process.env, PROJ_NETWORK: 'OFF' },
    encoding: 'utf8',
  });
  assert.equal(done.status, 0, 'cs2cs of the package proj-bin');
  return Number(done.stdout.trim().split(/\s+/)[2]);
}

function tool(program, words) {
  const done = spawnSync(program, words, { encoding: 'utf8' });
  assert.equal(done.status, 0, `${program} of the package gdal-bin: ${done.stderr}`);
  return done.stdout;
}

const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'terrace_datum_'));
const write = (name, text) => {
  fs.writeFileSync(path.join(folder, name), text);
  return path.join(folder, name);
};
const dem = path.join(samples, 'etopo5.tif');

describe('vertical datums', () => {
  let server;
  before(async () => {
    const config = write('terrace.json', JSON.stringify({
      datasets: [
        { name: 'plain', sources: [dem] },
        { name: 'egm96', sources: [dem], vertical: 'egm96', water: { sea_level: 0 } },
        { name: 'single', sources: [{ path: dem, vertical: 'egm96' }], vertical: 'ellipsoid' },
      ],
    }));
    // Variables of the environment must have no effect; this one would disable the driver.
    process.env.GDAL_SKIP = 'GTiff';
    server = await serve('--config', config);
    delete process.env.GDAL_SKIP;
  });
  after(async () => {
    assert.deepEqual(await server.stop(), { code: 0, signal: null });
    fs.rmSync(folder, { recursive: true });
  });
  const heights = async (dataset, query = '') =>
    (await json(`${server.url}/${dataset}/heights?locations=${locations}${query}`)).results.map((r) => r.elevation);

  it('serves the source plus the undulation of cs2cs', async () => {
    const [plain, converted, single] = [await heights('plain'), await heights('egm96'), await heights('single')];
    Object.entries(places).forEach(([name, [latitude, longitude]], i) => {
      const undulation = cs2cs(latitude, longitude);
      assert.ok(Math.abs(undulation) > 1, name);
      assert.ok(Math.abs(converted[i] - plain[i] - undulation) < 0.02, `${name}: ${converted[i]}, ${plain[i]}, ${undulation}`);
    });
    assert.deepEqual(single, converted);
  });

  it('serves each sample that GDAL tells, plus the undulation of cs2cs', async (test) => {
    const info = JSON.parse(tool('gdalinfo', ['-json', dem]));
    const [west, width, , north, , height] = info.geoTransform;
    for (const [name, [latitude, longitude]] of Object.entries(places)) {
      // The sample whose pixel contains the position; at the pole, the last row.
      const column = Math.floor((longitude - west) / width) % info.size[0];
      const row = Math.min(Math.floor((latitude - north) / height), info.size[1] - 1);
      const sample = Number(tool('gdallocationinfo', ['-valonly', dem, `${column}`, `${row}`]));
      const at = [Math.max(north + (row + 0.5) * height, -90), west + (column + 0.5) * width];
      const undulation = cs2cs(...at);
      const reply = await json(`${server.url}/egm96/heights?locations=${at.join(',')}`);
      const served = reply.results[0].elevation;
      test.diagnostic(`${name}: sample ${sample} m + undulation ${undulation.toFixed(3)} m, served ${served} m`);
      assert.ok(Math.abs(served - sample - undulation) < 0.02, `${name}: ${served}, ${sample}, ${undulation}`);
    }
  });

  it('tells orthometric heights where the datum is known', async () => {
    assert.deepEqual(await heights('egm96', '&datum=orthometric'), await heights('plain'));
    assert.equal((await json(`${server.url}/egm96/heights?locations=1,2&datum=orthometric`)).datum, 'orthometric');
    const refused = await request(`${server.url}/plain/heights?locations=1,2&datum=orthometric`);
    assert.equal(refused.status, 400);
    assert.match(refused.body.toString(), /the vertical datum of this dataset is unknown/);
  });

  it('logs the operation and the lack of one', () => {
    assert.match(server.log(), /heights are above EGM96 height, converted to the ellipsoid by PROJ operation/);
    assert.match(server.log(), /no vertical datum stated/);
  });

  it('counts samples and what GDAL reports', async () => {
    assert.equal((await request(`${server.url}/egm96/2/3/1.terrain`)).status, 200);
    assert.ok((await metric(server.url, 'terrace_source_samples_total', 'dataset="egm96",kind="measured"')) > 0);
    assert.ok((await metric(server.url, 'terrace_gdal_cache_bytes')) > 0);
    await metric(server.url, 'terrace_gdal_errors_total');
  });
});

describe('what may be opened', () => {
  it('keeps sources under the data roots', () => {
    const root = fs.mkdtempSync(path.join(os.tmpdir(), 'terrace_roots_'));
    const outside = run('serve', dem, '--data-roots', root);
    assert.equal(outside.code, 1);
    assert.match(outside.err, /lies outside of the data roots/);
    const missing = run('serve', dem, '--data-roots', path.join(root, 'none'));
    assert.equal(missing.code, 2);
    assert.match(missing.err, /is no folder/);
    fs.rmSync(root, { recursive: true });
  });

  it('names formats it does not know', () => {
    const done = run('serve', dem, '--allowed-drivers', 'GTif');
    assert.equal(done.code, 2);
    assert.match(done.err, /"GTif" is no format/);
    assert.equal(spawnSync(binary, ['serve', dem, '--allowed-drivers', 'PNG'], { encoding: 'utf8' }).status, 1);
  });
});
