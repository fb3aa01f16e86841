// The viewer with unusual input: odd rasters, an archive without its sources, garbage in the address, very small windows.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, describe, it } from 'node:test';
import { end, hold, launchWithoutWebGl, openBrowser } from './browser.mjs';
import { run, samples, serve } from './harness.mjs';
import { boxOf, discOf, isGlobal } from '../../server/viewer/framing.js';
import { heightColour, heightTicks } from '../../server/viewer/colours.js';

const kWait = { timeout: 90000, polling: 200 };

// An ASCII grid in degrees; `height(x, y)` of each sample, -9999 is a void.
function writeGrid(file, side, height, { columns = side, west = 10, south = 45, cell = 0.001 } = {}) {
  const rows = Array.from({ length: side }, (_, y) => Array.from({ length: columns }, (_, x) => height(x, y)).join(' '));
  fs.writeFileSync(file, `ncols ${columns}\nnrows ${side}\nxllcorner ${west}\nyllcorner ${south}\ncellsize ${cell}\nNODATA_value -9999\n${rows.join('\n')}\n`);
  fs.writeFileSync(file.replace(/asc$/, 'prj'), 'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],' +
    'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]]');
  return file;
}

describe('a level raster', () => {
  it('has one colour and no ticks between its ends', () => {
    assert.deepEqual(heightColour(500, { min: 500, max: 500 }), heightColour(500, { min: 500, max: 501 }));
    assert.deepEqual(heightTicks({ min: 500, max: 500 }), []);
    assert.deepEqual(heightTicks({ min: 0, max: 0 }), []);
  });
});

describe('a first view', () => {
  const frame = (...bounds) => ({ bounds });

  it('is of a globe only if the data is wide in metres', () => {
    for (const wide of [frame(-180, -90, 180, 90), frame(-180, 60, 180, 90), frame(100, -40, -150, 10)]) assert.ok(isGlobal(wide), `${wide.bounds}`);
    for (const small of [frame(-180, 85, 180, 90), frame(-180, -90, 180, -89), frame(-70, 80, 50, 84), frame(5, 45, 15, 48)]) {
      assert.ok(!isGlobal(small), `${small.bounds}`);
    }
  });

  it('has a pole in the middle of what goes around it', () => {
    assert.deepEqual(discOf(frame(-180, -90, 180, -89)), { longitude: 0, latitude: -90, diameter: 2 * 111320 });
    assert.equal(discOf(frame(5, 45, 15, 48)).latitude, 46.5);
  });

  it('has its middle within 180 degrees, beyond which the server has no heights', () => {
    assert.deepEqual([[179, 0, -178, 1], [178, 0, -179, 1], [-180, 0, 180, 1]].map((bounds) => boxOf(bounds).longitude), [-179.5, 179.5, 0]);
  });
});

