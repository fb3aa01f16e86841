// Archives as another program reads them: the npm package pmtiles, which MapLibre uses. What it finds is what the server
// sends.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, describe, it } from 'node:test';
import zlib from 'node:zlib';
import { Compression, PMTiles, TileType } from 'pmtiles';
import { request, run, samples, serve } from './harness.mjs';

class FileSource {
  constructor(file) {
    this.file = file;
    this.data = fs.readFileSync(file);
  }
  getKey() {
    return this.file;
  }
  async getBytes(offset, length) {
    const part = this.data.subarray(offset, offset + length);
    return { data: part.buffer.slice(part.byteOffset, part.byteOffset + part.length) };
  }
}

describe('archives in other readers of PMTiles', () => {
  let scratch, server;
  const bake = (form, format, out) => {
    const done = run('bake', path.join(samples, 'jacksboro.tif'), '--form', form, '--format', format, '--levels', '0-11', '--out', out);
    assert.equal(done.code, 0, done.err);
  };
  before(async () => {
    scratch = fs.mkdtempSync(path.join(os.tmpdir(), 'terrace-pmtiles-'));
    bake('single', 'terrain', path.join(scratch, 'terrain.pmtiles'));
    bake('single', 'png', path.join(scratch, 'png.pmtiles'));
    bake('chunks', 'glb', path.join(scratch, 'glb'));
    server = await serve(path.join(samples, 'jacksboro.tif'));
  });
  after(async () => {
    await server.stop();
    fs.rmSync(scratch, { recursive: true });
  });

  it('terrain lies one level deeper, with layer.json as metadata', async () => {
    const tiles = new PMTiles(new FileSource(path.join(scratch, 'terrain.pmtiles')));
    const header = await tiles.getHeader();
    assert.equal(header.specVersion, 3);
    assert.equal(header.clustered, true);
    assert.equal(header.tileType, TileType.Unknown);
    assert.equal(header.tileCompression, Compression.Gzip);
    assert.deepEqual([header.minZoom, header.maxZoom], [1, 12]);
    const metadata = await tiles.getMetadata();
    assert.equal(metadata.format, 'quantized-mesh-1.0');
    assert.equal(metadata.media_type, 'application/vnd.quantized-mesh');
    let count = 0;
    for (const [z, ranges] of metadata.available.entries()) {
      for (const { startX, startY, endX, endY } of ranges) {
        for (let x = startX; x <= endX; x++) {
          for (let y = startY; y <= endY; y++, count++) {
            const found = await tiles.getZxy(z + 1, x, y); // decompressed
            const sent = await request(`${server.url}/jacksboro/${z}/${x}/${y}.terrain?extensions=octvertexnormals`, { headers: { 'accept-encoding': 'gzip' } });
            assert.equal(sent.status, 200);
            assert.deepEqual(Buffer.from(found.data), zlib.gunzipSync(sent.body), `${z}/${x}/${y}`);
          }
        }
      }
    }
    assert.equal(header.numAddressedTiles, count);
    assert.equal(await tiles.getZxy(12, 0, 0), undefined);
  });

  it('height tiles are XYZ tiles of type PNG', async () => {
    const tiles = new PMTiles(new FileSource(path.join(scratch, 'png.pmtiles')));
    const header = await tiles.getHeader();
    assert.equal(header.tileType, TileType.Png);
    assert.ok(header.minLon < header.maxLon && header.minLat < header.maxLat);
    assert.equal((await tiles.getMetadata()).encoding, 'mapbox');
    const manifest = (await tiles.getMetadata()).terrace;
    for (const [z, ranges] of manifest.available.entries()) {
      for (const [west, south, , ] of ranges) {
        const found = await tiles.getZxy(z, west, south);
        const sent = await request(`${server.url}/jacksboro/${z}/${west}/${south}.png`);
        assert.deepEqual(Buffer.from(found.data), sent.body, `${z}/${west}/${south}`);
      }
    }
  });

  it('units are files of their own', async () => {
    const manifest = JSON.parse(fs.readFileSync(path.join(scratch, 'glb/manifest.json')));
    for (const unit of manifest.units.filter(({ tiles }) => tiles > 0)) {
      const file = path.join(scratch, 'glb', unit.name === 'top' ? 'top.pmtiles' : `units/${unit.name}.pmtiles`);
      const tiles = new PMTiles(new FileSource(file));
      const header = await tiles.getHeader();
      assert.equal(header.numAddressedTiles, unit.tiles);
      assert.equal((await tiles.getMetadata()).terrace.key, unit.key);
      if (unit.name === 'top') continue;
      const [z, x, y] = unit.name.split('-').map(Number);
      const sent = await request(`${server.url}/jacksboro/${z}/${x}/${y}.glb`);
      assert.deepEqual(Buffer.from((await tiles.getZxy(z + 1, x, y)).data), sent.body);
    }
  });
});
