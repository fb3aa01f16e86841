// Labels of index contours, placed on the drawn meshes: where an edge of a triangle crosses the height of a line, far
// from other labels and from the view's edges, and not behind a ridge.
import { Cartesian2, Cartesian3, Cartographic, Math as CesiumMath, SceneTransforms } from "/viewer/cesium/index.js";

const kSpacing = 150;  // pixels between labels
const kHalfWidth = 32;  // pixels of a label
const kMaxTriangles = 4000;  // of one tile that are looked at
const kMaxLabels = 28;

function groundOf(world) {
  const { longitude, latitude, height } = Cartographic.fromCartesian(world);
  return { longitude: CesiumMath.toDegrees(longitude), latitude: CesiumMath.toDegrees(latitude), height };
}

// The two points where the contour of `height` enters and leaves a triangle, as [world, world]; undefined if none.
function crossing(heights, corners, height) {
  const points = [];
  for (let i = 0; i < 3; ++i) {
    const [a, b] = [heights[i], heights[(i + 1) % 3]];
    if ((a < height) === (b < height)) continue;
    points.push(Cartesian3.lerp(corners[i], corners[(i + 1) % 3], (height - a) / (b - a), new Cartesian3()));
  }
  return points.length === 2 ? points : undefined;
}

// `spacing`: metres between labelled contours. `format`: text of a height. Returns labels for Overlay.setLabels.
export function placeLabels(scene, spacing, format) {
  const { canvas, camera, globe } = scene;
  const exaggeration = scene.verticalExaggeration;
  const taken = [];
  const labels = [];
  const isFree = ({ x, y }) => x > 40 && y > 40 && x < canvas.clientWidth - 40 && y < canvas.clientHeight - 40 &&
    [-kHalfWidth, 0, kHalfWidth].every((across) => document.elementFromPoint(x + across, y) === canvas) &&  // not below the panel
    taken.every((other) => Math.hypot(other.x - x, other.y - y) > kSpacing);
  for (const tile of globe._surface._tilesToRender) {
    const mesh = tile.data?.renderedMesh;
    if (!mesh) continue;
    const { encoding, vertices, indices } = mesh;
    const heightAt = (index) => encoding.decodeHeight(vertices, index);
    const triangles = mesh.indexCountWithoutSkirts / 3;
    const step = Math.max(1, Math.floor(triangles / kMaxTriangles));
    for (let t = 0; t < triangles; t += step) {
      const corners = [0, 1, 2].map((i) => indices[3 * t + i]);
      const heights = corners.map(heightAt);
      const height = Math.floor(Math.max(...heights) / spacing) * spacing;
      if (height <= Math.min(...heights)) continue;
      const positions = corners.map((index) => encoding.decodePosition(vertices, index, new Cartesian3()));
      const line = crossing(heights, positions, height);
      if (!line) continue;
      const [ground, ahead] = line.map(groundOf);
      const worlds = [ground, ahead].map((g) => Cartesian3.fromDegrees(g.longitude, g.latitude, height * exaggeration));
      const at = SceneTransforms.worldToWindowCoordinates(scene, worlds[0], new Cartesian2());
      const to = at && SceneTransforms.worldToWindowCoordinates(scene, worlds[1], new Cartesian2());
      if (!to || !isFree(at) || Math.hypot(to.x - at.x, to.y - at.y) < 0.3) continue;
      taken.push(at);  // also if it is hidden, so that a ridge is not tried again and again
      const hit = globe.pick(camera.getPickRay(at), scene);
      const away = Cartesian3.distance(camera.positionWC, worlds[0]);
      if (!hit || Cartesian3.distance(camera.positionWC, hit) < away * 0.99) continue;
      labels.push({ text: format(height), ground: { ...ground, height }, ahead: { ...ahead, height } });
      if (labels.length >= kMaxLabels) return labels;
    }
  }
  return labels;
}
