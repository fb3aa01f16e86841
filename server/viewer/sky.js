// The light and what is above the ground: the sun of a date, the sky's colours, and stars.
import {
  Cartesian3, DirectionalLight, DynamicAtmosphereLightingType, SkyBox, SunLight,
} from "/viewer/cesium/index.js";

const kStarsFrom = 2e6;  // metres from the ground; nearer, the air hides them
const kFaces = ["positiveX", "negativeX", "positiveY", "negativeY", "positiveZ", "negativeZ"];

const kFace = 1024;  // pixels
const kStars = 2600;  // on a face

// A face of the sky with random stars, the same in every session: a decoration, not a chart.
function drawStars(seed) {
  let state = seed * 2654435761 + 1;
  const random = () => ((state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32);
  const canvas = Object.assign(document.createElement("canvas"), { width: kFace, height: kFace });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  const pixels = context.createImageData(kFace, kFace);
  new Uint32Array(pixels.data.buffer).fill(0xff0d0805);  // #05080d
  for (let i = 0; i < kStars; ++i) {
    const bright = random() ** 9;
    const warm = random();
    const colour = [205 + 50 * warm, 222, 255 - 50 * warm];
    const [x, y, radius] = [random() * kFace, random() * kFace, 0.35 + 0.75 * bright];
    for (let row = Math.max(0, Math.floor(y - 1)); row <= Math.min(kFace - 1, y + 1); ++row) {
      for (let column = Math.max(0, Math.floor(x - 1)); column <= Math.min(kFace - 1, x + 1); ++column) {
        const beyond = Math.hypot(column + 0.5 - x, row + 0.5 - y) - radius;
        const share = Math.min(1, Math.max(0, 0.5 - beyond)) * (0.12 + 0.85 * bright);
        for (let k = 0; k < 3; ++k) pixels.data[4 * (row * kFace + column) + k] += share * (colour[k] - 8);
      }
    }
  }
  context.putImageData(pixels, 0, 0);
  return canvas;
}

export class Sky {
  // `look`: the uniforms of the terrain's material.
  constructor(scene, look) {
    Object.assign(this, { scene, look });
  }

  // A direction towards the sun, Earth-centred; undefined: light from the north-west everywhere.
  set sun(direction) {
    const { scene, look } = this;
    look.sunny = direction ? 1 : 0;
    if (direction) {
      look.sun = direction;
      scene.light = new DirectionalLight({ direction: Cartesian3.negate(direction, new Cartesian3()) });
      scene.atmosphere.dynamicLighting = DynamicAtmosphereLightingType.SCENE_LIGHT;
    } else {
      scene.light = new SunLight();
      scene.atmosphere.dynamicLighting = DynamicAtmosphereLightingType.NONE;
    }
    scene.requestRender();
  }

  // Stars are drawn when they are first seen from afar, while the page has nothing else to do. `distance`: metres to the
  // ground in view. Precondition: terrain is drawn.
  adapt(distance) {
    if (distance <= kStarsFrom || this.hasStars) return;
    this.hasStars = true;
    const idle = globalThis.requestIdleCallback ?? setTimeout;
    const sources = {};
    const drawFace = (i) => {
      if (i === kFaces.length) {
        this.scene.skyBox = new SkyBox({ sources });
        return this.scene.requestRender();
      }
      sources[kFaces[i]] = drawStars(i + 1);
      idle(() => drawFace(i + 1));
    };
    idle(() => drawFace(0));
  }
}
