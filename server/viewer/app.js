// The viewer: datasets from the server, controls from the panel, terrain on the globe, and the view in the URL.
import { suggestedFraction } from "/viewer/framing.js";
import { Globe } from "/viewer/globe.js";
import { Panel, fractionOfStep, stepOfFraction } from "/viewer/panel.js";
import { Traffic } from "/viewer/traffic.js";
import { decodeView, encodeView } from "/viewer/view_url.js";

const kFlightSeconds = 2.5;

const state = { datasets: [], dataset: undefined, fraction: 0.5, contours: false, wireframe: false, tiles3d: false,
                picked: undefined, drawn: undefined, ready: false, problems: [] };

const panel = new Panel({
  dataset: (name) => choose(name),
  home: () => globe.lookAt(state.dataset, kFlightSeconds),
  fraction: (fraction) => refetch(fraction),
  exaggeration: (factor) => { globe.exaggeration = factor; remember(); },
  contours: (on) => setSwitches({ ...state, contours: on }),
  wireframe: (on) => setSwitches({ ...state, wireframe: on }),
  tiles3d: (on) => { setSwitches({ ...state, tiles3d: on }); return show(); },
  split: (share) => { globe.split = share; remember(); },
});
const traffic = new Traffic();
const globe = makeGlobe();

function complain(problem) {
  state.problems.push(String(problem));
  panel.setMessage(String(problem));
}

function makeGlobe() {
  try {
    return new Globe(document.getElementById("globe"), complain);
  } catch (error) {
    complain(`This browser cannot draw the globe: ${error.message}`);
    throw error;
  }
}

function defaultFraction(dataset) {
  return fractionOfStep(stepOfFraction(suggestedFraction(dataset)));
}

async function fetchDatasets() {
  const response = await fetch("/datasets");
  if (!response.ok) throw new Error(`the server answered ${response.status} to /datasets`);
  return (await response.json()).datasets.map((dataset) => ({
    ...dataset,
    bounds: dataset.bounds ?? [-180, -90, 180, 90],
    heights: { min: dataset.heights?.min ?? 0, max: dataset.heights?.max ?? 4000 },
    urls: { layer: `/${encodeURIComponent(dataset.name)}/layer.json`,
            tileset: `/${encodeURIComponent(dataset.name)}/tileset.json`, ...dataset.urls },
  }));
}

async function show() {
  panel.setDataset(state.dataset);
  panel.setFraction(state.fraction);
  traffic.reset();
  try {
    await globe.show(state.dataset, state.fraction, state.tiles3d);
    panel.setMessage(undefined);
    state.ready = true;
  } catch (error) {
    complain(`${state.dataset.name} could not be loaded: ${error.message ?? error}`);
  }
  remember();
}

function choose(name) {
  state.dataset = state.datasets.find((dataset) => dataset.name === name) ?? state.datasets[0];
  state.fraction = defaultFraction(state.dataset);
  globe.lookAt(state.dataset, kFlightSeconds);
  return show();
}

function refetch(fraction) {
  state.fraction = fraction;
  return show();
}

function setSwitches({ contours, wireframe, tiles3d }) {
  Object.assign(state, { contours, wireframe, tiles3d });
  globe.contours = contours;
  globe.wireframe = wireframe;
  globe.adaptToCamera();
  panel.setSwitches(state);
  remember();
}

// Keeps the address bar on what is shown, without filling the history.
function remember() {
  if (!state.ready) return;
  const view = { ...state, dataset: state.dataset.name, camera: globe.camera, exaggeration: globe.exaggeration,
                 split: globe.split };
  history.replaceState(undefined, "", encodeView(view));
}

function apply(view) {
  state.dataset = state.datasets.find((dataset) => dataset.name === view.dataset) ?? state.datasets[0];
  state.fraction = view.fraction ?? defaultFraction(state.dataset);
  globe.exaggeration = view.exaggeration ?? 1;
  panel.setExaggeration(globe.exaggeration);
  panel.splitter.place = globe.split = view.split;
  if (view.camera) globe.camera = view.camera;
  else globe.lookAt(state.dataset, 0);
  setSwitches(view);
  return show();
}

function refresh() {
  state.drawn = globe.drawn();
  panel.setStats(state.drawn, traffic, state.tiles3d ? globe.tiles3d.drawn() : undefined);
  panel.setInterval(state.contours ? globe.interval : 0);
  panel.setActivity(globe.loading ? "loading" : "");
}

async function start() {
  panel.setActivity("loading");
  globe.onPick((position) => panel.setReadout(state.picked = position));
  globe.scene.camera.moveEnd.addEventListener(remember);
  addEventListener("hashchange", () => apply(decodeView(location.hash)));
  try {
    state.datasets = await fetchDatasets();
  } catch (error) {
    return complain(`The list of datasets could not be read: ${error.message}. Is the server running?`);
  }
  if (state.datasets.length === 0) {
    return complain("This server has no datasets. Start it with a DEM: terrace serve maui.tif");
  }
  panel.setDatasets(state.datasets);
  setInterval(refresh, 400);
  await apply(decodeView(location.hash));
}

window.terrace = { viewer: globe.widget, state, globe, traffic };
start();
