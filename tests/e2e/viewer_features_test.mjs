// What the viewer adds to the picture: measuring, colours, the sun, labels, two errors, recovery, and the flat map.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, describe, it } from 'node:test';
import { assertAccessible } from './axe.mjs';
import { end, hold, launchWithoutWebGl, openBrowser } from './browser.mjs';
import { samples, serve } from './harness.mjs';
import { measurePath, seenGround } from '../../server/viewer/ground_path.js';
import { formatHeight, formatPosition } from '../../server/viewer/numbers.js';
import { fromLocalMeanTime, sunAltitude, sunDirection } from '../../server/viewer/sun.js';

const kWait = { timeout: 90000, polling: 200 };

describe('numbers of the viewer', () => {
  it('measure the ground of a tent', () => {
    const points = [0, 300, 600].map((distance, i) => ({ distance, height: [0, 400, 0][i] }));
    assert.deepEqual(measurePath(points), { length: 600, along: 1000, up: 400, down: 400, min: 0, max: 400, gaps: false });
  });

  it('have no minus before zero', () => {
    assert.deepEqual([-0.04, -0.06, 1309.5].map((height) => formatHeight(height)), ['0 m', '−0.1 m', '1,310 m']);
    assert.equal(formatHeight(1309.5, 1), '1,309.5 m');
    assert.equal(formatPosition({ longitude: -1e-6, latitude: -1, height: -0.04 }), '1.00000° S  0.00000° E  0 m');
  });

  it('leave voids out', () => {
    const points = [{ distance: 0, height: 5 }, { distance: 10 }, { distance: 20, height: 9 }];
    assert.deepEqual(measurePath(points), { length: 20, along: 20, up: 0, down: 0, min: 5, max: 9, gaps: true });
  });

  it('see over a plain, not through a wall, and not beyond the horizon', () => {
    const plain = Array.from({ length: 101 }, (_, i) => ({ distance: 10 * i, height: 100 }));
    assert.ok(seenGround(plain, 2).every(Boolean));
    const seen = seenGround(plain.map((point, i) => (i === 50 ? { ...point, height: 120 } : point)), 2);
    assert.ok(seen[50] && !seen[60]);
    assert.deepEqual(seenGround([{ distance: 0, height: 5 }, { distance: 10 }, { distance: 20, height: 4 }], 2), [true, undefined, true]);
    // From 2 m the sea is seen to 5.4 km: the square root of 2 R h / (1 - k).
    const sea = Array.from({ length: 1001 }, (_, i) => ({ distance: 10 * i, height: 0 }));
    const horizon = 10 * seenGround(sea, 2).indexOf(false);
    assert.ok(Math.abs(horizon - 5412) < 60, `${horizon} m`);
  });

  it('put the sun where almanacs put it', () => {
    const noon = (day, longitude) => sunDirection(fromLocalMeanTime(`${day}T12:00`, longitude));
    // At solar noon the altitude is 90 degrees - latitude + declination; the equation of time moves noon by a few minutes.
    assert.ok(Math.abs(sunAltitude(noon('2026-06-21', 8), 8, 46.5) - (90 - 46.5 + 23.44)) < 0.1);
    assert.ok(Math.abs(sunAltitude(noon('2026-12-21', -120), -120, 46.5) - (90 - 46.5 - 23.44)) < 0.1);
    assert.ok(sunAltitude(sunDirection(fromLocalMeanTime('2026-06-21T00:00', 8)), 8, 46.5) < -15);
  });
});

