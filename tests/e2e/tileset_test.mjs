// 3D Tiles of the sample data over HTTP: tileset.json and the subtrees have the tiles that layer.json lists, and all of
// them exist.
import assert from 'node:assert/strict';
import path from 'node:path';
import { after, before, describe, it } from 'node:test';
import { json, plain, request, samples, serve } from './harness.mjs';

const fill = (template, level, x, y) => template.replace('{level}', level).replace('{x}', x).replace('{y}', y);

// A subtree as [level][index] -> available, parsed by the specification.
function readSubtree(file, levels) {
  assert.equal(file.toString('latin1', 0, 4), 'subt');
  const jsonBytes = Number(file.readBigUInt64LE(8)), binary = file.subarray(24 + jsonBytes);
  assert.equal(24 + jsonBytes + Number(file.readBigUInt64LE(16)), file.length);
  const tree = JSON.parse(file.subarray(24, 24 + jsonBytes));
  const bits = ({ constant, bitstream }) => (index) => {
    if (bitstream === undefined) return constant === 1;
    return ((binary[tree.bufferViews[bitstream].byteOffset + (index >> 3)] >> (index & 7)) & 1) === 1;
  };
  const tiles = bits(tree.tileAvailability), children = bits(tree.childSubtreeAvailability);
  assert.deepEqual(tree.contentAvailability, [tree.tileAvailability]);
  return (level, index) => (level < levels ? tiles((4 ** level - 1) / 3 + index) : children(index));
}

function* mortonOrder(level) {
  for (let index = 0; index < 4 ** level; index++) {
    let [x, y] = [0, 0];
    for (let bit = 0; bit < level; bit++) {
      x |= ((index >> (2 * bit)) & 1) << bit;
      y |= ((index >> (2 * bit + 1)) & 1) << bit;
    }
    yield [index, x, y];
  }
}

// Every tile of an implicit root as [z, x, y] on the globe, with its position under the root.
async function tilesOf(root, base) {
  const { subtreeLevels, availableLevels, subtrees } = root.implicitTiling;
  const [rz, rx, ry] = /3dtiles\/(\d+)-(\d+)-(\d+)\//.exec(subtrees.uri).slice(1).map(Number);
  const tiles = [], queue = [[0, 0, 0]];
  while (queue.length) {
    const [l, X, Y] = queue.pop();
    const answer = await request(new URL(fill(subtrees.uri, l, X, Y), base));
    assert.equal(answer.status, 200, `${l}/${X}/${Y}`);
    const available = readSubtree(answer.body, subtreeLevels);
    for (let down = 0; down <= subtreeLevels; down++) {
      for (const [index, x, y] of mortonOrder(down)) {
        if (!available(down, index)) continue;
        const place = [l + down, X * 2 ** down + x, Y * 2 ** down + y];
        assert.ok(place[0] < availableLevels, `${place}`);
        if (down === subtreeLevels) queue.push(place);
        else tiles.push({ place, key: [rz + place[0], rx * 2 ** place[0] + place[1], ry * 2 ** place[0] + place[2]].join('/') });
      }
    }
  }
  return tiles;
}

// The implicit roots, and the contents of the tiles above them.
const implicitRoots = (tile) => (tile.implicitTiling ? [tile] : tile.children.flatMap(implicitRoots));
const contentsAbove = (tile) => (tile.implicitTiling ? [] : [...(tile.content ? [tile.content.uri] : []), ...tile.children.flatMap(contentsAbove)]);
const rootsOf = ({ root }) => implicitRoots(root);

