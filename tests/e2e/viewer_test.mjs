// The viewer in a real browser: what it draws, what its controls do, and that it connects only to the server.
// TERRACE_URL names a running server; otherwise TERRACE_BINARY is started with TERRACE_CONFIG.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, describe, it } from 'node:test';
import { assertAccessible } from './axe.mjs';
import { chromiumPath, end, hold, launch } from './browser.mjs';
import { samples, serve } from './harness.mjs';

// A software renderer draws a quarter of the pixels.
const kScale = 0.5;
const kSettleMs = 90000;  // a software renderer on a busy machine draws two frames a second
// Messages of Chromium about its graphics driver.
const kDriverTalk = /GL Driver Message|GPU stall|SwiftShader/i;

// Opens a page of the viewer and records all its errors.
async function openPage(browser, url, size = { width: 800, height: 500 }) {
  const page = await browser.newPage({ viewport: size, deviceScaleFactor: kScale });
  const origin = new URL(url).origin;
  page.wrongs = [];
  page.requested = [];
  page.on('console', (message) => {
    const grave = ['error', 'warning'].includes(message.type()) && !kDriverTalk.test(message.text());
    if (grave) page.wrongs.push(`console ${message.type()}: ${message.text()}`);
  });
  page.on('pageerror', (error) => page.wrongs.push(`exception: ${error}`));
  page.on('response', (response) => {
    if (response.status() >= 400) page.wrongs.push(`${response.status()} ${response.url()}`);
  });
  page.on('request', (request) => {
    page.requested.push(request.url());
    const local = /^(data|blob):/.test(request.url()) || new URL(request.url()).origin === origin;
    if (!local) page.wrongs.push(`another host: ${request.url()}`);
  });
  await page.goto(url);
  return page;
}

// Waits until nothing has been loading for a second, the still image of the last view is gone, and terrain is drawn.
async function settle(page) {
  await page.evaluate(() => (window.calmSince = undefined));
  await page.waitForFunction(() => {
    const busy = !window.terrace?.state.ready || terrace.globe.loading || terrace.globe.drawn().tiles < 2 ||
        document.querySelector('.curtain');
    if (busy) window.calmSince = undefined;
    else window.calmSince ??= performance.now();
    return !busy && performance.now() - window.calmSince > 1000;
  }, undefined, { timeout: kSettleMs, polling: 100 });
  return page.evaluate(() => terrace.globe.drawn());
}

