// The material of the globe: colours by height, slope or aspect, shading by the tiles' vertex normals, and contour lines.
// Without a sun, the light is in the local north-west of every point, as on a printed map, so no hemisphere is dark.
import { Material, Sampler, Texture, TextureMagnificationFilter, TextureMinificationFilter } from "/viewer/cesium/index.js";
import { kColourings, kSteepest, waterline } from "/viewer/colours.js";

export const kRampWidth = 2048;

// Computes the look of a point of the ground from the uniforms below. `tiles`: a point of 3D Tiles, which are drawn to
// the right of the splitter. `painted`: its colour before it is lit; negative: by height, slope or aspect.
export const kLook = /* glsl */ `
const vec3 kRadii = vec3(6378137.0, 6378137.0, 6356752.314245);
const vec3 kShadow = vec3(0.30, 0.33, 0.46);
const vec3 kSunlight = vec3(1.0, 0.97, 0.90);
const vec3 kAir = vec3(0.45, 0.62, 0.82);
const vec3 kWater = vec3(0.20, 0.45, 0.62);
const vec3 kPaper = vec3(0.72, 0.76, 0.80);
const vec3 kElsewhere = vec3(0.105, 0.135, 0.175);

// 1 on a line, 0 between lines; value is in units of the spacing. Fades where lines would be denser than every fourth
// pixel, and on level ground, where all of it would be line.
float lines(float value, float widthPixels) {
  float perPixel = max(fwidth(value), 1e-7);
  float distancePixels = abs(fract(value - 0.5) - 0.5) / perPixel;
  float line = 1.0 - smoothstep(widthPixels * 0.5, widthPixels * 0.5 + 1.0, distancePixels);
  return line * (1.0 - smoothstep(0.12, 0.3, perPixel)) * smoothstep(0.0, 0.002, perPixel);
}

// Brightness of a surface relative to level ground, lit from a compass direction (x east, y north), 40 degrees high.
float lit(vec3 normalENU, vec2 towards) {
  return max(0.0, dot(normalENU, vec3(towards * 0.766, 0.643))) / 0.643;
}

// Light of a sun in direction towards, relative to bright daylight. The shadow's edge is soft, as it is under a real sky. A
// low sun is orange, and exposure makes up for part of its weakness.
vec3 sunlit(vec3 normalENU, vec3 towards) {
  float altitude = towards.z;
  float day = smoothstep(-0.14, 0.10, altitude);
  float facing = max(0.0, (dot(normalENU, towards) + 0.06) / 1.06);
  vec3 direct = mix(vec3(1.0, 0.50, 0.22), vec3(1.0, 0.97, 0.91), smoothstep(0.0, 0.42, altitude));
  float strength = smoothstep(-0.03, 0.07, altitude) / pow(max(altitude, 0.10), 0.62);
  vec3 skylight = mix(vec3(0.06, 0.08, 0.15), vec3(0.42, 0.48, 0.64), day) * (0.75 + 0.25 * normalENU.z);
  return skylight + direct * strength * facing * 0.62;
}

// How much of the ground's own colour is left in the look that terrainColour computed.
float kept = 1.0;

vec3 terrainColour(float metres, vec3 positionToEyeEC, vec3 normalEC, bool tiles, vec3 painted) {
  vec3 positionWC = (czm_inverseView * vec4(-positionToEyeEC, 1.0)).xyz;
  vec3 up = normalize(positionWC / kRadii / kRadii * 1e7);
  vec3 east = normalize(vec3(-up.y, up.x, 0.0) + vec3(0.0, 1e-6, 0.0));
  vec3 north = cross(up, east);

  float across = clamp((metres - heightRange.x) / (heightRange.y - heightRange.x), 0.0, 1.0);
  vec3 colour = texture(ramp, vec2(mix(0.5, ${kRampWidth}.0 - 0.5, across) / ${kRampWidth}.0, 0.5)).rgb;

  vec3 normalWC = czm_inverseNormal3D * normalEC;
  vec3 normal = vec3(dot(normalWC, east), dot(normalWC, north), dot(normalWC, up));
  float steepness = 1.0 - clamp(normal.z, 0.0, 1.0);
  // The triangle's own slope: an 8-bit normal cannot tell a sea from a plain.
  vec3 position = positionToEyeEC;
  float slope = fwidth(metres) / max(length(dFdx(position)) + length(dFdy(position)), 1e-6);
  float level = 1.0 - smoothstep(0.0003, 0.0015, slope);
  if (water > heightRange.x) {
    float towardsShore = (metres - heightRange.x) / (water - heightRange.x);
    colour = mix(colour, kWater, level * (1.0 - smoothstep(0.7, 1.0, towardsShore)));
  }

  // Slope and aspect of the ground itself: without exaggeration, and from the triangle where tiles have no normals.
  vec3 facet = czm_inverseViewRotation * cross(dFdx(position), dFdy(position));
  facet = vec3(dot(facet, east), dot(facet, north), dot(facet, up));
  vec3 ground = shading > 0.5 ? normal : facet * sign(facet.z);
  ground = normalize(vec3(ground.xy / exaggeration, max(ground.z, 1e-6)));
  if (colouring > 0.5) {
    float degreesOfSlope = degrees(acos(clamp(ground.z, 0.0, 1.0)));
    float aspect = fract(atan(ground.x, ground.y) / czm_twoPi);
    float along = colouring < 1.5 ? clamp(degreesOfSlope / ${kSteepest}.0, 0.0, 1.0) : aspect;
    colour = texture(theme, vec2(mix(0.5, ${kRampWidth}.0 - 0.5, along) / ${kRampWidth}.0, 0.5)).rgb;
    if (colouring > 1.5) colour = mix(vec3(0.72), colour, smoothstep(0.5, 4.0, degreesOfSlope));
  }
  normal = normalize(vec3(normal.xy * relief, max(normal.z, 0.02)));

  bool isPainted = painted.x >= 0.0;
  // Bare rock where it is too steep for soil or snow.
  float luminance = dot(colour, vec3(0.299, 0.587, 0.114));
  colour = mix(colour, vec3(0.46, 0.42, 0.39) * (0.5 + luminance), smoothstep(0.18, 0.5, steepness) * (colouring > 0.5 ? 0.0 : 0.55));
  if (isPainted) colour = painted;

  // Most of the light from the north-west, some from its two neighbours so that ridges along it keep their form.
  float light = 0.7 * lit(normal, vec2(-0.707, 0.707)) + 0.15 * lit(normal, vec2(-1.0, 0.0)) +
                0.15 * lit(normal, vec2(0.0, 1.0));
  vec3 shade = mix(kShadow, vec3(1.0), smoothstep(-0.15, 1.05, light)) + kSunlight * 0.28 * max(0.0, light - 1.0);
  if (sunny > 0.5) shade = sunlit(shading > 0.5 ? normal : vec3(0.0, 0.0, 1.0), vec3(dot(sun, east), dot(sun, north), dot(sun, up)));
  else shade = mix(vec3(1.0), shade, shading);
  // Colours with a meaning must stay readable, and photographs have shadows of their own.
  shade = mix(shade, mix(vec3(1.0), shade, 0.55), isPainted ? 1.0 - sunny : step(0.5, colouring));
  colour *= shade;
  kept = dot(shade, vec3(0.299, 0.587, 0.114));

  if (contourInterval > 0.0) {
    float fine = lines(metres / contourInterval, 0.6);
    float index = lines(metres / (5.0 * contourInterval), 1.3);
    float ink = mix(1.0, 0.35, max(fine * 0.55, index * 0.85));
    colour *= ink;
    kept *= ink;
  }

  // Around a regional dataset: slate with a faint graticule.
  float longitude = atan(up.y, up.x);
  float latitude = asin(clamp(up.z, -1.0, 1.0));
  vec2 offset = vec2(longitude - box.x, latitude - box.y);
  offset.x -= czm_twoPi * floor(offset.x / czm_twoPi + 0.5);
  vec2 beyond = abs(offset) - box.zw;
  if (!tiles && split > 0.5 && gl_FragCoord.x > czm_splitPosition && max(beyond.x, beyond.y) < 0.0) discard;
  float outside = smoothstep(0.0, 0.012 * (box.z + box.w), max(beyond.x, beyond.y));
  float grid = max(lines(longitude / graticule, 0.6), lines(latitude / graticule, 0.6));
  vec3 elsewhere = mix(kElsewhere + 0.06 * grid, kPaper - 0.07 * grid, paper);
  colour = mix(colour, elsewhere * mix(vec3(1.0), shade, sunny > 0.5 ? 0.35 : 0.6), outside * (1.0 - wire));
  kept *= 1.0 - outside * (1.0 - wire);

  // From afar the globe is round: lit over the viewer's left shoulder, with a thin bright rim of air. Near the ground
  // the air is between the viewer and the distance.
  vec3 toEye = normalize(czm_viewerPositionWC - positionWC);
  vec3 overShoulder = normalize(czm_inverseViewRotation * vec3(-0.5, 0.5, 0.8));
  float roundness = mix(1.0, 0.42 + 0.72 * max(0.0, dot(up, overShoulder)), farness * (1.0 - wire) * (1.0 - sunny));
  colour *= roundness;
  float rim = pow(1.0 - clamp(dot(up, toEye), 0.0, 1.0), 4.0) * farness;
  float haze = (1.0 - exp(-pow(length(positionToEyeEC) / hazeDistance, 2.0))) * (1.0 - farness);
  float daylight = sunny > 0.5 ? smoothstep(-0.10, 0.25, dot(sun, up)) : 1.0;
  vec3 air = mix(vec3(0.05, 0.07, 0.12), mix(vec3(0.72, 0.50, 0.38), kAir, sunny > 0.5 ? smoothstep(0.05, 0.4, dot(sun, up)) : 1.0), daylight);
  float veil = max(rim * 0.8, haze * 0.75) * (1.0 - wire);
  colour = mix(colour, air, veil);
  kept *= roundness * (1.0 - veil);

  return mix(colour, min(vec3(1.0), colour * 1.1 + 0.06), wire);
}`;