for (const dataset of ['jacksboro', 'earth']) {
  describe(`the 3D Tiles of ${dataset}`, () => {
    let server, base, tileset, layer;
    before(async () => {
      server = await serve('--config', path.join(samples, 'samples.json'));
      base = `${server.url}/${dataset}/tileset.json`;
      tileset = await json(base);
      layer = await json(`${server.url}/${dataset}/layer.json`);
    });
    after(async () => {
      assert.doesNotMatch(server.log(), /\[error\]|\[critical\]/i);
      assert.deepEqual(await server.stop(), { code: 0, signal: null });
    });

    it('are listed among the datasets', async () => {
      const { datasets } = await json(`${server.url}/datasets`);
      const { urls, version } = datasets.find(({ name }) => name === dataset);
      assert.equal(urls.tileset, `/${dataset}/tileset.json`);
      assert.equal(tileset.asset.tilesetVersion, version);
    });

    it('hold exactly the tiles that layer.json lists from their roots down', async () => {
      const roots = rootsOf(tileset);
      const above = contentsAbove(tileset.root).map((uri) => /3dtiles\/(\d+-\d+-\d+)\/0\/0\/0\.glb\?v=[0-9a-f]{12}$/.exec(uri)[1].replaceAll('-', '/'));
      const top = Math.min(...roots.map(({ content }) => Number(/3dtiles\/(\d+)-/.exec(content.uri)[1])), ...above.map((key) => Number(key.split('/')[0])));
      const listed = layer.available.flatMap((ranges, z) => (z < top ? [] : ranges.flatMap((r) => {
        const keys = [];
        for (let x = r.startX; x <= r.endX; x++) for (let y = r.startY; y <= r.endY; y++) keys.push(`${z}/${x}/${y}`);
        return keys;
      })));
      // Tiles of layer.json beside the roots exist only because a tile has four children.
      const tops = new Set(roots.map(({ content }) => /3dtiles\/(\d+-\d+-\d+)\//.exec(content.uri)[1].replaceAll('-', '/')).concat(above));
      const isUnder = (key) => {
        for (let [z, x, y] = key.split('/').map(Number); z >= top; [z, x, y] = [z - 1, x >> 1, y >> 1]) if (tops.has(`${z}/${x}/${y}`)) return true;
        return false;
      };
      const found = (await Promise.all(roots.map((root) => tilesOf(root, base)))).flat().map(({ key }) => key).concat(above);
      assert.deepEqual(found.sort(), listed.filter(isUnder).sort());
    });

    it('serve what they promise', async () => {
      for (const uri of contentsAbove(tileset.root)) {
        const glb = await request(new URL(uri, base));
        assert.equal(glb.status, 200, uri);
        assert.equal(glb.body.toString('latin1', 0, 4), 'glTF');
      }
      for (const root of rootsOf(tileset)) {
        const tiles = await tilesOf(root, base);
        const last = tiles.reduce((deepest, tile) => (tile.place[0] > deepest.place[0] ? tile : deepest));
        for (const { place } of [tiles[0], tiles.at(-1), last]) {
          const glb = await request(new URL(fill(root.content.uri, ...place), base));
          assert.equal(glb.status, 200, `${place}`);
          assert.equal(glb.headers['content-type'], 'model/gltf-binary');
          assert.equal(glb.body.toString('latin1', 0, 4), 'glTF');
        }
      }
    });

    it('are the tiles of the globe, under other numbers', async () => {
      const [root] = rootsOf(tileset);
      const { place, key } = (await tilesOf(root, base)).at(-1);
      const under = await request(new URL(fill(root.content.uri, ...place), base));
      const global = await request(`${server.url}/${dataset}/${key}.glb`);
      assert.ok(under.body.equals(global.body));
    });

    it('have nothing beyond', async () => {
      const [root] = rootsOf(tileset);
      const levels = root.implicitTiling.availableLevels;
      for (const template of [root.content.uri, root.implicitTiling.subtrees.uri]) {
        for (const place of [[levels, 0, 0], [0, 1, 0], [0, 0, 1], [99, 0, 0]]) {
          const answer = await request(new URL(fill(template, ...place), base));
          assert.equal(answer.status, 404, `${template} ${place}`);
          assert.match(answer.headers['content-type'], /problem\+json/);
          assert.equal(answer.headers['access-control-allow-origin'], '*');
        }
      }
    });

    it('are compressed, tagged and the same after a restart', async () => {
      const subtree = new URL(fill(rootsOf(tileset)[0].implicitTiling.subtrees.uri, 0, 0, 0), base);
      for (const url of [new URL(base), subtree]) {
        const bare = await request(url), zipped = await request(url, { headers: { 'Accept-Encoding': 'gzip' } });
        assert.ok(plain(zipped).equals(bare.body));
        assert.equal(bare.headers['cache-control'], url === subtree ? 'public, max-age=31536000, immutable' : 'no-cache');
        const again = await request(url, { headers: { 'If-None-Match': bare.headers.etag } });
        assert.equal(again.status, 304);
        const head = await request(url, { method: 'HEAD' });
        assert.equal(Number(head.headers['content-length']), bare.body.length);
        const other = await serve('--config', path.join(samples, 'samples.json'), '--worker-threads', '1');
        const same = await request(other.url + url.pathname);
        await other.stop();
        assert.equal(same.headers.etag, bare.headers.etag);
        assert.ok(same.body.equals(bare.body));
      }
    });

    it('carry request parameters down to the contents', async () => {
      const { uri } = rootsOf(await json(`${base}?error=20&compression=none`))[0].content;
      assert.match(uri, /\.glb\?v=[0-9a-f]{12}&error=20&atleast=1&compression=none$/);
      const glb = await request(new URL(fill(uri, 0, 0, 0), base));
      assert.equal(glb.status, 200);
      assert.doesNotMatch(glb.body.toString('latin1'), /KHR_draco/);
      // deck.gl appends the query of the tileset to URLs that already have a query.
      assert.equal((await request(new URL(`${fill(uri, 0, 0, 0)}&error=20&compression=none`, base))).status, 200);
      for (const query of ['error=0', 'compression=zip', 'colour=red', 'error=5&fraction=1']) {
        assert.equal((await request(`${base}?${query}`)).status, 400, query);
      }
    });
  });
}
