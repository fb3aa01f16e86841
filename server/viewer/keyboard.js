// Controls the camera by keyboard while the globe has the focus: arrows move, Shift and arrows turn, plus and minus
// zoom, Enter shows the height at the centre; the page defines other keys.
import { Cartesian3, Math as CesiumMath } from "/viewer/cesium/index.js";

const kTurn = CesiumMath.toRadians(4);
const kStep = 0.12;  // of the height above the ground
export const kNearest = 10;  // metres above the ground

// Moves along the ground by `right` and `ahead`, in steps relative to the camera, `height` metres above it.
function travel(camera, height, right, ahead) {
  const up = Cartesian3.normalize(camera.positionWC, new Cartesian3());
  const northward = Cartesian3.cross(up, camera.rightWC, new Cartesian3());
  const along = Cartesian3.multiplyByScalar(camera.rightWC, right, new Cartesian3());
  Cartesian3.add(along, Cartesian3.multiplyByScalar(northward, ahead, northward), along);
  const axis = Cartesian3.cross(along, up, new Cartesian3());
  const angle = (kStep * height) / Cartesian3.magnitude(camera.positionWC);
  camera.rotate(axis, Math.min(angle, 0.12));
}

function turn(camera, right, up) {
  const pitch = CesiumMath.clamp(camera.pitch + up * kTurn, -CesiumMath.PI_OVER_TWO, 0.2);
  camera.setView({ orientation: { heading: camera.heading + right * kTurn, pitch, roll: 0 } });
}

const kArrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const kZooms = { "+": 1, "=": 1, "-": -1 };

// `clearance()`: metres from the camera down to the drawn ground. `onSteer()`: a key moves the camera. `onKey(key)` returns
// whether the page has used the key.
export function steerByKeyboard(element, camera, { clearance, onSteer, onEnter, onKey }) {
  element.tabIndex = 0;
  element.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const height = Math.max(clearance(), kNearest);
    if (event.key in kArrows || event.key in kZooms) onSteer();
    if (event.key in kArrows && event.shiftKey) turn(camera, ...kArrows[event.key]);
    else if (event.key in kArrows) travel(camera, height, ...kArrows[event.key]);
    else if (event.key in kZooms) camera.zoomIn(kZooms[event.key] * 0.2 * height);
    else if (event.key === "Enter") onEnter();
    else if (!onKey(event.key)) return;
    event.preventDefault();
  });
}
