// Makes the pictures of the viewer in docs/images again: the strip of the README, and those of docs/viewer.md that the
// list below names. Starts the server and a browser with a software renderer; needs `npm ci` in tests/e2e.
//
//   node tools/make_pictures.mjs BINARY DATA [NAME...]
//
// DATA: a folder with srtm3_N46E008_swiss_alps.tif and bluemarble_1920x960.tif, both in the public domain. NAME: only these
// pictures.
import { spawn } from 'node:child_process';
import fs from 'node:fs';
import { createRequire } from 'node:module';
import os from 'node:os';
import path from 'node:path';
import { fileURLToPath } from 'node:url';

const root = path.resolve(path.dirname(fileURLToPath(import.meta.url)), '..');
const { chromium } = createRequire(path.join(root, 'tests/e2e/package.json'))('playwright-core');
const images = path.join(root, 'docs/images');
const [binary, data, ...only] = process.argv.slice(2);
const kFlags = ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist',
                '--disable-background-networking', '--no-first-run'];
const kWait = { timeout: 580000, polling: 500 };

const source = (name) => path.join(data, name);
const datasets = [
  { name: 'earth', sources: [path.join(root, 'config/samples/etopo5.tif')] },
  { name: 'alps', sources: [source('srtm3_N46E008_swiss_alps.tif')], vertical: 'egm96' },
  { name: 'blue', sources: [path.join(root, 'config/samples/etopo5.tif')], imagery: { image: source('bluemarble_1920x960.tif') } },
];

const kAlps = 'camera=8.1,46.22,9500,38,-22';
const kEvening = `dataset=alps&fraction=0.5&${kAlps}&sun=2026-06-21T18:30`;
const profile = () => {
  terrace.state.measure.add({ longitude: 8.2, latitude: 46.4, height: 2000 });
  return terrace.state.measure.add({ longitude: 8.5, latitude: 46.6, height: 2000 });
};
const draft = () => {
  const corners = [[8.27, 46.33], [8.33, 46.315], [8.35, 46.355], [8.29, 46.37]];
  for (const [longitude, latitude] of corners) terrace.state.draft.add({ longitude, latitude, height: 2100 });
};

// `strip`: a part of the README's strip, without panels. `tool`: opened before `act` runs in the page.
const shots = [
  { name: 'globe', strip: true, view: 'dataset=earth&fraction=0.125' },
  { name: 'evening', strip: true, view: kEvening },
  { name: 'wireframe', strip: true, view: `dataset=alps&fraction=2&${kAlps}&wireframe` },
  { name: 'viewer-edit', view: `dataset=alps&fraction=1&${kAlps}`, tool: 'draft', act: draft },
  { name: 'viewer-imagery', view: 'dataset=blue&fraction=0.125&camera=80,8,1700000,8,-42&exaggeration=10&imagery' },
  { name: 'viewer-phone', view: 'dataset=alps&fraction=1', size: { width: 390, height: 844 }, phone: true, tool: 'distance', act: profile },
];

async function serve(folder) {
  const config = path.join(folder, 'terrace.json');
  fs.writeFileSync(config, JSON.stringify({ datasets }));
  const child = spawn(binary, ['serve', '--config', config, '--listen', '127.0.0.1:0'], { stdio: ['ignore', 'pipe', 'inherit'] });
  const url = await new Promise((resolve, reject) => {
    child.stdout.on('data', (text) => /http:\S+/.test(text) && resolve(/http:[^\s]+?(?=\/?\s)/.exec(text)[0]));
    child.on('exit', () => reject(new Error('the server has ended')));
  });
  return { url, stop: () => child.kill() };
}

async function take(browser, url, { name, view, size = { width: 800, height: 500 }, phone = false, strip = false, tool, act }) {
  const context = await browser.newContext({ viewport: strip ? { width: 560, height: 420 } : size, isMobile: phone, hasTouch: phone, colorScheme: 'dark' });
  const page = await context.newPage();
  await page.goto(`${url}/#${view}`);
  if (strip) await page.addStyleTag({ content: '#panel, #tools, #splitter { display: none !important; }' });
  await page.waitForFunction(() => window.terrace?.state.ready && terrace.globe.hasGround && !terrace.globe.loading, undefined, kWait);
  if (tool) {
    await page.locator(`#tool-${tool}`).click();
    await page.waitForFunction(() => terrace.state.measure?.mode || terrace.state.draft?.isOpen, undefined, kWait);
    await page.evaluate(act);
  }
  await page.waitForTimeout(4000);  // stars, air, labels
  await page.waitForFunction(() => !terrace.globe.loading, undefined, kWait);
  const shot = await page.screenshot({ type: strip ? 'png' : 'jpeg', quality: strip ? undefined : 80, timeout: 300000 });
  console.log(name, shot.length, 'bytes');
  await context.close();
  return shot;
}

// The pictures side by side, as JPEG.
async function join(browser, parts) {
  const page = await browser.newPage();
  const base64 = await page.evaluate(async (sources) => {
    const [width, height, gap] = [400, 300, 6];
    const canvas = Object.assign(document.createElement('canvas'), { width: sources.length * (width + gap) - gap, height });
    const context = canvas.getContext('2d');
    context.fillStyle = '#fff';
    context.fillRect(0, 0, canvas.width, height);
    context.imageSmoothingQuality = 'high';
    for (const [i, png] of sources.entries()) {
      const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${png}`)).blob());
      context.drawImage(image, i * (width + gap), 0, width, height);
    }
    return canvas.toDataURL('image/jpeg', 0.82).split(',')[1];
  }, parts.map((part) => part.toString('base64')));
  await page.close();
  return Buffer.from(base64, 'base64');
}

const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'pictures-'));
const server = await serve(folder);
const browser = await chromium.launch({ executablePath: process.env.TERRACE_CHROMIUM ?? '/usr/bin/chromium', args: kFlags });
const isWanted = (name) => only.length === 0 || only.includes(name);
try {
  if (isWanted('strip')) {
    const parts = [];
    for (const shot of shots.filter(({ strip }) => strip)) parts.push(await take(browser, server.url, shot));
    fs.writeFileSync(path.join(images, 'strip.jpg'), await join(browser, parts));
  }
  for (const shot of shots.filter(({ name, strip }) => !strip && isWanted(name))) {
    fs.writeFileSync(path.join(images, `${shot.name}.jpg`), await take(browser, server.url, shot));
  }
} finally {
  await browser.close();
  server.stop();
  fs.rmSync(folder, { recursive: true });
}