describe('features of the viewer', () => {
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'viewer-features-'));
  const config = path.join(folder, 'terrace.json');
  const dataset = { name: 'hills', sources: [path.join(samples, 'jacksboro.tif')] };
  let server, browser, page;

  const write = (...datasets) => fs.writeFileSync(config, JSON.stringify({ datasets }));
  const settled = () => page.waitForFunction(() => window.terrace?.state.ready && !terrace.globe.loading &&
    terrace.globe.drawn().tiles > 1 && !document.querySelector('.curtain'), undefined, kWait);
  const says = (wanted) => page.waitForFunction((pattern) => pattern.test(document.getElementById('dock-text').textContent), wanted, kWait);
  const read = (id) => page.locator(id).innerText();

  before(async () => {
    write(dataset);
    server = await serve('--config', config);
    ({ browser, page } = await openBrowser(760, 480));
    await page.goto(`${server.url}/#dataset=hills&fraction=1`);
    await settled();
  });

  after(() => end(browser, server, folder));

  it('have names', async () => {
    for (const [role, name] of [['combobox', 'Dataset'], ['slider', 'Mesh error'], ['slider', 'Exaggeration']]) {
      assert.equal(await page.getByRole(role, { name, exact: true }).count(), 1, name);
    }
  });

  it('keep colours true under exaggeration', async () => {
    const uniform = () => page.evaluate(() => terrace.globe.material.uniforms.exaggeration);
    assert.equal(await uniform(), 1);
    await page.locator('#exaggeration').focus();
    await page.keyboard.press('End');
    assert.equal(await uniform(), 10);
    await page.keyboard.press('Home');
    assert.equal(await uniform(), 1);
  });

  it('keep the camera above the ground', async () => {
    const place = (camera) => page.evaluate((at) => {
      const before = terrace.globe.camera;
      terrace.globe.camera = at;
      return before;
    }, camera);
    const first = await place([-84.25, 36.3, 8000, 0, -30]);
    await settled();
    await page.locator('#globe').focus();
    for (let i = 0; i < 40; ++i) await page.keyboard.press('+');
    await page.waitForFunction(() => !terrace.globe.loading && terrace.globe.clearance >= 0 && terrace.globe.clearance < 1000, undefined, kWait);
    await place([-84.25, 36.3, 100, 0, -30]);  // the ground is at 614 m
    await page.waitForFunction(() => !terrace.globe.loading && terrace.globe.clearance >= 0, undefined, kWait);
    await place(first);
    await settled();
  });

  it('measure a profile along the ground', async () => {
    await page.locator('#tool-distance').click();
    await page.waitForFunction(() => terrace.state.measure?.mode === 'distance', undefined, kWait);
    await page.evaluate(() => {
      terrace.state.measure.add({ longitude: -84.3, latitude: 36.3, height: 400 });
      return terrace.state.measure.add({ longitude: -84.2, latitude: 36.3, height: 400 });
    });
    await page.locator('#plot .ground.fill').waitFor({ timeout: 30000, state: 'attached' });
    const [, straight, along] = /^([\d.,]+) m straight, ([\d.,]+) /.exec(await read('#dock-text')) ?? /^([\d.,]+)/.exec('0');
    // 0.1 degrees of longitude at 36.3 N are 8982 m on the ellipsoid.
    assert.equal(straight, '8,982', `${await read('#dock-text')} ${along}`);
    await page.locator('#plot').focus();
    await page.keyboard.press('End');
    assert.match(await page.locator('#plot').getAttribute('aria-valuetext'), /^8,982 m: [\d,]+ m$/);
    await page.locator('.marker.place').waitFor({ state: 'attached' });
    await assertAccessible(page, 'a profile');
    const measure = (longitudes) => page.evaluate((degrees) => {
      while (terrace.state.measure.corners.length > 0) terrace.state.measure.undo();
      return degrees.map((longitude) => terrace.state.measure.add({ longitude, latitude: 36.3, height: 400 })).at(-1);
    }, longitudes);
    await measure([-84.3, -84.3]);
    await says(/^0 m straight/);
    assert.doesNotMatch(await page.locator('#plot').innerHTML(), /NaN/);
    await measure([-84.01, -83.9]);  // ends beside the data
    await says(/straight/);
    await page.locator('#plot').focus();
    await page.keyboard.press('End');
    assert.match(await page.locator('#plot').getAttribute('aria-valuetext'), /no height$/);
    await page.waitForFunction(() => document.querySelector('.marker.place').hasAttribute('hidden'), undefined, kWait);
    await measure([-84.7, -84.2]);  // begins beside the data
    await says(/^[\d.,]+ km straight, .*Parts of the ground have no heights/);
    const drawn = await page.locator('#plot .ground.fill').evaluate((path) => (({ x, width }) => ({ x, width }))(path.getBBox()));
    assert.ok(drawn.x > 100 && drawn.width > 100, `the ground after the gap is drawn: ${JSON.stringify(drawn)}`);
    assert.equal(await page.locator('#plot').getAttribute('aria-valuetext'), null, 'of the profile before');
    await measure(Array.from({ length: 400 }, (_, i) => -84.3 + i * 0.0002));  // more than a URL may have
    await says(/^7,168 m straight|^7\.\d km straight|^7,1\d\d m straight/);
    await measure([-84.25, -84.2499]);  // 9 m
    await says(/^[\d.,]+ m straight/);
    const heights = await page.locator('#plot text[text-anchor=end]').allTextContents();
    assert.equal(new Set(heights).size, heights.length, heights.join(', '));
  });

  it('have no key for a tool that is closed', async () => {
    await page.locator('#dock-close').focus();
    await page.keyboard.press('Enter');
    assert.equal(await page.evaluate(() => document.activeElement.id), 'tool-distance');
    await page.locator('#globe').press('Backspace');
    assert.deepEqual(page.wrongs, []);
  });

  it('tell what hides a place', async () => {
    await page.locator('#tool-sight').click();
    await page.waitForFunction(() => terrace.state.measure?.mode === 'sight', undefined, kWait);
    // A ridge between two of the 400 samples stands 1.1 m above this line.
    await page.locator('#eye').fill('200');
    await page.locator('#target').fill('50');
    await page.evaluate(() => {
      terrace.state.measure.add({ longitude: -84.13, latitude: 36.43, height: 400 });
      return terrace.state.measure.add({ longitude: -84.14, latitude: 36.21, height: 400 });
    });
    await says(/^Hidden: the ground at [\d.,]+ k?m stands 1\.\d+ m above the line\. 24\.4 km away; \d+ % of the ground between is seen.$/);
    await page.locator('#plot .sight.blocked').waitFor({ state: 'attached' });
    await page.locator('#target').fill('9000');
    await says(/^Visible/);
    await assertAccessible(page, 'a line of sight');
    const look = (longitude) => page.evaluate((east) => {
      terrace.state.measure.add({ longitude: -84.13, latitude: 36.43, height: 400 });
      return terrace.state.measure.add({ longitude: east, latitude: 36.21, height: 400 });
    }, longitude);
    const sight = await hold(page, '**/sight?*');
    await look(-84.14);
    await sight.asked;
    assert.ok(await page.evaluate(() => terrace.state.measure.plot.points === terrace.state.measure.points), 'not the profile before');
    await sight.release();
    await look(-83.9);  // beside the data
    await says(/^The line of sight is not known: the dataset has no height at the target\.$/);
    await page.route('**/heights?path=*', async (route) => {
      const body = await (await route.fetch()).json();
      for (const result of body.results.slice(1, -1)) result.elevation = null;
      await route.fulfill({ json: body });
    });
    await look(-84.14);
    await says(/^Visible\. .*100 % of the ground between is seen\. Parts of the ground have no heights/);
    await page.unroute('**/heights?path=*');
    await page.locator('#dock-close').click();
    assert.equal(await page.locator('.overlay .line').count(), 0);
  });

  it('label contours at round heights', async () => {
    await page.locator('#contours').check();
    await page.waitForFunction(() => document.querySelectorAll('.contour-labels text').length > 2, undefined, kWait);
    const interval = await page.evaluate(() => terrace.globe.interval);
    for (const text of await page.locator('.contour-labels text').allTextContents()) {
      assert.equal(Number(text.replace(/[^\d]/g, '')) % (5 * interval), 0, text);
    }
    await page.locator('#contours').uncheck();
    assert.equal(await page.locator('.contour-labels text').count(), 0);
  });

  it('hold colours, sun and the second error in the address', async () => {
    await page.locator('#colouring').selectOption('slope');
    assert.match(await read('#ticks'), /30°/);
    await page.locator('#sunny').check();
    await page.locator('#compare').check();
    await page.waitForFunction(() => terrace.globe.tiles3d.drawn().tiles > 1, undefined, kWait);
    const state = () => page.evaluate(() => [terrace.state.colouring, terrace.state.sun, terrace.state.right]);
    const before = await state();
    await page.waitForURL(/colours=slope&sun=\d{4}-06-21T18:30&right=4/);
    await assertAccessible(page, 'all settings, two errors');
    await page.reload();
    await settled();
    assert.deepEqual(await state(), before);
    await page.locator('#sun-date').fill('');
    await page.locator('#sun-hour').focus();
    await page.keyboard.press('Home');
    assert.match((await state())[1], /^\d{4}-06-21T00:00$/, 'the hour of the last date');
    await page.locator('#sun-date').evaluate((date) => {
      date.value = '12026-06-21';
      date.dispatchEvent(new Event('input', { bubbles: true }));
    });
    assert.match((await state())[1], /^\d{4}-06-21T00:00$/, 'a year of five digits');
    await page.locator('#compare').uncheck();
    await page.locator('#sunny').uncheck();
    await page.locator('#colouring').selectOption('height');
  });

  it('tell the keys', async () => {
    await page.locator('#help').click();
    assert.ok(await page.locator('#keys').isVisible());
    await assertAccessible(page, 'the keys');
    await page.keyboard.press('Escape');
    assert.ok(await page.locator('#keys').isHidden());
  });

  it('go on after the server was killed and started again', async () => {
    await page.evaluate(() => (window.sameDocument = true));
    await page.locator('#tool-distance').click();
    await page.waitForFunction(() => terrace.state.measure?.mode === 'distance', undefined, kWait);
    const port = new URL(server.url).port;
    await server.stop('SIGKILL');
    await page.getByText('The server does not answer').waitFor({ timeout: 30000 });
    await assertAccessible(page, 'a message');
    await page.locator('#tool-draft').click();
    // The note is there for four seconds.
    const boxes = await page.waitForFunction(() => {
      const [message, note] = ['message', 'note'].map((id) => document.getElementById(id));
      return note.textContent.startsWith('The tool could not be loaded') && !note.hidden &&
        [message.getBoundingClientRect().bottom, note.getBoundingClientRect().top];
    }, undefined, kWait);
    const [bottom, top] = await boxes.jsonValue();
    assert.ok(bottom <= top, `one below the other: ${bottom}, ${top}`);
    // At a place that no other test has asked for: a browser keeps replies.
    await page.evaluate(() => [-84.3, -84.2].map((longitude) => terrace.state.measure.add({ longitude, latitude: 36.27, height: 400 })).at(-1));
    await says(/^The heights could not be read/);
    server = await serve('--config', config, '--listen', `127.0.0.1:${port}`);
    await page.waitForFunction(() => document.getElementById('message').hidden, undefined, kWait);
    await page.locator('#fraction').focus();
    await page.keyboard.press('End');
    await page.waitForTimeout(500);
    await settled();
    assert.ok(await page.evaluate(() => window.sameDocument), 'without a reload');
    await says(/straight/);
    await page.locator('#dock-close').click();
  });

  it('follow a new version and tell of a dataset that is gone', async () => {
    const version = await page.evaluate(() => terrace.state.dataset.version);
    await page.locator('#tool-distance').click();
    await page.waitForFunction(() => terrace.state.measure?.mode === 'distance', undefined, kWait);
    await page.evaluate(() => [-84.3, -84.2].map((longitude) => terrace.state.measure.add({ longitude, latitude: 36.3, height: 400 })).at(-1));
    await says(/straight/);
    const points = await page.evaluateHandle(() => terrace.state.measure.points);
    write({ ...dataset, error_fraction: 0.9 });
    process.kill(server.pid, 'SIGHUP');
    await page.waitForFunction((old) => ![old, undefined].includes(terrace.globe.shownVersion), version, kWait);
    await page.waitForFunction((old) => terrace.state.measure.points !== old && terrace.state.measure.points.length > 1, points, kWait);
    await page.locator('#dock-close').click();
    await settled();
    write({ ...dataset, name: 'others' });
    process.kill(server.pid, 'SIGHUP');
    await page.getByText('hills is no longer on this server').waitFor({ timeout: 30000 });
    assert.ok(await page.evaluate(() => terrace.globe.drawn().tiles > 1), 'the picture stays');
    // The list may say first that a dataset is being prepared.
    const lists = (options) => page.waitForFunction((expected) =>
      [...document.querySelectorAll('#dataset option')].map(({ text, selected }) => (selected ? `[${text}]` : text)).join() === expected,
    options.join(), kWait);
    await lists(['others', '[hills (no longer there)]']);
    write(dataset);
    process.kill(server.pid, 'SIGHUP');
    await page.waitForFunction(() => document.getElementById('message').hidden, undefined, kWait);
    await lists(['[hills]']);
    assert.deepEqual(page.wrongs, []);
  });

  it('show a flat map without WebGL 2', async (test) => {
    const plain = await launchWithoutWebGl();
    test.after(() => plain.close());
    const flat = await plain.newPage({ viewport: { width: 700, height: 450 } });
    // The page believes in WebGL 2 until CesiumJS needs it; and the first list of datasets fails.
    await flat.addInitScript(() => {
      const { getContext } = HTMLCanvasElement.prototype;
      HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
        return kind === 'webgl2' && !this.isConnected ? {} : getContext.call(this, kind, ...rest);
      };
    });
    await flat.route('**/datasets', (route) => route.fulfill({ status: 503, body: '' }), { times: 1 });
    await flat.goto(`${server.url}/`);
    await flat.getByText('no WebGL 2').waitFor({ timeout: 30000 });
    await flat.waitForFunction(() => {
      const canvas = document.querySelector('#globe canvas');
      if (!canvas?.width) return false;
      const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
      return new Set(new Uint32Array(data.buffer)).size > 500;
    }, undefined, kWait);
    await flat.locator('#globe').focus();
    await flat.keyboard.press('Enter');
    await flat.waitForFunction(() => / m$/.test(document.getElementById('readout').textContent), undefined, kWait);
    await flat.route('**/heights*', (route) => route.fulfill({ status: 503, body: '' }), { times: 1 });
    await flat.keyboard.press('Enter');
    await flat.getByText('The height could not be read').waitFor({ timeout: 30000 });
    await assertAccessible(flat, 'the flat map');
    await flat.route('**/datasets', async (route) => {
      const list = await (await route.fetch()).json();
      const [{ urls: { tiles_json, ...urls }, ...others }] = list.datasets;
      await route.fulfill({ json: { ...list, datasets: [...list.datasets, { ...others, name: 'bare', urls }] } });
    });
    await flat.reload();
    const isDrawn = (wanted) => flat.waitForFunction((is) => (document.querySelector('#globe canvas')?.width > 0) === is, wanted, kWait);
    await isDrawn(true);
    await flat.locator('#dataset').selectOption('bare');
    await flat.getByText('bare has no height images').waitFor({ timeout: 30000 });
    await isDrawn(false);
    await flat.evaluate(() => (location.hash = 'dataset=hills'));
    await isDrawn(true);
    assert.ok(await flat.locator('#message').isHidden());
    await flat.unroute('**/datasets');
    await flat.goto('about:blank');
    await flat.goto(`${server.url}/#dataset=nowhere`);
    await flat.getByText('There is no dataset nowhere on this server; this is hills.').waitFor({ timeout: 30000 });
  });
});
