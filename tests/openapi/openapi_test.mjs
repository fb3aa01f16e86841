// Compares /openapi.json with the real server: lints the document, sends each of its examples, and validates status,
// headers and body of each reply. Two linters: redocly and spectral.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, describe, it } from 'node:test';
import { fileURLToPath } from 'node:url';
import { promisify } from 'node:util';
import zlib from 'node:zlib';
import addFormats from 'ajv-formats';
import Ajv2020 from 'ajv/dist/2020.js';
import spectral from '@stoplight/spectral-core';
import rulesets from '@stoplight/spectral-rulesets';
import { samples, serve } from '../e2e/harness.mjs';

const folder = path.dirname(fileURLToPath(import.meta.url));
const manual = fs.readFileSync(path.join(folder, '../../docs/http-api.md'), 'utf8');

let server, scratch, text, spec, ajv;
const resolve = (node) => {
  if (!node?.$ref) return node;
  return node.$ref.slice(2).split('/').reduce((at, key) => at[key.replaceAll('~1', '/')], spec);
};
const operations = () =>
  Object.entries(spec.paths).flatMap(([pattern, item]) =>
    Object.entries(item).map(([method, operation]) => ({ pattern, method, operation })));
const queryParameters = (operation) =>
  operation.parameters.map(resolve).filter((parameter) => parameter.in === 'query' && parameter.name !== 'v');
const withParameter = (target, name, value) => {
  const [route, query = ''] = target.split('?');
  const kept = query.split('&').filter((piece) => piece && !piece.startsWith(`${name}=`));
  return `${route}?${[...kept, `${name}=${value}`].join('&')}`;
};
const encoded = (target) => target.replaceAll('|', '%7C');

// What is wrong with a reply, as a list of texts.
async function faults(operation, reply, target = '') {
  const wrong = [];
  const documented = resolve(operation.responses[reply.status]);
  if (!documented) return [`status ${reply.status} is not documented`];
  for (const [name, header] of Object.entries(documented.headers ?? {})) {
    const { schema } = resolve(header);
    const value = reply.headers.get(name);
    if (value === null) {
      const isOptional = ['Vary', 'Terrain-Origin'].includes(name) || (name === 'ETag' && /certify=|datum=orthometric|crs=(?!EPSG:4326)/.test(target));
      if (!isOptional) wrong.push(`no header ${name}`);
      continue;
    }
    const typed = ['number', 'integer'].includes(schema.type) ? Number(value) : value;
    if (!ajv.validate(schema, typed)) wrong.push(`header ${name}: ${value}: ${ajv.errorsText()}`);
  }
  for (const name of reply.headers.keys()) {
    const known = Object.keys(documented.headers ?? {}).map((header) => header.toLowerCase());
    if (name.startsWith('terrain-') && !known.includes(name)) wrong.push(`header ${name} is not documented`);
  }
  const type = reply.headers.get('content-type');
  const media = documented.content ?? {};
  const found = media[type] ?? media[type?.split(';')[0]] ?? media['*/*'];
  const body = Buffer.from(await reply.arrayBuffer());
  if (reply.status === 304) return body.length || type ? [...wrong, 'a body'] : wrong;
  if (!found) return [...wrong, `content type ${type} is not documented`];
  if (!/json/.test(type)) return wrong;
  if (!found.schema) return [...wrong, `no schema for ${type}`];
  const name = found.schema.$ref.split('/').pop();
  if (!ajv.validate(`https://terrace.test/openapi#/components/schemas/${name}`, JSON.parse(body))) wrong.push(ajv.errorsText());
  return wrong;
}

const send = (target, options) => fetch(server.url + encoded(target), options);
const sendExample = ({ target, type, body, base64 }) =>
  send(target, type && { method: 'POST', headers: { 'content-type': type }, body: body ?? Buffer.from(base64, 'base64') });