// The view without the panel in coarse colours: 5 bits a channel, one number a pixel.
async function picture(page) {
  const png = (await page.screenshot({ clip: { x: 320, y: 0, width: 480, height: 500 } })).toString('base64');
  return page.evaluate(async (base64) => {
    const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${base64}`)).blob());
    const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, image.width, image.height);
    return Array.from({ length: data.length / 4 }, (_, i) =>
      ((data[4 * i] >> 3) << 10) | ((data[4 * i + 1] >> 3) << 5) | (data[4 * i + 2] >> 3));
  }, png);
}

const shareOfChanged = (a, b) => a.filter((colour, i) => colour !== b[i]).length / a.length;
const widthOf = ({ bounds: [west, , east] }) => (east >= west ? east - west : east - west + 360);

describe('the viewer', () => {
  let server, browser, page, url, regional, other;

  before(async () => {
    const config = process.env.TERRACE_CONFIG ?? path.join(samples, 'samples.json');
    if (!process.env.TERRACE_URL) server = await serve('--config', config);
    url = (process.env.TERRACE_URL ?? server.url).replace(/\/$/, '');
    const { datasets } = await (await fetch(`${url}/datasets`)).json();
    [regional, other] = [...datasets].sort((a, b) => widthOf(a) - widthOf(b));
    assert.ok(other, 'the test needs two datasets');
    assert.ok(fs.existsSync(chromiumPath), `${chromiumPath} is missing`);
    browser = await launch();
    page = await openPage(browser, `${url}/#dataset=${regional.name}`);
  });

  after(() => end(browser, server));

  it('draws terrain in many colours', async () => {
    const drawn = await settle(page);
    assert.ok(drawn.triangles > 100, `${drawn.triangles} triangles`);
    const colours = new Set(await picture(page)).size;
    assert.ok(colours > 150, `${colours} colours`);
    assert.match(await page.title(), new RegExp(regional.name));
    await page.evaluate(() => (document.getElementById('costs').open = true));
    assert.match(await page.locator('#stats').innerText(), /Triangles\s+[\d.]+/);
  });

  it('fetches finer meshes when the slider moves', async () => {
    const triangles = [];
    await page.locator('#fraction').focus();
    // The coarsest last: the tests below take half the time with it.
    for (const key of ['End', 'Home']) {
      await page.keyboard.press(key);
      const fraction = key === 'Home' ? 4 : 1 / 32;
      await page.waitForFunction((value) => terrace.state.fraction === value, fraction);
      await page.waitForTimeout(300);
      triangles.push((await settle(page)).triangles);
      const asked = `/layer.json?fraction=${fraction}`;
      assert.ok(page.requested.some((url) => url.includes(asked)), asked);
    }
    assert.ok(triangles[0] > 1.5 * triangles[1], `${triangles[0]} triangles, then ${triangles[1]}`);
  });

  for (const [name, least] of [['contours', 0.02], ['wireframe', 0.2]]) {
    it(`switches ${name} on and off`, async () => {
      const before = await picture(page);
      await page.locator(`#${name}`).check();
      await settle(page);
      const changed = shareOfChanged(before, await picture(page));
      assert.ok(changed > least, `${changed} of the pixels changed`);
      await page.locator(`#${name}`).uncheck();
      await settle(page);
      const left = shareOfChanged(before, await picture(page));
      assert.ok(left < 0.01, `${left} of the pixels stayed changed`);
    });
  }

  it('shows 3D Tiles to the right of a line', async () => {
    const before = await picture(page);
    await page.locator('#tiles3d').check();
    await page.waitForFunction(() => terrace.globe.tiles3d.drawn().tiles > 1, undefined, { timeout: kSettleMs });
    const mesh = await settle(page);
    const tiles = await page.evaluate(() => terrace.globe.tiles3d.drawn());
    assert.ok(tiles.triangles > mesh.withSkirts / 8 && tiles.triangles < mesh.withSkirts * 8, `${tiles.triangles} ${mesh.withSkirts}`);
    assert.ok(await page.evaluate(() => terrace.traffic.tiles3d.bytes > 1000));
    // Other triangles, but the same ground in the same colours.
    const after = await picture(page);
    const hue = (colour) => [colour >> 10, (colour >> 5) & 31, colour & 31];
    const far = after.filter((colour, i) => hue(colour).some((channel, k) => Math.abs(channel - hue(before[i])[k]) > 6));
    assert.ok(far.length / after.length < 0.1, `${far.length} of ${after.length} pixels are of another colour`);
    assert.match(await page.locator('#stats').innerText(), /Triangles, skirts too\s+[\d.]+K?\s+[\d.]+K?/);

    await page.locator('#splitter').focus();
    await page.keyboard.press('ArrowLeft');
    assert.equal(await page.evaluate(() => terrace.globe.split), 0.48);
    await page.waitForURL(/&tiles3d&split=0\.48/);

    // Slopes without exaggeration, on both sides; and a browser that has had enough changes of the address.
    const tried = await page.evaluate(() => {
      window.tried = 0;
      window.shader = terrace.globe.tiles3d.shader;
      history.replaceState = () => {
        window.tried += 1;
        throw new DOMException('Attempt to use history.replaceState() more than 100 times per 30 seconds', 'SecurityError');
      };
      const press = (key) => document.getElementById('splitter').dispatchEvent(new KeyboardEvent('keydown', { key }));
      for (let i = 0; i < 75; ++i) ['ArrowLeft', 'ArrowRight'].forEach(press);
      window.cameraBefore = terrace.globe.camera;
      terrace.globe.colouring = 'slope';
      terrace.globe.exaggeration = 10;
      terrace.globe.camera = [terrace.state.dataset.bounds[0] + 0.2, terrace.state.dataset.bounds[1] + 0.2, 30000, 0, -90];
      return window.tried;
    });
    assert.ok(tried < 5, `${tried} changes of the address at once`);
    await settle(page);
    const sloped = await picture(page);
    await page.locator('#tiles3d').uncheck();
    await settle(page);
    const steep = await picture(page);
    const other = sloped.filter((colour, i) => hue(colour).some((channel, k) => Math.abs(channel - hue(steep[i])[k]) > 6));
    assert.ok(other.length / steep.length < 0.1, `${other.length} of ${steep.length} pixels have another slope`);
    assert.ok(await page.evaluate(() => window.tried > 0 && terrace.globe.widget.useDefaultRenderLoop), 'it is still drawn');
    assert.ok(await page.evaluate(() => window.shader.isDestroyed()), 'the shader is destroyed with the tileset');
    assert.ok(await page.locator('#splitter').isHidden());
    assert.equal(await page.evaluate(() => terrace.globe.tiles3d.drawn().tiles), 0);
    await page.evaluate(() => {
      delete history.replaceState;
      terrace.globe.colouring = 'height';
      terrace.globe.exaggeration = 1;
      terrace.globe.camera = window.cameraBefore;
    });
    await settle(page);
  });

  it('tells position and height of a click', async () => {
    await page.mouse.click(520, 320);
    const readout = await page.locator('#readout').innerText();
    assert.match(readout, /^\d+\.\d+° [NS]\s+\d+\.\d+° [EW]\s+−?[\d,.]+ m(\s+·\s+data −?[\d,.]+ m)?$/);
    const { height } = await page.evaluate(() => terrace.state.picked);
    assert.ok(height > regional.heights.min - 500 && height < regional.heights.max + 500, `${height} m`);
  });

  it('is steered by keyboard', async () => {
    const camera = () => page.evaluate(() => terrace.globe.camera);
    await page.locator('#globe').focus();
    const [longitude, latitude, height, heading] = await camera();
    await page.keyboard.press('Shift+ArrowRight');
    assert.ok((await camera())[3] > heading + 3);
    await page.keyboard.press('Shift+ArrowLeft');
    await page.keyboard.press('ArrowUp');  // the first view looks to the north-east
    const ahead = await camera();
    assert.ok(ahead[1] > latitude && ahead[0] > longitude, `${[longitude, latitude]} to ${ahead}`);
    await page.keyboard.press('+');
    assert.ok((await camera())[2] < height);
    await settle(page);
  });

  it('keeps the view in its address', async () => {
    await page.locator('#contours').check();
    const state = () => page.evaluate(() => {
      const place = terrace.globe.camera.slice(0, 3).map((value) => Number(value.toPrecision(5)));
      return [terrace.state.dataset.name, Number(terrace.state.fraction.toPrecision(6)), terrace.state.contours, ...place];
    });
    const before = await state();
    await page.waitForURL(/&contours/);
    await page.reload();
    await settle(page);
    assert.deepEqual(await state(), before);
  });

  it('flies to another dataset', async () => {
    const from = await page.evaluate(() => terrace.globe.camera);
    await page.mouse.click(520, 320);
    await page.waitForFunction(() => terrace.state.picked);
    await page.locator('#dataset').selectOption(other.name);
    await page.waitForTimeout(3000);
    const drawn = await settle(page);
    const to = await page.evaluate(() => terrace.globe.camera);
    assert.ok(Math.hypot(to[0] - from[0], to[1] - from[1], Math.log10(to[2] / from[2])) > 0.5, `${from} to ${to}`);
    assert.ok(drawn.tiles > 1 && page.requested.some((asked) => asked.includes(`/${other.name}/0/0/0.terrain`)));
    assert.ok(new Set(await picture(page)).size > 150);
    assert.equal(await page.evaluate(() => terrace.state.picked), undefined, 'a place of the other dataset');
    assert.equal((await page.locator('#readout').innerText()).trim(), '');
  });

  it('has raised no error and asked no other host', () => assert.deepEqual(page.wrongs, []));

  it('fits a phone', async () => {
    const phone = await openPage(browser, `${url}/#dataset=${regional.name}`, { width: 360, height: 640 });
    await settle(phone);
    await phone.locator('#panel > summary').click();
    const panel = await phone.locator('#panel').boundingBox();
    const inside = panel.x >= 0 && panel.x + panel.width <= 360 && panel.y >= 0 && panel.y + panel.height <= 640;
    assert.ok(inside, JSON.stringify(panel));
    await assertAccessible(phone, 'the panel on a phone');
    await phone.locator('#tool-distance').click();
    await phone.locator('#dock').waitFor();
    await assertAccessible(phone, 'measuring on a phone');
    assert.deepEqual(phone.wrongs, []);
    await phone.close();
  });

  it('says that a dataset is not there', async () => {
    const lost = await openPage(browser, `${url}/#dataset=nowhere`);
    await lost.locator('#message').waitFor({ timeout: kSettleMs });
    assert.match(await lost.locator('#message').innerText(), /no dataset nowhere on this server; this is /);
    await lost.waitForURL(/#dataset=(?!nowhere)\w+&fraction=[\d.]+&camera=/);  // what is shown
    await lost.close();
  });

  it('says in the page what failed', async () => {
    const broken = await browser.newPage();
    const says = (text) => broken.locator('#message').getByText(text).waitFor({ timeout: kSettleMs });
    for (const [file, status, text] of [['cesium/index.js', 404, 'it was built without CesiumJS'], ['early.js', 503, 'the server did not answer for all']]) {
      await broken.route(`**/viewer/${file}`, (route) => route.fulfill({ status, body: '' }));
      await broken.goto(url);
      await says(text);
      await broken.unroute(`**/viewer/${file}`);
    }
    await broken.route('**/datasets', (route) => route.fulfill({ status: 503, body: '' }));
    await broken.goto(url);
    await broken.locator('#message').waitFor();
    assert.match(await broken.locator('#message').innerText(), /503/);
    await broken.unroute('**/datasets');
    await broken.route('**/layer.json*', (route) => route.fulfill({ status: 404, body: '' }));
    await broken.reload();
    await broken.locator('#message').waitFor();
    assert.match(await broken.locator('#message').innerText(), /could not be loaded/);
    await broken.unroute('**/layer.json*');
    const problem = { status: 503, contentType: 'application/problem+json', body: '{"status":503,"detail":"the source is being replaced"}' };
    await broken.route('**/*.terrain*', (route) => route.fulfill(problem));
    await broken.reload();
    await broken.getByText(/^Tiles of \w+ cannot be read: the source is being replaced\. The page tries again\.$/).waitFor({ timeout: kSettleMs });

    await broken.route('**/datasets', (route) => route.fulfill({ status: 429, body: '' }));
    await says('The server answers 429.');
    const scale = await broken.evaluate(() => {
      window.devicePixelRatio = 4;  // on another screen
      dispatchEvent(new Event('resize'));
      terrace.globe.scene.canvas.getContext('webgl2').getExtension('WEBGL_lose_context').loseContext();
      return terrace.globe.widget.resolutionScale;
    });
    assert.equal(scale, 0.5, 'at most two pixels to the side');
    await says('The browser has dropped the picture. Reload the page.');
    await broken.unroute('**/datasets');
    await broken.evaluate(() => document.dispatchEvent(new Event('visibilitychange')));
    await broken.waitForResponse(/\/datasets$/);
    await broken.waitForTimeout(300);
    await says('The browser has dropped the picture. Reload the page.');
    await broken.close();
  });
});

