// Edits in the viewer: outlines of a dataset's edits, and a polygon that is drawn, downloaded and served.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, describe, it } from 'node:test';
import { assertAccessible } from './axe.mjs';
import { end, openBrowser } from './browser.mjs';
import { json, request, run, samples, serve } from './harness.mjs';
import { crossesItself, earthwork, flattenGeoJson, isBeside, placesInside, signedArea } from '../../server/viewer/edit_shapes.js';
import { formatVolume } from '../../server/viewer/numbers.js';

const kWait = { timeout: 120000, polling: 200 };
const hills = path.join(samples, 'jacksboro.tif');
const at = (longitude, latitude) => ({ longitude, latitude });

describe('shapes of edits', () => {
  const square = [at(-84.3, 36.3), at(-84.3, 36.31), at(-84.29, 36.31), at(-84.29, 36.3)];

  it('have an area and a direction', () => {
    // Square kilometres: the element of area (the radii of curvature of WGS 84), integrated numerically.
    const box = (west, south, east, north) => [at(west, south), at(east, south), at(east, north), at(west, north)];
    for (const [ring, squareKm] of [[box(-84.3, 36.2, -84.2, 36.3), 99.7322], [box(0, 40, 40, 70), 8447290.5433], [box(170, -10, -170, 10), 4899329.1759]]) {
      for (let first = 0; first < 4; ++first) {
        const turned = [...ring.slice(first), ...ring.slice(0, first)];
        assert.ok(Math.abs(signedArea(turned) / 1e6 / squareKm - 1) < 1e-6, `${signedArea(turned) / 1e6} km2`);
      }
    }
    assert.ok(signedArea(square) < 0, 'clockwise');
    assert.equal(signedArea([at(8, 46), at(9, 46), at(8.5, 46)]), 0);
  });

  it('may not cross themselves', () => {
    assert.ok(!crossesItself(square));
    assert.ok(!crossesItself(square.slice(1)));
    assert.ok(crossesItself([square[0], square[2], square[1], square[3]]));
    const bracket = [at(0, 0), at(3, 0), at(3, 1), at(1, 1), at(1, 2), at(3, 2), at(3, 3), at(0, 3)];
    assert.ok(!crossesItself(bracket), 'two edges on one line');
    assert.ok(crossesItself([...bracket.slice(0, 6), at(3, 0.5), at(0, 3)]), 'two that overlap on one line');
  });

  it('lie in or beside the data', () => {
    for (const data of [[-85, 36, -84, 37], [-180, -90, 180, 90], [170, 30, -84.295, 40], [-84.295, 30, -170, 40]]) assert.ok(!isBeside(square, data), `${data}`);
    for (const data of [[-84, 36, -83, 37], [-85, 30, -84, 36], [170, 30, -170, 40], [-84.2, 30, -84.4, 40]]) assert.ok(isBeside(square, data), `${data}`);
    assert.ok(!isBeside([at(179.9, 0), at(-179.9, 0), at(-179.9, 1)], [-179.95, 0, -170, 10]));
  });

  it('contain places', () => {
    const places = placesInside(square.slice(1), 400);
    const runway = placesInside([at(-84.3, 36.3), at(-84.28, 36.32), at(-84.2802, 36.3204), at(-84.3002, 36.3004)], 400);
    for (const found of [places, runway]) assert.ok(found.length > 350 && found.length < 450, `${found.length}`);
    assert.ok(places.every(({ longitude, latitude }) => longitude - -84.3 > 36.31 - latitude - 1e-9));
  });

  it('move ground', () => {
    assert.deepEqual(earthwork([10, 20, undefined, 30, 40], 25, 400), { known: 0.8, raised: 15, lowered: 15, fill: 1600, cut: 1600 });
  });

  it('have volumes in one unit', () => {
    assert.deepEqual([2000, 571.2e6, 4.981e9].map(formatVolume), ['2,000 m³', '571.2 million m³', '4,981 million m³']);
  });

  it('are closed and counterclockwise in the file', () => {
    const { features: [{ geometry, properties }] } = flattenGeoJson(square, 500.12345, 0);
    const [ring] = geometry.coordinates;
    assert.deepEqual(ring, [[-84.29, 36.3], [-84.29, 36.31], [-84.3, 36.31], [-84.3, 36.3], [-84.29, 36.3]]);
    assert.deepEqual(properties.terrain, { op: 'flatten', height: 500.123 });
  });
});

