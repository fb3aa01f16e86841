// Shows the dataset's 3D Tiles to the right of a line on the screen, in the scene of the terrain and with its material,
// so that both can be compared. Both refine at the same distance: the tileset's geometric errors are eight times the
// level errors that CesiumJS assumes for terrain, and so is the tolerance set here.
import {
  Cartesian2, Cartesian3, Cartesian4, Cesium3DTileset, CustomShader, LightingModel, SplitDirection, TextureUniform,
  UniformType,
} from "/viewer/cesium/index.js";
import { kLook, kRampWidth } from "/viewer/material.js";
import { Turns } from "/viewer/turns.js";

const kErrorRatio = 8;
const kTexels = 4 * kRampWidth;

// Heights are computed from the ellipsoid's equation f = 1, relative to the camera, because an Earth-centred position
// in 32-bit floats is exact only to half a metre.
const kFragment = /* glsl */ `
${kLook}
void fragmentMain(FragmentInput fsInput, inout czm_modelMaterial material) {
  vec3 positionEC = fsInput.attributes.positionEC;
  vec3 fromCamera = czm_inverseViewRotation * positionEC;
  vec3 camera = czm_viewerPositionWC / kRadii;
  vec3 offset = fromCamera / kRadii;
  float f = cameraLevel + dot(offset, 2.0 * camera + offset);
  float height = f / (sqrt(1.0 + f) + 1.0) * sqrt(1.0 + f) / length((camera + offset) / kRadii);
  // CesiumJS exaggerates the normals of terrain, but not those of models.
  vec3 up = czm_viewRotation * normalize((camera + offset) / kRadii);
  vec3 normal = normalize(fsInput.attributes.normalEC);
  normal = normalize(mix(dot(normal, up) * up, normal, exaggeration));
  vec3 colour = terrainColour(height / exaggeration, -positionEC, normal, true,
                              draped > 0.5 ? czm_linearToSrgb(material.diffuse) : vec3(-1.0));
  material.diffuse = czm_srgbToLinear(colour);
}`;

const kTypes = {
  heightRange: UniformType.VEC2, box: UniformType.VEC4, water: UniformType.FLOAT, contourInterval: UniformType.FLOAT,
  relief: UniformType.FLOAT, shading: UniformType.FLOAT, graticule: UniformType.FLOAT, farness: UniformType.FLOAT,
  hazeDistance: UniformType.FLOAT, wire: UniformType.FLOAT, split: UniformType.FLOAT, paper: UniformType.FLOAT,
  exaggeration: UniformType.FLOAT, colouring: UniformType.FLOAT, draped: UniformType.FLOAT, sunny: UniformType.FLOAT, sun: UniformType.VEC3,
};
const kStrips = ["ramp", "theme"];

function valueFor(type, value) {
  if (type === UniformType.VEC3) return Cartesian3.fromElements(value.x, value.y, value.z);
  if (type === UniformType.VEC2) return Cartesian2.fromElements(value.x, value.y);
  if (type === UniformType.VEC4) return Cartesian4.fromElements(value.x, value.y, value.z, value.w);
  return value;
}

function makeShader() {
  const uniforms = {
    cameraLevel: { type: UniformType.FLOAT, value: 0 },
  };
  for (const name of kStrips) {
    const value = new TextureUniform({ typedArray: new Uint8Array(kTexels), width: kRampWidth, height: 1 });
    uniforms[name] = { type: UniformType.SAMPLER_2D, value };
  }
  for (const [name, type] of Object.entries(kTypes)) {
    uniforms[name] = { type, value: valueFor(type, { x: 0, y: 1, z: 0, w: 0 }) };
    if (type === UniformType.FLOAT) uniforms[name].value = 0;
  }
  return new CustomShader({ lightingModel: LightingModel.UNLIT, uniforms, fragmentShaderText: kFragment });
}

export class Tiles3d {
  #shows = new Turns();  // only the tileset of the latest show() or hide() may enter the scene

  // `material`: the terrain's; the tiles use its uniforms in every frame.
  constructor(scene, material) {
    Object.assign(this, { scene, strips: material.strips, look: material.uniforms, tileset: undefined, pending: false, wireframe: false });
    scene.preUpdate.addEventListener(() => this.tileset && this.#follow());
  }

  // `resource`: tileset.json. If it cannot be read, throws the exception of CesiumJS. `onError` gets a sentence for
  // each tile that fails.
  async show(resource, onError) {
    const isLatest = this.#shows.begin();
    this.pending = true;
    try {
      const tileset = await Cesium3DTileset.fromUrl(resource, {
        splitDirection: SplitDirection.RIGHT, enableDebugWireframe: true, shadows: 0,
      });
      if (!isLatest()) return tileset.destroy();
      this.#remove();
      tileset.tileFailed.addEventListener(({ message, url: tile }) => onError(`${tile} failed: ${message}`));
      tileset.customShader = this.shader = makeShader();
      this.tileset = this.scene.primitives.add(tileset);
      this.copied = {};
      this.#follow();
    } finally {
      if (isLatest()) this.pending = false;
    }
  }

  hide() {
    this.#shows.begin();
    this.pending = false;
    this.#remove();
  }

  #remove() {
    if (this.tileset) {
      this.scene.primitives.remove(this.tileset);  // which destroys it, but not its shader
      this.shader.destroy();
    }
    this.tileset = undefined;
    this.scene.requestRender();
  }

  get loading() {
    return this.pending || (this.tileset !== undefined && !this.tileset.tilesLoaded);
  }

  // Statistics of the current frame, including skirts, which GLB tiles contain. `keys` are "root/level/x/y".
  drawn() {
    const sum = { tiles: 0, triangles: 0, keys: [] };
    for (const { content } of this.tileset?._selectedTiles ?? []) {
      const key = /3dtiles\/(\S+)\.glb/.exec(content.url)?.[1];
      if (!key) continue;
      sum.tiles += 1;
      sum.triangles += content.trianglesLength;
      sum.keys.push(key);
    }
    return sum;
  }

  // Copies a strip of colours where the terrain's material has a new one.
  #copyStrip(name) {
    const canvas = this.strips[name];
    if (!canvas || this.copied[name] === canvas) return;
    this.copied[name] = canvas;
    const pixels = canvas.getContext("2d").getImageData(0, 0, kRampWidth, 1).data;
    const typedArray = new Uint8Array(pixels.buffer);
    this.shader.setUniform(name, new TextureUniform({ typedArray, width: kRampWidth, height: 1 }));
  }

  #follow() {
    const { camera, ellipsoid, globe } = this.scene;
    this.tileset.maximumScreenSpaceError = kErrorRatio * globe.maximumScreenSpaceError;
    this.tileset.debugWireframe = this.look.wire === 1;
    for (const [name, type] of Object.entries(kTypes)) this.shader.setUniform(name, valueFor(type, this.look[name]));
    kStrips.forEach((name) => this.#copyStrip(name));
    const { x, y, z } = ellipsoid.transformPositionToScaledSpace(camera.positionWC);
    this.shader.setUniform("cameraLevel", x * x + y * y + z * z - 1);
  }
}
