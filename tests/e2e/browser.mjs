// Chromium with a software renderer, for the tests of the viewer.
import fs from 'node:fs';
import { chromium } from 'playwright-core';

export const chromiumPath = process.env.TERRACE_CHROMIUM ?? '/usr/bin/chromium';
const kSoftwareRenderer = ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist',
                           '--disable-background-networking', '--no-first-run'];

export const launch = () => chromium.launch({ executablePath: chromiumPath, args: kSoftwareRenderer });
export const launchWithoutWebGl = () => chromium.launch({ executablePath: chromiumPath, args: ['--no-sandbox', '--disable-3d-apis'] });

// A browser with a page of a quarter of the pixels. `page.wrongs` has its exceptions.
export async function openBrowser(width, height, options = {}) {
  const browser = await launch();
  const page = await browser.newPage({ viewport: { width, height }, deviceScaleFactor: 0.5, ...options });
  page.wrongs = [];
  page.on('pageerror', (error) => page.wrongs.push(String(error)));
  return { browser, page };
}

// Holds the reply to the next request for `url`. `asked` resolves when the page has sent that request. `release()` lets the
// reply come from the server, or is given another one, and resolves when the page has had time to use it.
export async function hold(page, url) {
  let send, decide;
  const asked = new Promise((resolve) => (send = resolve));
  const decided = new Promise((resolve) => (decide = resolve));
  await page.route(url, async (route) => {
    send(route.request());
    const reply = await decided;
    await (reply ? route.fulfill(reply) : route.continue());
  }, { times: 1 });
  const release = async (reply) => {
    decide(reply);
    await (await asked).response();
    await page.waitForTimeout(300);
  };
  return { asked, release };
}

// Ends what a test has started, and removes its folder.
export async function end(browser, server, folder) {
  await browser?.close();
  await server?.stop();
  if (folder) fs.rmSync(folder, { recursive: true });
}
