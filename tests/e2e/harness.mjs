// Starts the real binary on a free port and talks to it, for the end-to-end tests.
import { spawn, spawnSync } from 'node:child_process';
import http from 'node:http';
import os from 'node:os';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import zlib from 'node:zlib';

// A test must not write into the user's home, also if it is run by hand.
process.env.XDG_CACHE_HOME ??= path.join(os.tmpdir(), 'terrace-tests');

const root = path.resolve(path.dirname(fileURLToPath(import.meta.url)), '../..');
export const binary = process.env.TERRACE_BINARY ?? path.join(root, 'build/release/server/cli/terrace');
export const samples = path.join(root, 'config/samples');

// Runs the binary to its end.
export function run(...args) {
  const done = spawnSync(binary, args, { encoding: 'utf8', timeout: 60000 });
  return { code: done.status, out: done.stdout, err: done.stderr };
}

// Starts `terrace serve`, on a free port unless the arguments name one. `log()` returns what it has written to stderr.
export async function serve(...args) {
  const listen = args.includes('--listen') ? [] : ['--listen', '127.0.0.1:0'];
  const child = spawn(binary, ['serve', ...listen, ...args], { stdio: ['ignore', 'pipe', 'pipe'] });
  let out = '', err = '';
  child.stderr.on('data', (data) => (err += data));
  const exited = new Promise((resolve) => child.on('exit', (code, signal) => resolve({ code, signal })));
  const url = await new Promise((resolve, reject) => {
    child.stdout.on('data', (data) => {
      out += data;
      const ready = out.match(/at (http:\/\/[^\s/]+)\/?\s/);
      if (ready) resolve(ready[1]);
    });
    exited.then(({ code }) => reject(new Error(`terrace serve ended with ${code}: ${err}`)));
  });
  return {
    url,
    pid: child.pid,
    log: () => err,
    stop: async (signal = 'SIGTERM') => {
      child.kill(signal);
      return exited;
    },
  };
}

const agent = new http.Agent({ keepAlive: true, maxSockets: 256 });

// One request with exactly these headers, without node's Accept or Accept-Encoding.
export function request(url, { method = 'GET', headers = {} } = {}) {
  return new Promise((resolve, reject) => {
    const message = http.request(url, { method, headers, agent }, (response) => {
      const parts = [];
      response.on('data', (part) => parts.push(part));
      response.on('end', () => resolve({ status: response.statusCode, headers: response.headers, body: Buffer.concat(parts) }));
    });
    message.on('error', reject);
    message.end();
  });
}

export const json = async (url) => JSON.parse((await request(url)).body);
export const plain = (response) =>
  response.headers['content-encoding'] === 'gzip' ? zlib.gunzipSync(response.body) : response.body;

// The ids of the extensions after the mesh; throws unless the bytes end exactly at the end of the last one.
export function extensionIds(tile) {
  const vertices = tile.readUInt32LE(88);
  let at = 92 + 6 * vertices;
  at += 4 + tile.readUInt32LE(at) * 6;
  for (let edge = 0; edge < 4; edge++) at += 4 + tile.readUInt32LE(at) * 2;
  const ids = [];
  while (at < tile.length) {
    ids.push(tile[at]);
    at += 5 + tile.readUInt32LE(at + 1);
  }
  if (at !== tile.length) throw new Error(`the tile ends at ${tile.length}, its last extension at ${at}`);
  return ids;
}

// The value of a sample of /metrics, summed over the label sets that contain `labels`.
export async function metric(url, name, labels = '') {
  const text = (await request(`${url}/metrics`)).body.toString();
  let sum = 0, seen = false;
  for (const line of text.split('\n')) {
    if (!line.startsWith(name) || !line.includes(labels)) continue;
    if (!/^[{ ]/.test(line.slice(name.length))) continue;
    sum += Number(line.slice(line.lastIndexOf(' ')));
    seen = true;
  }
  if (!seen) throw new Error(`no metric ${name}{${labels}}`);
  return sum;
}
