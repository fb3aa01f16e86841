// The pages of examples/ for the tests: a browser, a file server, and their libraries from node_modules in place of the CDN.
import fs from 'node:fs';
import http from 'node:http';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from '../e2e/node_modules/playwright-core/index.mjs';

const kHere = path.dirname(fileURLToPath(import.meta.url));
const kModules = [path.join(kHere, 'node_modules'), path.join(kHere, '../../server/viewer/node_modules')];
const kTypes = { '.js': 'text/javascript', '.css': 'text/css', '.json': 'application/json', '.html': 'text/html' };
const kCdn = 'https://cdn.jsdelivr.net/npm/';
export const kExamples = path.join(kHere, '../../examples');
export const kSize = { width: 330, height: 220 };
export const kSettleMs = 40000;
export const typeOf = (file) => kTypes[path.extname(file)] ?? 'application/octet-stream';

export const launchBrowser = () => chromium.launch({
  executablePath: process.env.TERRACE_CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist',
         '--disable-background-networking', '--no-first-run'],
});

// The file of node_modules that a URL of the CDN names; its version has to be the installed one.
export function fileOf(url) {
  const [, name, version, file] = url.match(/^https:\/\/cdn\.jsdelivr\.net\/npm\/((?:@[^/]+\/)?[^@/]+)@([\d.]+)\/([^?#]+)/) ?? [];
  const folder = name && kModules.map((modules) => path.join(modules, name)).find((folder) => fs.existsSync(folder));
  if (!folder || JSON.parse(fs.readFileSync(path.join(folder, 'package.json'))).version !== version) return undefined;
  return fs.existsSync(path.join(folder, file)) ? path.join(folder, file) : undefined;
}

// Serves examples/. With `libraries`, it serves them, too, and pages load them from here: the browser's cache is at work then,
// which a route of Playwright's turns off.
export async function servePages({ libraries = false } = {}) {
  const files = http.createServer((asked, reply) => {
    const { pathname } = new URL(asked.url, 'http://host');
    const npm = libraries && pathname.startsWith('/npm/');
    const file = npm ? fileOf(kCdn + pathname.slice('/npm/'.length)) : path.join(kExamples, path.basename(pathname));
    if (!file || !fs.existsSync(file)) return reply.writeHead(404).end();
    reply.writeHead(200, { 'Content-Type': typeOf(file), 'Cache-Control': npm ? 'max-age=3600' : 'no-cache' });
    const body = fs.readFileSync(file);
    reply.end(libraries && !npm ? body.toString().replaceAll(kCdn, '/npm/') : body);
  });
  await new Promise((resolve) => files.listen(0, '127.0.0.1', resolve));
  return {
    url: `http://127.0.0.1:${files.address().port}`,
    stop: () => new Promise((resolve) => { files.close(resolve); files.closeAllConnections(); }),
  };
}

// Waits until `ready`, an expression of the page, has been true for `calmMs`.
export async function settle(page, ready, calmMs = 500) {
  await page.evaluate(() => { window.calmSince = undefined; });
  await page.waitForFunction(([expression, least]) => {
    const fine = !document.getElementById('line').textContent.startsWith('Loading') && (0, eval)(expression);
    window.calmSince = fine ? window.calmSince ?? performance.now() : undefined;
    return fine && performance.now() - window.calmSince >= least;
  }, [ready, calmMs], { timeout: kSettleMs, polling: 100 }).catch(async (error) => {
    throw new Error(`${error.message.split('\n')[0]}: ${await page.locator('#line').innerText()} ${page.wrongs.join('; ')}`);
  });
}

// The picture below the line: a number of 32 bits for each pixel, red in the lowest byte.
export async function pixels(page) {
  const clip = { x: 0, y: 80, width: kSize.width, height: kSize.height - 80 };
  const png = (await page.screenshot({ clip, timeout: kSettleMs })).toString('base64');
  return page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
    const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
    context.drawImage(image, 0, 0);
    return Array.from(new Uint32Array(context.getImageData(0, 0, image.width, image.height).data.buffer));
  }, png);
}
