// The start of the viewer: what it asks for and in which order, how many bytes, and that no frame is a white globe.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import path from 'node:path';
import { after, before, describe, it } from 'node:test';
import { fileURLToPath } from 'node:url';
import { end, launch } from './browser.mjs';
import { samples, serve } from './harness.mjs';

const kWait = { timeout: 90000, polling: 200 };
const kMaxBytes = 1_620_000;  // of the page without tiles, compressed
const viewer = path.resolve(path.dirname(fileURLToPath(import.meta.url)), '../../server/viewer');

// Files of the page that `file` imports statically, and those that these import.
function importsOf(file, found = new Set()) {
  const text = fs.readFileSync(path.join(viewer, file), 'utf8');
  for (const [, name] of text.matchAll(/^import[^;]*?"\/viewer\/([\w.]+\.js)";/gm)) {
    if (!found.has(name)) importsOf(name, found.add(name));
  }
  return found;
}

describe('the start of the viewer', () => {
  let server, browser;

  before(async () => {
    server = await serve('--config', path.join(samples, 'samples.json'));
    browser = await launch();
  });

  after(() => end(browser, server));

  const newPage = () => browser.newPage({ viewport: { width: 480, height: 300 }, colorScheme: 'dark' });
  const ground = (page) => page.waitForFunction(() => window.terrace?.globe.hasGround, undefined, kWait);

  it('names all its scripts in the first document', () => {
    const html = fs.readFileSync(path.join(viewer, 'index.html'), 'utf8');
    const named = [...html.matchAll(/modulepreload" href="\/viewer\/([\w.]+\.js)"/g)].map(([, name]) => name);
    assert.deepEqual(named.sort(), [...importsOf('app.js'), ...importsOf('main.js'), 'app.js', 'main.js']
      .filter((name, i, all) => all.indexOf(name) === i).sort());
  });

  it('asks for the first tiles before CesiumJS has arrived, and for each of them once', async () => {
    const page = await newPage();
    const asked = [];
    page.on('request', (request) => asked.push(request.url().replace(server.url, '').replace(/\?.*/, '')));
    const wanted = ['/earth/layer.json', '/earth/0/0/0.terrain', '/earth/0/1/0.terrain'];
    let release;
    const held = new Promise((resolve) => (release = resolve));
    await page.route('**/cesium/index.js', async (route) => {
      await held;
      await route.continue();
    });
    await page.goto(server.url, { waitUntil: 'commit' });
    for (let i = 0; i < 300 && !wanted.every((url) => asked.includes(url)); ++i) await page.waitForTimeout(100);
    assert.deepEqual(wanted.filter((url) => !asked.includes(url)), [], 'are not asked for');
    release();
    await ground(page);
    assert.deepEqual(wanted.map((url) => asked.filter((other) => other === url).length), [1, 1, 1]);
    await page.waitForFunction(() => terrace.traffic.tiles >= 2, undefined, kWait);  // they count
    await page.close();
  });

  // The server's list as it is while the datasets named in `pending` are being prepared.
  const prepare = async (page, pending) => {
    await page.route('**/datasets', async (route) => {
      const all = await (await route.fetch()).json();
      const datasets = all.datasets.filter(({ name }) => !(name in pending));
      const preparing = Object.entries(pending).map(([name, percent]) => ({ name, percent }));
      await route.fulfill({ json: { datasets, ...(preparing.length > 0 && { preparing }) } });
    });
  };
  const says = (page, text) => page.waitForFunction((wanted) => document.getElementById('message').textContent.includes(wanted), text, kWait);

  it('tells why there is nothing yet and how far the only datasets are, and begins by itself when they are there', async () => {
    const page = await newPage();
    const pending = { earth: 12, jacksboro: 0 };
    await prepare(page, pending);
    let list = { status: 503 };
    await page.route('**/datasets', (route) => (list ? route.fulfill(list) : route.fallback()));
    await page.goto(server.url, { waitUntil: 'commit' });
    await says(page, 'The list of datasets could not be read');
    list = { json: { datasets: [], more_with_token: true } };
    await page.getByText('The datasets of this server need a token.').waitFor(kWait);
    assert.equal(await page.locator('#message').isVisible(), false);
    list = undefined;
    await says(page, 'earth is being prepared: 12 %');
    pending.earth = 57;
    await says(page, 'earth is being prepared: 57 %. It is shown as soon as it is there.');
    delete pending.earth;
    await ground(page);
    assert.equal(await page.evaluate(() => terrace.state.dataset.name), 'earth');
    assert.equal(await page.locator('#message').isVisible(), false);
    assert.deepEqual(await page.locator('#dataset option').allTextContents(), ['earth', 'jacksboro (being prepared)']);
    assert.equal(await page.locator('#token-card').isVisible(), false);
    assert.equal(await page.evaluate(() => terrace.state.problems.length), 1, 'the first list');
    await page.close();
  });

  it('shows the dataset of its address as soon as that is there', async () => {
    const page = await newPage();
    const pending = { jacksboro: 42 };
    await prepare(page, pending);
    await page.goto(`${server.url}/#dataset=jacksboro`, { waitUntil: 'commit' });
    await says(page, 'jacksboro is being prepared: 42 %');
    assert.equal(await page.evaluate(() => terrace.state.dataset.name), 'earth', 'another one is shown meanwhile');
    delete pending.jacksboro;
    await page.waitForFunction(() => terrace.state.dataset.name === 'jacksboro' && terrace.globe.hasGround, undefined, kWait);
    assert.equal(await page.locator('#message').isVisible(), false);
    pending.jacksboro = 7;  // prepared anew
    await page.evaluate(() => document.dispatchEvent(new Event('visibilitychange')));
    await says(page, 'jacksboro is being prepared: 7 %');
    delete pending.jacksboro;
    await page.waitForFunction(() => document.getElementById('message').hidden, undefined, kWait);
    await page.close();
  });

  it('never shows a white globe, in few bytes', async () => {
    const page = await newPage();
    const devtools = await page.context().newCDPSession(page);
    const frames = [];
    devtools.on('Page.screencastFrame', ({ data, sessionId }) => {
      frames.push(data);
      devtools.send('Page.screencastFrameAck', { sessionId }).catch(() => {});
    });
    await devtools.send('Page.startScreencast', { format: 'png' });
    let release;
    const held = new Promise((resolve) => (release = resolve));
    await page.route('**/*.terrain*', (route) => held.then(() => route.continue()));
    await page.route('**/0/1/0.terrain*', async (route) => {  // half of the globe arrives later than the other half
      await held;
      await page.waitForTimeout(700);
      await route.continue();
    });
    await page.goto(server.url, { waitUntil: 'commit' });
    await page.waitForFunction(() => window.terrace?.globe.widget.useDefaultRenderLoop, undefined, kWait);
    await page.waitForTimeout(1500);  // frames without any tile
    release();
    await ground(page);
    await page.waitForTimeout(2000);
    await devtools.send('Page.stopScreencast');
    const whites = await page.evaluate((images) => Promise.all(images.map(async (base64) => {
      const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${base64}`)).blob());
      const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
      context.drawImage(image, 0, 0);
      const { data } = context.getImageData(0, 0, image.width, image.height);
      let white = 0;
      for (let i = 0; i < data.length; i += 4) white += Math.min(data[i], data[i + 1], data[i + 2]) > 225;
      return (4 * white) / data.length;
    })), frames);
    assert.ok(frames.length > 2, `${frames.length} frames`);
    assert.ok(Math.max(...whites) < 0.06, `a frame is ${(100 * Math.max(...whites)).toFixed(1)} % white`);
    const bytes = await page.evaluate(() => performance.getEntriesByType('resource').filter(({ name }) => name.includes('/viewer/'))
      .reduce((sum, { transferSize }) => sum + transferSize, performance.getEntriesByType('navigation')[0].transferSize));
    assert.ok(bytes > 1e6 && bytes < kMaxBytes, `${bytes} bytes`);
    await page.close();
  });
});