// Starts a separate server with `config` and an address.
async function serveConfig(config) {
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'viewer-'));
  fs.writeFileSync(path.join(folder, 'terrace.json'), JSON.stringify(config));
  const server = await serve('--config', path.join(folder, 'terrace.json'));
  return { ...server, url: server.url.replace(/\/$/, ''), stop: () => server.stop().finally(() => fs.rmSync(folder, { recursive: true })) };
}

const earth = path.join(samples, 'etopo5.tif'), hills = path.join(samples, 'jacksboro.tif');

describe('a region of fine data on a globe', { skip: process.env.TERRACE_URL ? 'needs a server of its own' : false }, () => {
  let server, browser, page;

  before(async () => {
    server = await serveConfig({ datasets: [{ name: 'mosaic', sources: [hills, earth] }, { name: 'earth', sources: [earth] }] });
    browser = await launch();
    page = await openPage(browser, server.url);
  });

  after(() => end(browser, server));

  const camera = () => page.evaluate(() => terrace.globe.camera);

  it('is what the first view shows', async () => {
    await settle(page);
    const [longitude, latitude, height] = await camera();
    assert.ok(Math.hypot(longitude + 84.25, latitude - 36.3) < 0.5, `at ${longitude}, ${latitude}`);
    assert.ok(height > 2000 && height < 60000, `${height} m`);
    assert.ok(await page.evaluate(() => terrace.globe.drawn().deepest) > 9, 'the fine tiles are drawn');
  });

  it('is left for the whole globe, and found again', async () => {
    await page.locator('#whole').click();
    await page.waitForFunction(() => terrace.globe.camera[2] > 1e7, undefined, { timeout: kSettleMs });
    await page.locator('#home').click();
    await page.waitForFunction(() => terrace.globe.camera[2] < 60000, undefined, { timeout: kSettleMs });
    await page.locator('#dataset').selectOption('earth');
    await page.waitForFunction(() => terrace.globe.camera[2] > 1e7, undefined, { timeout: kSettleMs });
    assert.ok(await page.locator('#whole').isHidden(), 'all of this dataset is of one kind');
    await page.locator('#dataset').selectOption('mosaic');
    await page.waitForFunction(() => terrace.globe.camera[2] < 60000, undefined, { timeout: kSettleMs });
    assert.deepEqual(page.wrongs, []);
  });

  it('is found also if the list of datasets is read meanwhile, but not if the user steers', async () => {
    await page.locator('#whole').click();
    await page.waitForFunction(() => terrace.globe.camera[2] > 1e7 && terrace.globe.scene.tweens.length === 0, undefined, { timeout: kSettleMs });
    const heights = await hold(page, /\/mosaic\/heights/);
    await page.locator('#home').click();
    await heights.asked;
    await page.locator('#globe').press('ArrowLeft');
    await heights.release();
    assert.equal(await page.evaluate(() => terrace.globe.scene.tweens.length), 0, 'no flight');
    const listed = page.waitForResponse(/\/datasets$/, { timeout: kSettleMs });
    let isHeld = false;
    await page.route(/\/mosaic\/heights/, async (route) => {
      isHeld = true;
      await listed;
      await page.waitForTimeout(500);  // the page has the list now
      await route.continue();
    });
    await page.locator('#home').click();
    await page.waitForFunction(() => terrace.globe.camera[2] < 60000, undefined, { timeout: kSettleMs });
    assert.ok(isHeld, 'the page has asked for a height');
    await page.unroute(/\/mosaic\/heights/);
  });

  it('keeps nothing of an address that another one has overtaken', async () => {
    const heights = await hold(page, /\/mosaic\/heights/);
    await page.evaluate(() => (location.hash = '#dataset=mosaic&contours&colours=slope&sun=2026-06-21T18:30'));
    await heights.asked;
    await page.evaluate(() => (location.hash = '#dataset=earth'));
    await page.waitForFunction(() => terrace.globe.shownVersion === terrace.state.datasets.find(({ name }) => name === 'earth').version,
      undefined, { timeout: kSettleMs });
    await heights.release();
    const { dataset, contours, colouring, sun } = await page.evaluate(() => ({ ...terrace.state, dataset: terrace.state.dataset.name }));
    assert.deepEqual({ dataset, contours, colouring, sun }, { dataset: 'earth', contours: false, colouring: 'height', sun: undefined });
  });
});

