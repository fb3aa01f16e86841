// Reads GLB tiles of the real binary as JavaScript clients do: with Khronos' validator, and with the decoders of
// CesiumJS and three.js.
import assert from 'node:assert/strict';
import { createRequire } from 'node:module';
import path from 'node:path';
import { after, before, describe, it } from 'node:test';
import { json, plain, request, samples, serve } from './harness.mjs';

const require = createRequire(import.meta.url);
const validator = require('gltf-validator');
const { MeshoptDecoder } = await import('meshoptimizer');
const draco = await require('draco3dgltf').createDecoderModule();
await MeshoptDecoder.ready;

const forms = ['draco', 'none', 'quantized', 'meshopt'];

function parse(bytes) {
  const length = bytes.readUInt32LE(12);
  return { gltf: JSON.parse(bytes.subarray(20, 20 + length)), buffer: bytes.subarray(28 + length) };
}

function decodeDraco({ gltf, buffer }, primitive) {
  const extension = primitive.extensions.KHR_draco_mesh_compression;
  const { byteOffset = 0, byteLength } = gltf.bufferViews[extension.bufferView];
  const bytes = new Int8Array(buffer.subarray(byteOffset, byteOffset + byteLength));
  const decoder = new draco.Decoder(), input = new draco.DecoderBuffer(), mesh = new draco.Mesh();
  input.Init(bytes, bytes.length);
  assert.ok(decoder.DecodeBufferToMesh(input, mesh).ok());
  const points = mesh.num_points(), triangles = mesh.num_faces();
  const attribute = decoder.GetAttributeByUniqueId(mesh, extension.attributes.POSITION);
  const floats = draco._malloc(12 * points);
  decoder.GetAttributeDataArrayForAllPoints(mesh, attribute, draco.DT_FLOAT32, 12 * points, floats);
  const position = new Float32Array(draco.HEAPF32.buffer, floats, 3 * points).slice();
  draco._free(floats);
  const indices = draco._malloc(12 * triangles);
  decoder.GetTrianglesUInt32Array(mesh, 12 * triangles, indices);
  const index = new Uint32Array(draco.HEAPF32.buffer, indices, 3 * triangles).slice();
  draco._free(indices);
  for (const object of [mesh, input, decoder]) draco.destroy(object);
  return { position, index };
}

function bytesOf({ gltf, buffer }, view) {
  const { byteOffset = 0, byteLength, extensions } = gltf.bufferViews[view];
  const packed = extensions?.EXT_meshopt_compression;
  if (!packed) return buffer.subarray(byteOffset, byteOffset + byteLength);
  const source = new Uint8Array(buffer.subarray(packed.byteOffset, packed.byteOffset + packed.byteLength));
  const target = new Uint8Array(packed.count * packed.byteStride);
  MeshoptDecoder.decodeGltfBuffer(target, packed.count, packed.byteStride, source, packed.mode, packed.filter);
  return Buffer.from(target);
}

function decodeArray(glb, number) {
  const accessor = glb.gltf.accessors[number], bytes = bytesOf(glb, accessor.bufferView);
  const columns = accessor.type === 'VEC3' ? 3 : 1, numbers = [];
  const [size, read] = { 5123: [2, 'readUInt16LE'], 5125: [4, 'readUInt32LE'], 5126: [4, 'readFloatLE'] }[accessor.componentType];
  const stride = glb.gltf.bufferViews[accessor.bufferView].byteStride ?? size * columns;
  for (let row = 0; row < accessor.count; row++) {
    for (let column = 0; column < columns; column++) numbers.push(bytes[read](row * stride + column * size));
  }
  return numbers;
}