describe('a shape across 180 degrees', () => {
  // Open to the east, so that it has two parts there.
  const bracket = [at(179.5, 0), at(-179.5, 0), at(-179.5, 0.2), at(179.7, 0.2), at(179.7, 0.4), at(-179.5, 0.4), at(-179.5, 0.6), at(179.5, 0.6)];

  it('contains places on both sides, and none beyond', () => {
    const places = placesInside(bracket, 400);
    assert.ok(places.length > 250 && places.every(({ longitude }) => Math.abs(longitude) >= 179.5 && Math.abs(longitude) <= 180));
  });

  it('is divided in the file, which terrace takes', (test) => {
    const file = flattenGeoJson(bracket, 100, 0);
    assert.deepEqual(file.features[0].geometry, { type: 'MultiPolygon', coordinates: [
      [[[-180, 0], [-179.5, 0], [-179.5, 0.2], [-180, 0.2], [-180, 0]]],
      [[[-180, 0.4], [-179.5, 0.4], [-179.5, 0.6], [-180, 0.6], [-180, 0.4]]],
      [[[180, 0.2], [179.7, 0.2], [179.7, 0.4], [180, 0.4], [180, 0.6], [179.5, 0.6], [179.5, 0], [180, 0], [180, 0.2]]],
    ] });
    const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'viewer-edits-'));
    test.after(() => fs.rmSync(folder, { recursive: true }));
    const drawn = path.join(folder, 'drawn.geojson');
    fs.writeFileSync(drawn, JSON.stringify(file));
    const info = run('info', path.join(samples, 'etopo5.tif'), '--edits', drawn);
    assert.equal(info.code, 0, info.err);
  });

  it('is one polygon if only a corner is at 180 degrees', () => {
    const [{ geometry }] = flattenGeoJson([at(-180, 0), at(-180, 0.4), at(179.8, 0.4)], 100, 0).features;
    assert.deepEqual(geometry, { type: 'Polygon', coordinates: [[[180, 0.4], [179.8, 0.4], [180, 0], [180, 0.4]]] });
    const [{ geometry: east }] = flattenGeoJson([at(180, 0), at(-179, 0), at(-179, 1)], 100, 0).features;
    assert.deepEqual(east, { type: 'Polygon', coordinates: [[[-180, 0], [-179, 0], [-179, 1], [-180, 0]]] });
  });
});

