// The dataset's image in the viewer: on the globe, and on the flat map, with contours.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, describe, it } from 'node:test';
import { assertAccessible } from './axe.mjs';
import { end, launch, launchWithoutWebGl } from './browser.mjs';
import { samples, serve } from './harness.mjs';

const kWait = { timeout: 120000, polling: 200 };
const hills = path.join(samples, 'jacksboro.tif');
const hasGdal = (() => {
  try {
    return Boolean(execFileSync('gdal_translate', ['--version']));
  } catch {
    return false;
  }
})();

describe('imagery in the viewer', { skip: hasGdal ? false : 'needs gdal-bin' }, () => {
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'viewer-imagery-'));
  const config = path.join(folder, 'terrace.json');
  let server, browser;

  before(async () => {
    // Magenta, a colour that no height has.
    const image = path.join(folder, 'magenta.tif');
    execFileSync('gdal_translate', ['-q', '-ot', 'Byte', '-b', '1', '-b', '1', '-b', '1', '-scale_1', '0', '9999', '255', '255',
                                    '-scale_2', '0', '9999', '0', '0', '-scale_3', '0', '9999', '255', '255', '-colorinterp', 'red,green,blue',
                                    '-a_nodata', 'none', hills, image]);
    fs.writeFileSync(config, JSON.stringify({ datasets: [{ name: 'hills', sources: [hills], attribution: 'A &amp; <a href="https://example.org">B</a>',
                                                          imagery: { image, attribution: 'C' } }] }));
    server = await serve('--config', config);
    browser = await launch();
  });

  after(() => end(browser, server, folder));

  // The share of magenta in the right part of the window.
  async function shareOfMagenta(page) {
    const png = (await page.screenshot({ clip: { x: 320, y: 100, width: 250, height: 250 }, timeout: 120000 })).toString('base64');
    return page.evaluate(async (base64) => {
      const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${base64}`)).blob());
      const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
      context.drawImage(image, 0, 0);
      const { data } = context.getImageData(0, 0, image.width, image.height);
      let found = 0;
      for (let i = 0; i < data.length; i += 4) found += Math.min(data[i], data[i + 2]) > 1.5 * data[i + 1] + 30;
      return (4 * found) / data.length;
    }, png);
  }

  it('lies on the globe, shaded, while the switch is on', async () => {
    const page = await browser.newPage({ viewport: { width: 640, height: 400 }, colorScheme: 'dark' });
    const asked = [];
    page.on('request', (request) => asked.push(new URL(request.url()).pathname));
    await page.goto(`${server.url}/#dataset=hills&fraction=4&imagery`);
    const settled = () => page.waitForFunction(() => window.terrace?.state.ready && !terrace.globe.loading && terrace.globe.hasGround &&
      terrace.globe.scene.imageryLayers.length === Number(terrace.state.imagery), undefined, kWait);
    await settled();
    for (let i = 0; i < 60 && await shareOfMagenta(page) < 0.3; ++i) await page.waitForTimeout(1000);
    assert.ok(await shareOfMagenta(page) > 0.3, `${await shareOfMagenta(page)}`);
    assert.ok(asked.some((url) => /^\/hills\/imagery\/geodetic\/\d+\/\d+\/\d+\.webp$/.test(url)), asked.join(' '));
    await assertAccessible(page, 'layers');
    assert.equal(await page.locator('#attribution').textContent(), 'A & B · C · drawn with CesiumJS');
    const boxes = await page.evaluate(async () => {
      const { addImagery } = await import('/viewer/imagery.js');
      const layers = [];
      const scene = { imageryLayers: { addImageryProvider: (layer) => layers.push(layer) } };
      addImagery(scene, '/x/{z}/{x}/{y}.webp', { bounds: [179, -17, -179, -16], geodetic_max_level: 3 }, {}, () => {});
      return layers.map(({ rectangle: { west, east } }) => [west, east].map((angle) => Math.round((angle * 180) / Math.PI)));
    });
    assert.deepEqual(boxes, [[179, 180], [-180, -179]], 'both sides of 180 degrees');
    await page.locator('#imagery').uncheck();
    await settled();
    for (let i = 0; i < 60 && await shareOfMagenta(page) > 0; ++i) await page.waitForTimeout(500);
    assert.equal(await shareOfMagenta(page), 0);
    await page.waitForURL((url) => !/imagery/.test(url.hash));
    await page.close();
  });

  it('lies on the flat map, which has contours too', async (test) => {
    const plain = await launchWithoutWebGl();
    test.after(() => plain.close());
    const page = await plain.newPage({ viewport: { width: 640, height: 400 } });
    await page.goto(server.url);
    await page.locator('#globe canvas').waitFor(kWait);
    assert.ok(await page.locator('#imagery').isVisible());
    assert.ok(await page.locator('#wireframe').isHidden());
    assert.equal(await page.locator('#attribution').textContent(), 'A & B · C');
    const pixels = () => page.evaluate(() => {
      const canvas = document.querySelector('#globe canvas');
      return Array.from(new Uint32Array(canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.buffer));
    });
    const drawn = () => page.waitForFunction(() => {
      const canvas = document.querySelector('#globe canvas');
      return new Set(new Uint32Array(canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.buffer)).size > 300;
    }, undefined, kWait);
    const isMagenta = (pixel) => (pixel & 255) > 1.5 * ((pixel >> 8) & 255) + 30 && ((pixel >> 16) & 255) > 1.5 * ((pixel >> 8) & 255) + 30;
    await drawn();
    // Until nothing changes any more: on a slow machine some tiles come late.
    let before = await pixels();
    for (let last = []; before.some((pixel, i) => pixel !== last[i]); before = await pixels()) {
      last = before;
      await page.waitForTimeout(1000);
    }
    assert.ok(!before.some(isMagenta));
    await page.locator('#contours').check();
    // Until all tiles are drawn again, most pixels differ.
    const share = async () => (await pixels()).filter((pixel, i) => pixel !== before[i]).length / before.length;
    let changed = await share();
    for (let i = 0; i < 60 && !(changed > 0.01 && changed < 0.4); ++i, changed = await share()) await page.waitForTimeout(500);
    assert.ok(changed > 0.01 && changed < 0.4, `${changed} of the pixels are lines`);
    await page.locator('#imagery').check();
    for (let i = 0; i < 30 && !(await pixels()).some(isMagenta); ++i) await page.waitForTimeout(500);
    assert.ok((await pixels()).filter(isMagenta).length > 5000);
  });
});