describe('the viewer', () => {
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'viewer-odd-'));
  let server, browser, page;

  const settled = () => page.waitForFunction(() => window.terrace?.state.ready && terrace.globe.drawn().tiles > 1 && !terrace.globe.loading &&
    !document.querySelector('.curtain'), undefined, kWait);
  const open = async (hash) => {
    await page.goto('about:blank');
    await page.goto(`${server.url}/${hash}`);
    await settled();
  };

  before(async () => {
    // An island of data far above its floor, a raster of few metres, and one of two samples on a high plain.
    const isle = writeGrid(path.join(folder, 'isle.asc'), 60, (x, y) => ((x - 30) ** 2 + (y - 30) ** 2 < 200 ? 1200 + x : -9999));
    const level = writeGrid(path.join(folder, 'level.asc'), 20, () => 2500);
    const small = writeGrid(path.join(folder, 'small.asc'), 2, (x, y) => 3000 + x + y);
    const deep = writeGrid(path.join(folder, 'deep.asc'), 20, (x, y) => x + y - 9020);
    const cap = writeGrid(path.join(folder, 'cap.asc'), 6, (x, y) => 100 * y, { columns: 720, west: -180, south: 87, cell: 0.5 });
    const archive = path.join(folder, 'archive');
    const bake = run('bake', path.join(samples, 'jacksboro.tif'), '--out', archive);
    assert.equal(bake.code, 0, bake.err);
    const config = path.join(folder, 'terrace.json');
    const datasets = [isle, level, small, deep, cap, path.join(samples, 'jacksboro.tif')].map((file) => ({ name: path.parse(file).name, sources: [file] }));
    fs.writeFileSync(config, JSON.stringify({ datasets: [...datasets, { name: 'archive', baked: archive }] }));
    server = await serve('--config', config);
    ({ browser, page } = await openBrowser(640, 400));
  });

  after(() => end(browser, server, folder));

  it('draws the floor around an inland raster as ground, not as water', async () => {
    await open('#dataset=isle&camera=10.03,45.03,9000,0,-90');
    await page.locator('#panel > summary').click();
    const png = (await page.screenshot({ clip: { x: 200, y: 80, width: 240, height: 240 } })).toString('base64');
    const blue = await page.evaluate(async (base64) => {
      const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${base64}`)).blob());
      const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
      context.drawImage(image, 0, 0);
      const { data } = context.getImageData(0, 0, image.width, image.height);
      let count = 0;
      for (let i = 0; i < data.length; i += 4) count += data[i + 2] > 1.3 * data[i + 1] && data[i + 2] > 90;
      return count / (data.length / 4);
    }, png);
    assert.ok(blue < 0.001, `${blue} of the picture is blue`);
  });

  for (const [name, ground] of [['small', 3001], ['level', 2500], ['deep', -9000]]) {
    it(`shows the raster ${name} from above its ground`, async () => {
      await open(`#dataset=${name}`);
      const [longitude, latitude, height] = await page.evaluate(() => terrace.globe.camera);
      assert.ok(height > ground && height < ground + 5000, `${height} m`);
      assert.ok(Math.hypot(longitude - 10, latitude - 45) < 0.1);
    });
  }

  it('is steered, contoured and marked below the ellipsoid as above it', async () => {
    await open('#dataset=deep&contours&camera=10.01,45.005,-8000,0,-40');
    const { interval, before, after } = await page.evaluate(() => {
      const { globe } = terrace;
      globe.adaptToCamera();
      const [, before] = globe.camera;
      document.getElementById('globe').dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowUp' }));
      return { interval: globe.interval, before, after: globe.camera[1] };
    });
    assert.ok(interval < 100, `contours of ${interval} m on ground 1 km away`);
    assert.ok(after > before && after < before + 0.01, `ahead from ${before} to ${after}`);
    const isHidden = await page.evaluate(() => {
      const { globe } = terrace;
      globe.exaggeration = 10;
      globe.camera = [-150, 20, 20000, 0, -90];
      globe.overlay.setMarker('picked', { longitude: -150, latitude: 20, height: -5000 });
      globe.scene.render();
      return document.querySelector('.marker.picked').hasAttribute('hidden');
    });
    assert.equal(isHidden, false, 'a marker on the floor of a deep sea');
  });

  it('shows a region around a pole from near', async () => {
    // The many narrow tiles there take a software renderer a minute, and the camera does not wait for them.
    await page.goto('about:blank');
    await page.goto(`${server.url}/#dataset=cap&fraction=4`);
    await page.waitForFunction(() => window.terrace?.state.ready, undefined, kWait);
    const [, latitude, height] = await page.evaluate(() => terrace.globe.camera);
    assert.ok(latitude > 85 && height > 1e5 && height < 5e5, `${latitude}, ${height} m`);
  });

  const select = (name) => page.locator('#dataset').selectOption(name);
  const saysNothing = async (of) => assert.equal(await of.locator('#message').isVisible() && await of.locator('#message').innerText(), false);

  it('says nothing about a dataset that was chosen before another one', async () => {
    await open('#dataset=level');
    const small = await hold(page, '**/small/layer.json*');
    await select('small');
    await small.asked;
    await select('deep');
    await settled();
    await small.release({ status: 404, body: '' });
    await saysNothing(page);
    assert.equal(await page.evaluate(() => terrace.state.hasFailed), false);
  });

  it('asks again for a dataset that could not be loaded, and keeps its message until then', async () => {
    const small = await hold(page, '**/small/layer.json*');
    await page.route('**/level/layer.json*', (route) => route.fulfill({ status: 503, body: '' }));
    await select('small');
    await small.asked;
    await select('level');
    await page.getByText('level could not be loaded').waitFor({ timeout: 90000 });
    await small.release();
    assert.match(await page.locator('#message').innerText(), /^level could not be loaded/);
    await page.unroute('**/level/layer.json*');
    await page.waitForFunction(() => document.getElementById('message').hidden, undefined, kWait);
    await settled();
    assert.equal(await page.evaluate(() => terrace.globe.shownVersion === terrace.state.dataset.version), true);
  });

  it('keeps the camera of an address that is opened during a flight', async () => {
    const flights = await page.evaluate(async () => {
      terrace.globe.camera = [10.03, 45.03, 500000, 0, -90];
      document.getElementById('home').click();
      await new Promise((resolve) => setTimeout(resolve));
      const { length } = terrace.globe.scene.tweens;
      location.hash = '#dataset=level&camera=10.03,45.03,9000,0,-90';
      return length;
    });
    assert.ok(flights > 0);
    await page.waitForFunction(() => terrace.globe.scene.tweens.length === 0, undefined, kWait);
    assert.equal(await page.evaluate(() => Math.round(terrace.globe.camera[2])), 9000);
  });

  it('takes the slider for the dataset that it was moved at', async () => {
    const fraction = await page.evaluate(() => {
      for (const [id, value, kind] of [['fraction', 10, 'input'], ['dataset', 'deep', 'change']]) {
        document.getElementById(id).value = value;
        document.getElementById(id).dispatchEvent(new Event(kind));
      }
      return terrace.state.fraction;
    });
    await page.waitForTimeout(400);
    assert.equal(await page.evaluate(() => terrace.state.fraction), fraction);
  });

  it('takes garbage in the address for what is nearest to it, or for nothing', async () => {
    await open('#%%%&&==&dataset&fraction=1e300&right=-1&exaggeration=1e9&split=-7&colours=plaid&sun=2026-99-99T99:99&camera=1e9,-1e9,1e99,1e9,1e9');
    const view = await page.evaluate(() => ({ fraction: terrace.state.fraction, right: terrace.state.right, sun: terrace.state.sun,
      exaggeration: terrace.globe.exaggeration, colouring: terrace.state.colouring, split: terrace.globe.split }));
    assert.deepEqual({ ...view, fraction: 0 }, { fraction: 0, right: undefined, sun: undefined, exaggeration: 10, colouring: 'height', split: 0.5 });
    await page.waitForURL(/camera=(9|10)\.\d+,4[45]\.\d+,/);  // the first dataset is in view
    const decoded = (hash) => page.evaluate(async (text) => (await import('/viewer/view_url.js')).decodeView(text), hash);
    for (const camera of ['a,b,c,d,e', '1,2,3', '', 'NaN,0,0,0,0', '1,2,3,4,5,6', '8,46,1e9,0,0', '8,46,-1e5,0,0', '8,91,5000,0,0', ',,,,', '8,46,,0,0']) {
      assert.equal((await decoded(`#dataset=x&camera=${camera}`)).camera, undefined, camera);
    }
    const suns = ['2026-02-31T10:00', '2026-06-21T24:00', '12026-06-21T10:00', '1970-01-01T00:00', '2026-02-28T23:59'];
    for (const [i, sun] of suns.entries()) assert.equal((await decoded(`#sun=${sun}`)).sun, i > 2 ? sun : undefined, sun);
    const { camera, fraction, right } = await decoded('#dataset=x&camera=-179.5,-80,-4000,359.9,12.5&fraction=1e-300&right=1e300');
    assert.ok((await decoded('#dataset=x&exaggeration=5&camera=142,11,-45000,10,-28')).camera, 'above exaggerated ground');
    assert.deepEqual({ camera, fraction, right }, { camera: [-179.5, -80, -4000, 359.9, 12.5], fraction: 1 / 32, right: 4 });
    assert.deepEqual(page.wrongs, []);
  });

  it('reads the heights of an archive without its sources', async () => {
    await open('#dataset=archive&fraction=4&tiles3d');
    for (const id of ['#tiles3d', '#compare', '#splitter', '#fraction']) assert.ok(await page.locator(id).isHidden(), `${id}: one error, no 3D Tiles`);
    assert.equal(await page.locator('#message').isVisible(), false);
    await page.locator('#globe').press('Enter');
    await page.getByText(/ data [\d,]+ m$/).waitFor();
    const measuring = await hold(page, '**/viewer/measure.js');
    await page.locator('#tool-distance').click();
    await measuring.asked;
    await page.locator('#tool-draft').click();
    await page.waitForFunction(() => terrace.state.draft?.isOpen, undefined, kWait);
    await measuring.release();
    assert.ok(await page.evaluate(() => import('/viewer/measure.js').then(() => terrace.state.draft.isOpen && !terrace.state.measure)), 'the tool clicked last');
    await page.locator('#draft-close').click();
    const corners = [[-84.3, 36.3], [-84.2, 36.3], [-84.2, 36.35]].map(([longitude, latitude]) => ({ longitude, latitude, height: 400 }));
    for (const [tool, count, text] of [['distance', 2, /8,982 m straight, .* up, /], ['sight', 2, /^(Visible|Hidden)/], ['draft', 3, /Raises the ground/]]) {
      await page.locator(`#tool-${tool}`).click();
      await page.waitForFunction((mode) => (mode === 'draft' ? terrace.state.draft?.isOpen : terrace.state.measure?.mode === mode), tool, kWait);
      await page.evaluate(([places, name]) => places.forEach((place) => terrace.state[name].add(place)),
        [corners.slice(0, count), tool === 'draft' ? 'draft' : 'measure']);
      await page.locator(tool === 'draft' ? '#draft-text' : '#dock-text').getByText(text).waitFor();
    }
    await page.evaluate(() => {
      terrace.state.draft.corners = [];
      for (const [longitude, latitude] of [[-84.39, 36.17], [-84.09, 36.17], [-84.25, 36.44]]) terrace.state.draft.add({ longitude, latitude, height: 400 });
    });
    await page.locator('#draft-text').getByText(/^403\.9 km².*Raises the ground/).waitFor();  // 90 of the finest tiles
    await page.evaluate(() => terrace.state.draft.end());
    assert.deepEqual(page.wrongs, []);
  });

  it('shows on a flat map what was wanted last', async (test) => {
    const plain = await launchWithoutWebGl();
    test.after(() => plain.close());
    const flat = await plain.newPage({ viewport: { width: 640, height: 400 } });
    const drawn = (name) => flat.waitForFunction((wanted) => {
      const canvas = document.querySelector('#globe canvas');
      return document.getElementById('dataset').value === wanted && canvas?.width > 0 &&
        canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.some((value) => value > 0);
    }, name, kWait);
    const pick = (name) => flat.locator('#dataset').selectOption(name);
    await flat.goto(`${server.url}/#dataset=level&camera=10,45,9000,0,-30&contours`);
    await drawn('level');
    assert.match(flat.url(), /#dataset=level&camera=10,45,9000,0,-30&contours$/, 'the view of the address, for the globe');

    let small = await hold(flat, /\/small\/tiles\.json/);
    await flat.evaluate(() => (location.hash = 'dataset=small'));
    await small.asked;
    await pick('level');
    await drawn('level');
    await small.release();
    await saysNothing(flat);

    small = await hold(flat, /\/small\/tiles\.json/);
    await pick('small');
    await small.asked;
    await pick('level');
    await drawn('level');
    await small.release({ status: 404, body: '' });
    await saysNothing(flat);

    const heights = await hold(flat, '**/level/heights*');
    await flat.locator('#globe').press('Enter');
    await heights.asked;
    await flat.locator('#globe').press('ArrowRight');
    await flat.locator('#globe').press('Enter');
    await flat.waitForFunction(() => document.getElementById('readout').textContent.endsWith(' 2,500 m'), undefined, kWait);
    const readout = await flat.locator('#readout').innerText();
    await heights.release();
    assert.equal(await flat.locator('#readout').innerText(), readout);

    const isTile = /\/deep\/.*\.png/;
    await flat.route(isTile, (route) => route.fulfill({ status: 503, body: '' }));
    const refused = flat.waitForResponse(isTile);
    await pick('deep');
    await refused;
    await flat.unroute(isTile);
    await drawn('deep');

    await pick('cap');
    await flat.getByText('cap is beyond 85 degrees').waitFor();
  });

  it('keeps the panel, the tools and its messages apart', async () => {
    const apart = async (first, second) => {
      const [a, b] = [await page.locator(first).boundingBox(), await page.locator(second).boundingBox()];
      const isApart = a.x + a.width <= b.x || b.x + b.width <= a.x || a.y + a.height <= b.y || b.y + b.height <= a.y;
      assert.ok(isApart, `${first} ${JSON.stringify(a)} is over ${second} ${JSON.stringify(b)}`);
    };
    for (const [width, height] of [[640, 400], [800, 300], [240, 240]]) {
      await page.setViewportSize({ width, height });
      await page.goto('about:blank');
      await page.goto(`${server.url}/#dataset=nowhere`);
      await page.locator('#message').waitFor({ timeout: 90000 });
      if (width > 560) await apart('#message', '#panel');
      if (height === 400) {
        await page.waitForFunction(() => window.terrace?.state.ready, undefined, kWait);
        await page.locator('#tool-distance').click();
        await page.locator('#dock').waitFor();
        await apart('#dock', '#panel');
        await apart('#dock', '#tools');
      }
      await apart('#tools', '#panel');
      await apart('#tools', '#message');
      const tools = await page.locator('#tools').boundingBox();
      assert.ok(tools.x >= 0 && tools.x + tools.width <= width && tools.y + tools.height <= height, JSON.stringify(tools));
    }
  });
});