describe('edits in the viewer', () => {
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'viewer-edits-'));
  const config = path.join(folder, 'terrace.json');
  const edits = path.join(folder, 'quarry.geojson');
  let server, browser, page;

  before(async () => {
    const corners = [at(-84.27, 36.28), at(-84.23, 36.28), at(-84.23, 36.32), at(-84.27, 36.32)];
    const file = flattenGeoJson(corners, 400, 100);
    file.features.unshift({ type: 'Feature', properties: { name: 'not an edit' }, geometry: null });
    fs.writeFileSync(edits, JSON.stringify(file));
    fs.writeFileSync(config, JSON.stringify({ datasets: [
      { name: 'hills', sources: [hills], edits: [edits] }, { name: 'plain', sources: [hills] },
    ] }));
    server = await serve('--config', config);
    ({ browser, page } = await openBrowser(700, 420, { acceptDownloads: true }));
  });

  after(() => end(browser, server, folder));

  it('are offered as GeoJSON, where there are any', async () => {
    const { datasets } = await json(`${server.url}/datasets`);
    assert.deepEqual(datasets.map(({ urls }) => urls.edits), ['/hills/edits.geojson', undefined]);
    const reply = await request(`${server.url}/hills/edits.geojson`);
    assert.equal(reply.headers['content-type'], 'application/geo+json');
    assert.equal(reply.headers['cache-control'], 'no-cache');
    const { features: [{ properties, geometry }, ...others] } = JSON.parse(reply.body);
    assert.deepEqual([properties, others], [{ op: 'flatten', file: 'quarry.geojson', feature: 1, area: true }, []]);
    assert.equal(geometry.type, 'MultiLineString');
    assert.deepEqual(geometry.coordinates, [[[-84.27, 36.28], [-84.23, 36.28], [-84.23, 36.32], [-84.27, 36.32], [-84.27, 36.28]]]);
    assert.equal((await request(`${server.url}/plain/edits.geojson`)).status, 404);
    assert.equal((await request(`${server.url}/hills/edits.geojson?z=1`)).status, 400);
  });

  it('are outlined on the globe', async () => {
    await page.goto(`${server.url}/#dataset=hills&fraction=4`);
    await page.waitForFunction(() => window.terrace?.state.ready && !terrace.globe.loading && terrace.globe.drawn().tiles > 1, undefined, kWait);
    assert.ok(await page.locator('#edits').isVisible());
    await page.locator('#edits').check();
    await page.waitForFunction(() => /^M.*L/.test(document.querySelector('.overlay .line.edit.flatten')?.getAttribute('d') ?? ''), undefined, kWait);
    await page.waitForURL(/&edits/);
    const height = await page.evaluate(() => terrace.globe.heightAt(-84.25, 36.3));
    assert.ok(Math.abs(height - 400) < 60, `on the flat ground, at this error: ${height} m`);
    const camera = await page.evaluate(() => {
      const before = terrace.globe.camera;
      terrace.state.editsInView = undefined;
      terrace.globe.camera = [-84.25, 36.3, 1200, 0, -90];
      return before;
    });
    await page.waitForFunction(() => terrace.state.editsInView !== undefined, undefined, kWait);
    assert.equal(await page.evaluate(() => terrace.state.editsInView), 1, 'an edit around the view, without a corner in it');
    await page.evaluate((before) => (terrace.globe.camera = before), camera);
    await page.waitForFunction(() => !terrace.globe.loading && document.querySelectorAll('.overlay .line.edit').length === 1, undefined, kWait);
    const more = JSON.parse(fs.readFileSync(edits));
    more.features.push({ ...more.features[1], geometry: flattenGeoJson([at(-84.2, 36.2), at(-84.19, 36.2), at(-84.19, 36.21)], 400, 0).features[0].geometry });
    fs.writeFileSync(edits, JSON.stringify(more));
    process.kill(server.pid, 'SIGHUP');
    // The camera is still, and the new version has the same tiles.
    await page.waitForFunction(() => document.querySelectorAll('.overlay .line.edit').length === 2, undefined, kWait);
    await page.locator('#edits').uncheck();
    assert.equal(await page.locator('.overlay .line.edit').count(), 0);
  });

  it('are part of the ground below a line of sight', async () => {
    const { clearance, lowest } = await page.evaluate(async () => {
      const { access } = await import('/viewer/early.js');
      const corners = [-84.26, -84.24].map((longitude) => ({ longitude, latitude: 36.3 }));
      return access.sight(terrace.state.dataset, corners, { eye: 2, target: 2, refraction: 0.13 });
    });
    assert.ok(clearance > 1 && clearance <= 2 && Math.abs(lowest.height - 402) < 2, `${clearance} m, ${lowest.height} m: the flat ground is at 400 m`);
  });

  it('are drawn, downloaded, and taken by terrace', async () => {
    await page.locator('#tool-draft').click();
    await page.waitForFunction(() => terrace.state.draft?.isOpen, undefined, kWait);
    assert.ok(await page.locator('#draft-save').isDisabled(), 'three corners make a polygon');
    const places = [[350, 165], [590, 180], [440, 125]];  // below the horizon, beside the panels
    const devtools = await page.context().newCDPSession(page);
    const doubleClick = (x, y) => Promise.all([0, 0, 2, 2].map((aside, i) => devtools.send('Input.dispatchMouseEvent',
      { type: i % 2 ? 'mouseReleased' : 'mousePressed', x: x + aside, y, button: 'left', clickCount: 1 })));
    for (const [i, [x, y]] of places.entries()) {
      // A place is known where ground is drawn.
      await page.waitForFunction(() => !terrace.globe.loading && terrace.globe.drawn().tiles > 1, undefined, kWait);
      await doubleClick(x, y);
      await page.waitForFunction((count) => terrace.state.draft.corners.length >= count, i + 1, kWait);
      await page.waitForTimeout(300);
      assert.equal(await page.evaluate(() => terrace.state.draft.corners.length), i + 1, 'a double click sets one corner');
    }
    await page.evaluate(() => terrace.state.draft.add({ ...terrace.state.draft.corners.at(-1) }));
    assert.equal(await page.evaluate(() => terrace.state.draft.corners.length), places.length, 'nor is a corner set twice');
    const height = page.getByRole('spinbutton', { name: 'Height above the ellipsoid' });
    await height.fill('');
    assert.ok(await page.locator('#draft-save').isDisabled(), 'without a height');
    await height.fill('512.5');
    await page.locator('#draft-blend').fill('100001');
    assert.equal(await page.evaluate(() => terrace.state.draft.blend), 100000, 'the most that terrace takes');
    await page.locator('#draft-blend').fill('30');
    await page.waitForFunction(() => /Raises the ground by up to .* lowers it/.test(document.getElementById('draft-text').textContent), undefined, kWait);
    assert.ok(await page.evaluate(() => terrace.globe.scene.primitives.contains(terrace.state.draft.surface)));
    await assertAccessible(page, 'drawing an edit');
    const [download] = await Promise.all([page.waitForEvent('download'), page.locator('#draft-save').click()]);
    assert.equal(download.suggestedFilename(), 'hills-edits.geojson');
    const drawn = path.join(folder, 'drawn.geojson');
    await download.saveAs(drawn);
    const info = run('info', hills, '--edits', drawn);
    assert.equal(info.code, 0, info.err);
    assert.match(info.out, /edits\s+1: 1 flatten/);

    const other = await serve(hills, '--edits', drawn);
    const [ring] = JSON.parse(fs.readFileSync(drawn)).features[0].geometry.coordinates;
    const middle = [1, 0].map((axis) => ring.slice(0, 3).reduce((sum, corner) => sum + corner[axis], 0) / 3);
    const { results } = await json(`${other.url}/jacksboro/heights?locations=${middle}`);
    await other.stop();
    assert.equal(results[0].elevation, 512.5);
  });

  it('cannot be downloaded if terrace would refuse them', async () => {
    const draw = (places) => page.evaluate((corners) => {
      while (terrace.state.draft.corners.length > 0) terrace.state.draft.undo();
      return corners.map(([longitude, latitude]) => terrace.state.draft.add({ longitude, latitude, height: 400 })).at(-1);
    }, places);
    const says = (text) => page.waitForFunction((wanted) => document.getElementById('draft-text').textContent.includes(wanted), text, kWait);
    await draw([[-84.3, 36.3], [-84.2, 36.3], [-84.25, 36.3]]);
    await says('on one line');
    assert.ok(await page.locator('#draft-save').isDisabled());
    await draw([[-80, 36.3], [-79.9, 36.3], [-79.95, 36.4]]);
    await says('no heights there');
    assert.ok(await page.locator('#draft-save').isDisabled());
    await draw([[-84.3, 36.3], [-82, 36.3], [-82, 36.31], [-84.3, 36.31]]);
    await says('% of the area has no heights');
    assert.ok(await page.locator('#draft-save').isEnabled());
    await draw([[-84.3, 36.3], [-84.2, 36.3], [-84.25, 36.35]]);
    await says('Raises the ground');
  });

  it('stay drafts: undo, and the end of drawing', async () => {
    await page.evaluate(() => terrace.state.draft.add({ ...terrace.state.draft.corners[0], latitude: 36.2 }));
    await page.locator('#draft-undo').click();
    await page.locator('#draft-undo').click();
    await page.waitForFunction(() => !terrace.state.draft.surface && document.getElementById('draft-save').disabled, undefined, kWait);
    await page.locator('#draft-close').click();
    assert.equal(await page.locator('.overlay .line.draft, .overlay .marker').count(), 0);
    assert.deepEqual(page.wrongs, []);
  });
});