// Triangles as sorted text of their corners in ECEF, equal for all compressions of a tile.
function decode(bytes) {
  const glb = parse(bytes), primitive = glb.gltf.meshes[0].primitives[0];
  const { position, index } = primitive.extensions?.KHR_draco_mesh_compression
    ? decodeDraco(glb, primitive)
    : { position: decodeArray(glb, primitive.attributes.POSITION), index: decodeArray(glb, primitive.indices) };
  const accessor = glb.gltf.accessors[primitive.attributes.POSITION], m = glb.gltf.nodes[0].matrix;
  assert.equal(position.length, 3 * accessor.count);
  assert.equal(index.length, glb.gltf.accessors[primitive.indices].count);
  const corners = [];
  const min = [Infinity, Infinity, Infinity], max = min.map((x) => -x);
  for (let k = 0; k < position.length; k += 3) {
    const p = [0, 1, 2].map((axis) => position[k + axis]);
    p.forEach((x, axis) => { min[axis] = Math.min(min[axis], x); max[axis] = Math.max(max[axis], x); });
    const [x, y, z] = [0, 1, 2].map((row) => m[row] * p[0] + m[4 + row] * p[1] + m[8 + row] * p[2] + m[12 + row]);
    corners.push(`${x},${-z},${y}`);
  }
  assert.deepEqual([accessor.min, accessor.max], [min, max]);
  const triangles = [];
  for (let k = 0; k < index.length; k += 3) {
    const c = [0, 1, 2].map((i) => corners[index[k + i]]), first = c.indexOf([...c].sort()[0]);
    triangles.push([0, 1, 2].map((i) => c[(first + i) % 3]).join(' '));
  }
  return { gltf: glb.gltf, triangles: triangles.sort() };
}

describe('GLB tiles', () => {
  let server;
  before(async () => { server = await serve('--config', path.join(samples, 'samples.json')); });
  after(async () => assert.deepEqual(await server.stop(), { code: 0, signal: null }));

  it('are valid, and decode to the same triangles in every form of one width', async () => {
    for (const [dataset, levels] of [['jacksboro', [0, 5, 9, 11, 13]], ['earth', [0, 1, 3, 5]]]) {
      const layer = await json(`${server.url}/${dataset}/layer.json`);
      for (const level of levels) {
        const { startX, startY, endX, endY } = layer.available[level][0];
        const tiles = new Set([`${startX}/${startY}`, `${(startX + endX) >> 1}/${(startY + endY) >> 1}`, `${endX}/${endY}`]);
        for (const tile of tiles) {
          const expected = {};  // for floats and for 16 bits
          for (const form of forms) {
            const url = `${server.url}/${dataset}/${level}/${tile}.glb?compression=${form}`;
            const reply = await request(url, { headers: { 'Accept-Encoding': 'gzip' } });
            assert.equal(reply.status, 200, url);
            assert.equal(reply.headers['content-type'], 'model/gltf-binary');
            assert.equal(reply.headers['content-encoding'], form === 'draco' ? undefined : 'gzip');
            const bytes = plain(reply);
            const { issues } = await validator.validateBytes(new Uint8Array(bytes));
            const serious = issues.messages.filter(({ severity }) => severity < 2);
            assert.deepEqual(serious, [], url);
            const { triangles } = decode(bytes), width = ['draco', 'none'].includes(form) ? 'float' : 'short';
            expected[width] ??= triangles;
            assert.deepEqual(triangles, expected[width], url);
          }
        }
      }
    }
  });

  it('take the parameters of .terrain and one of their own', async () => {
    const url = `${server.url}/jacksboro/9/271/359`;
    const reply = await request(`${url}.glb?error=20`);
    assert.ok(Number(reply.headers['terrain-max-error']) <= 20);
    assert.match(reply.headers['server-timing'], /encode;dur=/);
    assert.equal(decode(reply.body).gltf.asset.generator.split(' ')[0], 'terrace');
    const again = await request(`${url}.glb?error=20`, { headers: { 'If-None-Match': reply.headers.etag } });
    assert.equal(again.status, 304);
    const other = await request(`${url}.glb?error=20&compression=meshopt`);
    assert.notEqual(other.headers.etag, reply.headers.etag);
    for (const wrong of ['.glb?compression=zip', '.terrain?compression=draco', '.glb?error=0']) {
      const refused = await request(url + wrong);
      assert.equal(refused.status, 400, wrong);
      assert.match(refused.headers['content-type'], /^application\/problem\+json/);
    }
    assert.equal((await request(`${server.url}/jacksboro/9/0/0.glb`)).status, 404);
  });
});