describe('datasets that need a token', { skip: process.env.TERRACE_URL ? 'needs a server of its own' : false }, () => {
  const token = 'a-token-of-some-length';
  const tokens = [{ name: 'team', token }];
  const hidden = { name: 'hills', sources: [hills] };
  let browser, server;

  before(async () => {
    server = await serveConfig({ tokens, datasets: [{ name: 'earth', sources: [earth], public: true }, hidden] });
    browser = await launch();
  });

  after(() => end(browser, server));

  it('are asked for and shown', async () => {
    const page = await openPage(browser, `${server.url}/#dataset=hills&fraction=4`);
    const unauthorized = [];
    page.on('request', (request) => {
      const needs = new URL(request.url()).pathname.startsWith('/hills/');
      if (needs && request.headers().authorization !== `Bearer ${token}`) unauthorized.push(request.url());
    });
    await page.locator('#token-card').waitFor({ timeout: kSettleMs });
    assert.match(await page.locator('#token-reason').innerText(), /hills needs a token/);
    assert.ok(await page.locator('#token-cancel').isVisible(), 'there is something to see without');
    assert.match(page.url(), /#dataset=hills&fraction=4$/, 'a reload asks again');
    await assertAccessible(page, 'asking for a token');

    await page.locator('#token').fill('another-token-of-the-kind');
    await page.keyboard.press('Enter');
    await page.getByText('The server does not know this token.').waitFor({ timeout: kSettleMs });
    const old = await hold(page, '**/datasets');  // asked for without a token
    await page.evaluate(() => document.dispatchEvent(new Event('visibilitychange')));
    await old.asked;
    await page.locator('#token').fill(token);
    await page.keyboard.press('Enter');
    await page.waitForFunction(() => terrace.state.dataset.name === 'hills', undefined, { timeout: kSettleMs });
    await old.release();
    assert.deepEqual(await page.evaluate(() => terrace.state.datasets.map(({ name }) => name).sort()), ['earth', 'hills'], 'those of the last token');
    const drawn = await settle(page);
    assert.ok(drawn.deepest > 9 && await page.locator('#token-card').isHidden());
    await page.locator('#tiles3d').check();
    await page.waitForFunction(() => terrace.globe.tiles3d.drawn().tiles > 1, undefined, { timeout: kSettleMs });
    await page.locator('#tiles3d').uncheck();

    await page.reload();
    await settle(page);
    assert.equal(await page.evaluate(() => terrace.state.dataset.name), 'hills', 'the tab keeps the token');
    assert.deepEqual(unauthorized, []);
    assert.ok(!page.requested.some((url) => url.includes(token)), 'no URL holds the token');

    // After a start with other tokens.
    await page.route('**/datasets', (route) => (route.request().headers().authorization ? route.fulfill({ status: 401, json: {} }) : route.continue()));
    await page.getByText('The server does not know the token of this page any more.').waitFor({ timeout: kSettleMs });
    await page.locator('#token-cancel').click();
    await page.waitForFunction(() => terrace.state.datasets.map(({ name }) => name).join() === 'earth' && terrace.state.dataset.name === 'earth',
      undefined, { timeout: kSettleMs });
    await page.getByText('hills needs a token').waitFor({ timeout: kSettleMs });
    assert.equal(await page.evaluate(async () => (await import('/viewer/early.js')).access.token), '');
    await page.unroute('**/datasets');
    await page.locator('#token').fill(token);
    await page.keyboard.press('Enter');
    await page.waitForFunction(() => document.getElementById('token-card').hidden, undefined, { timeout: kSettleMs });
    assert.equal(await page.evaluate(() => document.activeElement.id), 'dataset');
    await page.close();
  });

  it('are told where there are no others', async () => {
    const closed = await serveConfig({ tokens, datasets: [hidden] });
    const page = await openPage(browser, closed.url);
    await page.locator('#token-card').waitFor({ timeout: kSettleMs });
    assert.match(await page.locator('#token-reason').innerText(), /datasets of this server need a token/);
    assert.ok(await page.locator('#token-cancel').isHidden(), 'there is nothing else to see');
    await page.locator('#home').click();
    assert.deepEqual(page.wrongs, []);
    await page.close();
    await closed.stop();
  });
});