describe('/openapi.json', () => {
  before(async () => {
    // The samples, with a datum, so that heights above the geoid are known.
    const config = JSON.parse(fs.readFileSync(path.join(samples, 'samples.json'), 'utf8'));
    for (const dataset of config.datasets) {
      dataset.vertical = 'egm96';
      dataset.sources = dataset.sources.map((source) => path.join(samples, source));
    }
    scratch = fs.mkdtempSync(path.join(os.tmpdir(), 'openapi-'));
    // And with imagery: the heights as grey.
    const picture = path.join(scratch, 'picture.tif');
    await promisify(execFile)('gdal_translate', ['-q', '-ot', 'Byte', '-scale', '-b', '1', '-b', '1', '-b', '1', path.join(samples, 'jacksboro.tif'), picture]);
    config.datasets.find((dataset) => dataset.name === 'jacksboro').imagery = { image: picture };
    // And with an edit.
    const ring = [[-84.25, 36.3], [-84.24, 36.3], [-84.24, 36.31], [-84.25, 36.3]];
    fs.writeFileSync(path.join(scratch, 'edits.geojson'), JSON.stringify({ type: 'FeatureCollection', features: [
      { type: 'Feature', properties: { terrain: { op: 'flatten', height: 500, blend_m: 100 } }, geometry: { type: 'Polygon', coordinates: [ring] } }] }));
    config.datasets.find((dataset) => dataset.name === 'jacksboro').edits = path.join(scratch, 'edits.geojson');
    fs.writeFileSync(path.join(scratch, 'samples.json'), JSON.stringify(config));
    server = await serve('--config', path.join(scratch, 'samples.json'));
    text = await (await send('/openapi.json')).text();
    spec = JSON.parse(text);
    ajv = new Ajv2020({ strict: false, allErrors: true });
    addFormats(ajv);
    ajv.addSchema({ $id: 'https://terrace.test/openapi', components: { schemas: spec.components.schemas } });
  });
  after(async () => {
    fs.rmSync(scratch, { recursive: true });
    assert.deepEqual(await server?.stop(), { code: 0, signal: null });
  });

  it('is a document with an ETag, compressed where clients accept it', async () => {
    const first = await send('/openapi.json', { headers: { 'accept-encoding': 'gzip' } });
    assert.equal(first.headers.get('content-encoding'), 'gzip');
    assert.equal(first.headers.get('cache-control'), 'no-cache');
    assert.equal(await first.text(), text);
    const again = await send('/openapi.json', {
      headers: { 'accept-encoding': 'gzip', 'if-none-match': first.headers.get('etag') } });
    assert.deepEqual([again.status, await faults(spec.paths['/openapi.json'].get, again)], [304, []]);
    console.log(`${text.length} bytes, ${zlib.gzipSync(text).length} with gzip, ${operations().length} operations`);
  });

  it('has no finding of redocly', async () => {
    const file = path.join(scratch, 'openapi.json');
    fs.writeFileSync(file, text);
    const done = await promisify(execFile)(process.execPath, [
      path.join(folder, 'node_modules/@redocly/cli/bin/cli.js'), 'lint', file, '--format', 'json', '--config',
      path.join(folder, 'redocly.yaml')], {
      env: { ...process.env, REDOCLY_TELEMETRY: 'off', REDOCLY_SUPPRESS_UPDATE_NOTICE: 'true' } })
      .catch((error) => error);
    const { totals, problems } = JSON.parse(done.stdout);
    assert.deepEqual(problems.map((p) => `${p.ruleId} ${p.location?.[0]?.pointer} ${p.message}`), []);
    assert.deepEqual([totals.errors, totals.warnings], [0, 0]);
  });

  it('has no finding of spectral', async () => {
    const linter = new spectral.Spectral();
    // In OpenAPI 3.1 a licence has either an identifier or a URL; the authors have no page.
    linter.setRuleset({ extends: [[rulesets.oas, 'all']], rules: { 'license-url': 'off', 'contact-properties': 'off' } });
    const found = await linter.run(JSON.parse(text));
    assert.deepEqual(found.map((f) => `${f.code} ${f.path.join('/')} ${f.message}`), []);
  });

  it('describes every URL: with an operation, its placeholders, and an example of each parameter', () => {
    const wrong = [];
    for (const { pattern, method, operation } of operations()) {
      const name = `${method} ${pattern}`;
      if (!operation.operationId) wrong.push(`${name}: the row in server/routes.cc has no operation`);
      if (!operation['x-examples']?.length) wrong.push(`${name}: no example`);
      for (const parameter of operation.parameters.map(resolve)) {
        if (!parameter.description) wrong.push(`${name}: ${parameter.name} has no description`);
        if (method === 'get' && parameter.name !== 'v' && parameter.example === undefined) {
          wrong.push(`${name}: no example has ${parameter.name}`);
        }
      }
    }
    assert.deepEqual(wrong, []);
  });

  it('has the URLs of the manual, and those that /datasets names', async () => {
    const table = manual.split('\n## URLs')[1].split('\n\n')[1];
    const rows = [...table.matchAll(/^\| (`\/[^|]*) \|/gm)].flatMap((row) => row[1].match(/`[^`]+`/g));
    const listed = [];
    // "`/a/b.png`, `.webp`" and "`/a/hillshade/tiles.json`, and so `slope`" mean further URLs like the one before.
    for (const url of rows.map((row) => row.slice(1, -1).replace('/viewer/...', '/viewer/{file}'))) {
      const before = listed.at(-1);
      if (url.startsWith('.')) listed.push(before.replace(/\.\w+$/, url));
      else listed.push(url.startsWith('/') ? url : before.replace(/[^/]+(?=\/tiles.json$)/, url));
    }
    assert.deepEqual(Object.keys(spec.paths).sort(), listed.sort());
    const { datasets } = await (await send('/datasets')).json();
    const [{ name, urls }] = datasets;
    const named = Object.values(urls).map((url) => url.split('?')[0].replace(`/${name}/`, '/{dataset}/'));
    assert.deepEqual(named.filter((url) => !spec.paths[url]), []);
  });

  it('has the status codes of the manual', () => {
    const listed = new Set([...manual.matchAll(/^\| ([2-5]\d\d) \|/gm)].map((row) => row[1]));
    const documented = new Set(operations().flatMap(({ operation }) => Object.keys(operation.responses)));
    documented.add('204');  // OPTIONS has no operation
    assert.deepEqual([...documented].sort(), [...listed].sort());
  });

  it('describes the reply to each of its examples', async () => {
    const wrong = [];
    let count = 0;
    for (const { operation } of operations()) {
      for (const example of operation['x-examples']) {
        const reply = await sendExample(example);
        const found = await faults(operation, reply, example.target);
        if (reply.status !== 200) found.push(`status ${reply.status}`);
        wrong.push(...found.map((fault) => `${example.type ?? ''} ${example.target}: ${fault}`));
        ++count;
      }
    }
    assert.deepEqual(wrong, []);
    console.log(`${count} examples`);
  });

  // Of each enumeration every value, in the first example that has the parameter.
  it('describes the reply to each listed value, and no other value is accepted', async () => {
    const wrong = [];
    let count = 0;
    for (const { method, operation } of operations()) {
      if (method !== 'get') continue;
      for (const parameter of queryParameters(operation).filter((p) => p.schema.enum)) {
        const { target } = operation['x-examples'].find((e) => e.target.includes(`${parameter.name}=`));
        for (const value of parameter.schema.enum) {
          const changed = withParameter(target, parameter.name, value);
          const reply = await send(changed);
          const found = await faults(operation, reply, changed);
          if (reply.status !== 200) found.push(`status ${reply.status}`);
          wrong.push(...found.map((fault) => `${changed}: ${fault}`));
          ++count;
        }
        const refused = await send(withParameter(target, parameter.name, 'other'));
        const { detail } = await refused.json();
        const missing = parameter.schema.enum.filter((value) => !detail.includes(value));
        if (refused.status !== 400 || missing.length) wrong.push(`${parameter.name}=other: ${refused.status} ${detail}`);
        const more = detail.match(/must be (.*)/)?.[1].split(/,? or |, /) ?? [];
        const extra = more.filter((value) => !parameter.schema.enum.map(String).includes(value));
        if (extra.length) wrong.push(`${target}: ${parameter.name} has no ${extra}`);
      }
    }
    assert.deepEqual(wrong, []);
    console.log(`${count} values`);
  });

  // A refusal lists the parameters that the parser knows.
  it('lists the parameters that the server knows, and describes refusals', async () => {
    const wrong = [];
    for (const { pattern, method, operation } of operations()) {
      if (method !== 'get' || operation.tags[0] === 'viewer') continue;
      const { target } = operation['x-examples'][0];
      const reply = await send(withParameter(target, 'nosuch', '1'));
      const copy = reply.clone();
      wrong.push(...(await faults(operation, reply)).map((fault) => `${pattern}: ${fault}`));
      const { status, detail = '' } = await copy.json();
      if (status !== 400) wrong.push(`${pattern}?nosuch=1: ${status}`);
      const known = detail.match(/known are (.*)/)?.[1].match(/[a-z]+/g) ?? [];
      const words = ['and', 'with', 'surface', 'served'];
      const documented = queryParameters(operation).map((parameter) => parameter.name);
      const missing = known.filter((name) => !words.includes(name) && !documented.includes(name));
      if (missing.length) wrong.push(`${pattern}: ${missing} of the server's parameters are not documented`);
      if (documented.length && !known.length) wrong.push(`${pattern}: the refusal lists no parameters: ${detail}`);
    }
    assert.deepEqual(wrong, []);
  });

  it('describes other refusals: no such dataset, another method, a body of another type, a matching ETag', async () => {
    const layer = spec.paths['/{dataset}/layer.json'].get, heights = spec.paths['/{dataset}/heights'].post;
    const { headers } = await send('/jacksboro/layer.json');
    const cases = [
      [layer, 404, '/nope/layer.json', {}],
      [layer, 405, '/jacksboro/layer.json', { method: 'DELETE' }],
      [layer, 304, '/jacksboro/layer.json', { headers: { 'if-none-match': headers.get('etag') } }],
      [heights, 415, '/jacksboro/heights', { method: 'POST', headers: { 'content-type': 'text/csv' }, body: 'a' }],
      [heights, 413, '/jacksboro/heights', { method: 'POST', headers: { 'content-type': 'application/json' }, body: 'a'.repeat(2e6) }],
      [layer, 414, `/jacksboro/layer.json?v=${'1'.repeat(9000)}`, {}],
    ];
    for (const [operation, status, target, options] of cases) {
      const reply = await send(target, options);
      assert.deepEqual([reply.status, await faults(operation, reply)], [status, []], target.slice(0, 80));
    }
  });
});
