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

// Ends what a test has started, and removes its folder.
export async function end(browser, server, folder) {
  await browser?.close();
  await server?.stop();
  if (folder) fs.rmSync(folder, { recursive: true });
}
