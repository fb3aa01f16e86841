// The light and what is above the ground: the sun of a date, the sky's colours, and stars.
import {
  Cartesian3, DirectionalLight, DynamicAtmosphereLightingType, SkyBox, SunLight,
} from "/viewer/cesium/index.js";

const kStarsFrom = 2e6;  // metres from the ground; nearer, the air hides them
const kFaces = ["positiveX", "negativeX", "positiveY", "negativeY", "positiveZ", "negativeZ"];

// A face of the sky with random stars, the same in every session: a decoration, not a chart.
function drawStars(seed) {
  let state = seed * 2654435761 + 1;
  const random = () => ((state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32);
  const canvas = Object.assign(document.createElement("canvas"), { width: 1024, height: 1024 });
  const context = canvas.getContext("2d");
  context.fillStyle = "#05080d";
  context.fillRect(0, 0, 1024, 1024);
  for (let i = 0; i < 2600; ++i) {
    const bright = random() ** 9;
    const warm = random();
    context.fillStyle = `rgb(${205 + 50 * warm} 222 ${255 - 50 * warm} / ${0.12 + 0.85 * bright})`;
    context.beginPath();
    context.arc(random() * 1024, random() * 1024, 0.35 + 0.75 * bright, 0, 7);
    context.fill();
  }
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

  // Stars are drawn when they are first seen from afar. `distance`: metres to the ground in view.
  adapt(distance) {
    if (distance > kStarsFrom && !this.scene.skyBox && this.scene.globe.tilesLoaded) {
      const sources = Object.fromEntries(kFaces.map((face, i) => [face, drawStars(i + 1)]));
      this.scene.skyBox = new SkyBox({ sources });
    }
  }
}