const kSource = /* glsl */ `
${kLook}
czm_material czm_getMaterial(czm_materialInput materialInput) {
  czm_material material = czm_getDefaultMaterial(materialInput);
  float metres = materialInput.height / exaggeration;  // CesiumJS gives the height after exaggeration
  vec3 position = materialInput.positionToEyeEC;
  vec3 positionWC = (czm_inverseView * vec4(-position, 1.0)).xyz;
  vec3 up = normalize(positionWC / kRadii / kRadii * 1e7);
  vec2 offset = vec2(atan(up.y, up.x), asin(clamp(up.z, -1.0, 1.0))) - imageBox.xy;
  offset.x -= czm_twoPi * floor(offset.x / czm_twoPi + 0.5);
  bool isImage = draped > 0.5 && all(lessThan(abs(offset), imageBox.zw));
  vec3 colour = terrainColour(metres, position, materialInput.normalEC, false, isImage ? vec3(0.0) : vec3(-1.0));
  // CesiumJS blends this over the image: the look of black ground, and the share of the image's own colour.
  material.alpha = isImage ? 1.0 - clamp(kept, 0.0, 1.0) : 1.0;
  material.diffuse = colour / max(material.alpha, 1e-3);
  return material;
}`;

// `strips`: the canvases of `ramp` and `theme`.
export function makeTerrainMaterial() {
  const material = new Material({
    translucent: false,
    fabric: {
      type: "TerraceTerrain",
      uniforms: {
        ramp: document.createElement("canvas"),
        heightRange: { x: 0, y: 1 },  // metres
        water: -1e5,  // metres below which level ground is water
        contourInterval: 0,  // metres; 0 draws none
        relief: 1,           // exaggerates slopes for shading
        shading: 1,          // 0 where the tiles have no normals
        box: { x: 0, y: 0, z: 4, w: 4 },  // longitude and latitude of the middle, half width and height, radians
        draped: 0,           // 1 while an image is below the material
        imageBox: { x: 0, y: 0, z: 4, w: 4 },  // of the image, as box
        graticule: 0.1745,   // radians between lines
        farness: 0,          // 0 near the ground, 1 with the whole globe in view
        hazeDistance: 1e6,   // metres at which air hides most of the ground
        wire: 0,             // 1 while the surface is drawn as lines
        paper: 0,            // 1 in the light theme, around the dataset
        exaggeration: 1,     // vertical scale of the geometry
        colouring: 0,        // 0 by height, 1 by slope, 2 by aspect
        theme: document.createElement("canvas"),  // the ramp of slope or aspect
        sunny: 0,            // 1 while the sun of a date lights the ground
        sun: { x: 0, y: 0, z: 1 },  // direction towards the sun, Earth-centred
        split: 0,            // 1 while 3D Tiles are drawn to the right of the splitter
      },
      source: kSource,
    },
  });
  return Object.assign(material, { strips: {} });
}

// A strip of colours, drawn by `draw(canvas)`. CesiumJS uses an image only from its second frame on, and white before; a
// texture it uses at once.
function setStrip(material, context, name, draw) {
  const canvas = Object.assign(document.createElement("canvas"), { width: kRampWidth, height: 1 });
  material.strips[name] = draw(canvas);
  const sampler = new Sampler({
    minificationFilter: TextureMinificationFilter.LINEAR, magnificationFilter: TextureMagnificationFilter.LINEAR,
  });
  material.uniforms[name] = new Texture({ context, source: canvas, sampler });
}

// `context`: of the scene that draws the material.
export function setHeights(material, context, heights) {
  setStrip(material, context, "ramp", (canvas) => kColourings.height.draw(canvas, heights));
  material.uniforms.water = waterline(heights);
  material.uniforms.heightRange = { x: heights.min, y: Math.max(heights.max, heights.min + 1) };
}

const kOrder = Object.keys(kColourings);

// `name`: a key of kColourings.
export function setColouring(material, context, name) {
  const number = Math.max(0, kOrder.indexOf(name));
  if (number > 0) setStrip(material, context, "theme", (canvas) => kColourings[name].draw(canvas));
  material.uniforms.colouring = number;
}
