// The viewer: datasets from the server, controls from the panel, terrain on the globe, and the view in the URL.
import { Access, UnknownToken } from "/viewer/access.js";
import { boxOf, firstRegion, suggestedFraction } from "/viewer/framing.js";
import { Globe } from "/viewer/globe.js";
import { Panel, fractionOfStep, stepOfFraction } from "/viewer/panel.js";
import { TokenCard } from "/viewer/token_card.js";
import { Traffic } from "/viewer/traffic.js";
import { decodeView, encodeView } from "/viewer/view_url.js";

const kFlightSeconds = 2.5;

// `wanted`: a view of a dataset that is not in the list; it may be there with a token.
const state = { datasets: [], moreWithToken: false, dataset: undefined, fraction: 0.5, contours: false,
                wireframe: false, tiles3d: false, picked: undefined, drawn: undefined, ready: false, wanted: undefined,
                refreshing: undefined, problems: [] };

const access = new Access();
const panel = new Panel({
  dataset: (name) => choose(name),
  home: () => state.dataset && lookAt(firstRegion(state.dataset), kFlightSeconds),
  whole: () => lookAt(state.dataset, kFlightSeconds),
  token: () => ask("Datasets that the token opens are added to the list."),
  fraction: (fraction) => refetch(fraction),
  exaggeration: (factor) => { globe.exaggeration = factor; remember(); },
  contours: (on) => setSwitches({ ...state, contours: on }),
  wireframe: (on) => setSwitches({ ...state, wireframe: on }),
  tiles3d: (on) => { setSwitches({ ...state, tiles3d: on }); return show(); },
  split: (share) => { globe.split = share; remember(); },
});
const card = new TokenCard((token) => useToken(token));
const traffic = new Traffic();
const globe = makeGlobe();

function complain(problem) {
  state.problems.push(String(problem));
  panel.setMessage(String(problem));
}

function ask(reason) {
  panel.setActivity("");
  card.ask(reason, state.datasets.length > 0);
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
  return fractionOfStep(stepOfFraction(suggestedFraction(firstRegion(dataset))));
}

async function show() {
  const { dataset } = state;
  if (!dataset) return;
  panel.setDataset(dataset, firstRegion(dataset).isPart);
  panel.setFraction(state.fraction);
  traffic.reset();
  try {
    await globe.show(dataset, state.fraction, state.tiles3d, access.headers);
    panel.setMessage(undefined);
    state.ready = true;
  } catch (error) {
    if (await access.isRefused(dataset.urls.layer).catch(() => false)) ask(`${dataset.name} needs a token.`);
    else complain(`${dataset.name} could not be loaded: ${error.message ?? error}`);
  }
  remember();
}

// The heights of a part of a dataset are unknown.
async function lookAt(region, seconds) {
  const { dataset } = state;
  const { longitude, latitude } = boxOf(region.bounds);
  const ground = region.isPart ? await access.heightAt(dataset, longitude, latitude) : undefined;
  if (dataset === state.dataset) globe.lookAt({ ...region, ground }, seconds);
}

function choose(name) {
  state.wanted = undefined;
  state.dataset = state.datasets.find((dataset) => dataset.name === name) ?? state.datasets[0];
  state.fraction = defaultFraction(state.dataset);
  lookAt(firstRegion(state.dataset), kFlightSeconds);
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

// Updates the address bar to the current view without adding to the history.
function remember() {
  if (!state.ready || state.wanted) return;
  const view = { ...state, dataset: state.dataset.name, camera: globe.camera, exaggeration: globe.exaggeration,
                 split: globe.split };
  history.replaceState(undefined, "", encodeView(view));
}

async function apply(view) {
  if (state.datasets.length === 0) return;
  state.refreshing ??= setInterval(refresh, 400);
  const named = state.datasets.find((dataset) => dataset.name === view.dataset);
  state.wanted = view.dataset && !named ? view : undefined;
  state.dataset = named ?? state.datasets[0];
  state.fraction = (named && view.fraction) ?? defaultFraction(state.dataset);
  globe.exaggeration = view.exaggeration ?? 1;
  panel.setExaggeration(globe.exaggeration);
  panel.splitter.place = globe.split = view.split;
  if (named && view.camera) globe.camera = view.camera;
  else await lookAt(firstRegion(state.dataset), 0);
  setSwitches(view);
  await show();
  if (!state.wanted) return;
  if (state.moreWithToken) ask(`${view.dataset} needs a token, or is not on this server.`);
  else complain(`There is no dataset ${view.dataset} on this server; this is ${state.dataset.name}.`);
}

function refresh() {
  state.drawn = globe.drawn();
  panel.setStats(state.drawn, traffic, state.tiles3d ? globe.tiles3d.drawn() : undefined);
  panel.setInterval(state.contours ? globe.interval : 0);
  panel.setActivity(globe.loading ? "loading" : "");
}

// Throws UnknownToken.
async function list(token) {
  const { datasets, moreWithToken } = await access.list(token);
  Object.assign(state, { datasets, moreWithToken });
  panel.setDatasets(datasets, moreWithToken);
}

async function useToken(token) {
  try {
    await list(token);
  } catch (error) {
    return ask(error instanceof UnknownToken ? "The server does not know this token." : `That failed: ${error.message}.`);
  }
  access.token = token;
  if (state.datasets.length === 0) return ask("There is no dataset for this token.");
  card.close();
  panel.setMessage(undefined);
  await apply(state.wanted ?? decodeView(location.hash));
}

// Uses the token of this tab, if it has a valid one.
async function listAtStart() {
  try {
    await list();
  } catch (error) {
    if (!(error instanceof UnknownToken)) throw error;
    access.token = "";
    await list();
  }
}

async function start() {
  panel.setActivity("loading");
  globe.onPick((position) => panel.setReadout(state.picked = position));
  globe.scene.camera.moveEnd.addEventListener(remember);
  addEventListener("hashchange", () => apply(decodeView(location.hash)));
  try {
    await listAtStart();
  } catch (error) {
    return complain(`The list of datasets could not be read: ${error.message}. Is the server running?`);
  }
  if (state.datasets.length > 0) return apply(decodeView(location.hash));
  if (state.moreWithToken) return ask("The datasets of this server need a token.");
  complain("This server has no datasets. Start it with a DEM: terrace serve maui.tif");
}

window.terrace = { viewer: globe.widget, state, globe, traffic };
start();
