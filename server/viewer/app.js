// The viewer: datasets from the server, controls from the panel, terrain on the globe, and the view in the URL.
import { pendingText, UnknownToken } from "/viewer/access.js";
import { Address } from "/viewer/address.js";
import { access, firstList, startOf } from "/viewer/early.js";
import { boxOf, defaultFraction, discOf, firstRegion, fractionOfStep, stepOfFraction } from "/viewer/framing.js";
import { Globe } from "/viewer/globe.js";
import { formatHeight } from "/viewer/numbers.js";
import { Panel } from "/viewer/panel.js";
import { fromLocalMeanTime, sunDirection } from "/viewer/sun.js";
import { onTheme } from "/viewer/theme.js";
import { TokenCard } from "/viewer/token_card.js";
import { Traffic } from "/viewer/traffic.js";
import { Turns } from "/viewer/turns.js";
import { decodeView, encodeView } from "/viewer/view_url.js";
import { Watch } from "/viewer/watch.js";

const flightSeconds = () => (matchMedia("(prefers-reduced-motion: reduce)").matches ? 0 : 2.5);

const kFirstSun = "06-21T18:30";  // of this year: an evening, if none was chosen
const kRetryMs = 5000;
const kForgetMs = 120000;  // a failure that comes later does not prolong the pause after the one before
const kCoarser = 8;  // between the errors on the left and on the right, at first

// `wanted`: a view of a dataset that the server prepares, or that may be there with a token; the address keeps it.
// `right`: the fraction on the right of the line. `preparing`: datasets that the server has not opened yet. `sun`:
// "2026-06-21T18:30" in the dataset's local mean time. `hasFailed`: tiles of the shown terrain are missing. `isGone`: the
// server does not have this dataset any more. `isRefused`: it does not know the token. `shown`: the name of the dataset
// that was shown last. `region`: what the camera was told last to look at. `retry`: the timer of the next attempt.
const state = { datasets: [], preparing: [], moreWithToken: false, dataset: undefined, fraction: 0.5, contours: false,
                wireframe: false, tiles3d: false, edits: false, imagery: false, right: undefined, colouring: "height", sun: undefined,
                hasFailed: false, isGone: false, isRefused: false, failures: 0, failedAt: 0, picked: undefined, drawn: undefined, ready: false, wanted: undefined,
                refreshing: undefined, retry: undefined, problems: [], shown: undefined, region: undefined };

const globe = new Globe(document.getElementById("globe"), complain, missTile);
const panel = new Panel({
  dataset: (name) => choose(name),
  home: () => state.dataset && lookAt(firstRegion(state.dataset), flightSeconds()),
  whole: () => lookAt(state.dataset, flightSeconds()),
  token: () => ask("Datasets that the token opens are added to the list."),
  fraction: (fraction) => refetch(fraction),
  exaggeration: (factor) => { globe.exaggeration = factor; state.draft?.stretch(); remember(); },
  contours: (on) => setSwitches({ ...state, contours: on }),
  wireframe: (on) => setSwitches({ ...state, wireframe: on }),
  tiles3d: (on) => { setSwitches({ ...state, tiles3d: on, right: undefined }); return show(); },
  compare: (on) => { setSwitches({ ...state, tiles3d: false, right: on ? coarserThan(state.fraction) : undefined }); return show(); },
  right: (fraction) => { setSwitches({ ...state, right: fraction }); return show(); },
  edits: (on) => setSwitches({ ...state, edits: on }),
  imagery: (on) => setSwitches({ ...state, imagery: on }),
  colouring: (name) => setColouring(name),
  sunny: (on) => setSun(on ? `${new Date().getFullYear()}-${kFirstSun}` : undefined),
  sun: (text) => setSun(text),
  tool: (name) => useTool(name),
  link: () => copyLink(),
  split: (share) => { globe.split = share; remember(); },
});
const shows = new Turns();
const views = new Turns();  // by the address or the list of datasets
const toolClicks = new Turns();
const card = new TokenCard((token) => useToken(token), () => state.isRefused && useToken(""));
const traffic = new Traffic();
const address = new Address(fragmentOfView);

const watch = new Watch({ list: () => list(), onLost: (error) => lose(error), onList: (wasLost) => follow(wasLost) });

function complain(problem) {
  state.problems.push(String(problem));
  panel.setMessage(String(problem));
}

function ask(reason) {
  panel.setActivity("");
  card.ask(reason, state.datasets.length > 0);
}

// A finer one where there is none.
function coarserThan(fraction) {
  const [coarser, finer] = [fraction * kCoarser, fraction / kCoarser].map((other) => fractionOfStep(stepOfFraction(other)));
  return coarser > fraction ? coarser : finer;
}

// What was picked, measured or drawn belongs to one dataset.
function clearToolsOfAnother(dataset) {
  if (state.shown !== undefined && state.shown !== dataset.name) {
    openTool()?.end();
    globe.overlay.setMarker("picked", undefined);
    read(undefined);
  }
  state.shown = dataset.name;
}

async function show() {
  const { dataset } = state;
  if (!dataset) return;
  const isLatest = shows.begin();
  clearToolsOfAnother(dataset);
  if (dataset.isArchive) setSwitches({ ...state, tiles3d: state.tiles3d && Boolean(dataset.urls.tileset), right: undefined });
  state.hasFailed = false;
  panel.setDataset(dataset, firstRegion(dataset).isPart);
  panel.setFraction(state.fraction);
  if (state.ready) traffic.reset();
  lightSun();
  try {
    globe.drape(state.imagery ? dataset : undefined, access.headers);
    await globe.show(dataset, state.fraction, state.right ?? (state.tiles3d ? state.fraction : undefined), access.headers);
    if (!isLatest()) return;
    if (!watch.isLost) panel.setMessage(undefined);
    state.ready = true;
  } catch (error) {
    if (!isLatest()) return;
    state.hasFailed = true;
    if (watch.isLost || state.isGone) return;
    const isRefused = await access.isRefused(dataset.urls.layer).catch(() => false);
    if (!isLatest()) return;
    if (isRefused) {
      ask(`${dataset.name} needs a token.`);
    } else {
      complain(`${dataset.name} could not be loaded: ${error.message ?? error}`);
      tryLater();
    }
  }
  remember();
}

// Shows the dataset anew after a pause, unless that happens before. Each pause is longer than the one before.
function tryLater() {
  if (performance.now() - state.failedAt > kForgetMs) state.failures = 0;
  state.failedAt = performance.now();
  clearTimeout(state.retry);
  state.retry = setTimeout(() => state.hasFailed && !watch.isLost && show(), Math.min(60000, kRetryMs * 2 ** state.failures++));
}

// The dataset list has no heights of a part of a dataset, so the server is asked for one. If another view is wanted before
// it answers, or the user steers, this one is dropped.
async function lookAt(region, seconds) {
  state.region = region;
  const { longitude, latitude } = discOf(region);
  const ground = region.isPart ? await access.heightAt(state.dataset, longitude, latitude).catch(() => undefined) : undefined;
  if (state.region === region) globe.lookAt({ ...region, ground }, seconds);
}

function choose(name) {
  views.begin();
  state.wanted = undefined;
  state.isGone = false;
  state.dataset = state.datasets.find((dataset) => dataset.name === name) ?? state.datasets[0];
  state.fraction = defaultFraction(state.dataset);
  lookAt(firstRegion(state.dataset), flightSeconds());
  return show();
}

function refetch(fraction) {
  state.fraction = fraction;
  panel.setSwitches(state);
  return show();
}

// The server does not answer: the picture stays, and comes to life again with the server. Or it has other tokens now.
function lose(error) {
  if (error instanceof UnknownToken) {
    panel.setMessage(undefined);
    state.isRefused = true;
    return ask("The server does not know the token of this page any more.");
  }
  const problem = error.status ? `The server answers ${error.status}.` : "The server does not answer.";
  panel.setMessage(`${problem} The page goes on as soon as it can.`);
}

// Tells about the dataset that is waited for, or else shown, if the server is preparing it; without one, about all that it
// prepares.
function tellPending() {
  const name = state.wanted?.dataset ?? state.dataset?.name;
  const awaited = state.preparing.filter((pending) => !name || pending.name === name);
  if (awaited.length > 0) panel.setMessage(awaited.map((pending) => pendingText(pending)).join(" "));
  return awaited.length > 0;
}

// Tells why nothing is shown.
function tellEmpty() {
  if (tellPending()) return;
  if (state.moreWithToken) return ask("The datasets of this server need a token.");
  complain("This server has no datasets. Start it with a DEM: terrace serve maui.tif");
}

// The server has answered with its list. Shows a dataset that was waited for. Shows the dataset anew if it has another version, or if tiles could not be read.
function follow(wasLost) {
  const { dataset } = state;
  if (state.isRefused) card.close();
  state.isRefused = false;
  if (wasLost) panel.setMessage(undefined);
  const isThere = state.datasets.some(({ name }) => name === state.wanted?.dataset);
  if (isThere || (!dataset && state.datasets.length > 0)) {
    panel.setMessage(undefined);
    card.close();
    return apply(state.wanted ?? decodeView(location.hash));
  }
  if (!dataset) return wasLost ? tellEmpty() : tellPending();
  const isPending = tellPending();
  if (!state.ready) return wasLost ? apply(state.wanted ?? decodeView(location.hash)) : undefined;
  const current = state.datasets.find(({ name }) => name === dataset.name);
  if (!current) {
    state.isGone = true;
    if (!isPending) panel.setMessage(`${dataset.name} is no longer on this server. What is drawn is what it was.`);
    return;
  }
  const isNew = current.version !== dataset.version;
  const isBack = state.isGone;
  state.dataset = current;
  state.isGone = false;
  if (isNew) panel.note(`${dataset.name} has a new version.`);
  if (isNew || wasLost) openTool()?.refresh();
  if (isBack) panel.setMessage(undefined);
  if (isNew || isBack || (state.hasFailed && wasLost)) return show();
}

// A tile could not be read: the server may be gone, or the dataset may have changed. If neither is so, tries again later.
function missTile(problem) {
  if (state.hasFailed) return;
  state.hasFailed = true;
  watch.check().then(() => {
    if (watch.isLost || state.isGone || !state.hasFailed) return;
    const detail = traffic.problem;  // read late: CesiumJS reports a failure before `traffic` has seen the reply
    complain(detail ? `Tiles of ${state.dataset.name} cannot be read: ${detail}. The page tries again.` : problem);
    tryLater();
  });
}

function setColouring(name) {
  state.colouring = globe.colouring = name;
  panel.setColouring(name);
  remember();
}

function lightSun() {
  const { longitude } = boxOf(firstRegion(state.dataset).bounds);
  globe.sky.sun = state.sun && sunDirection(fromLocalMeanTime(state.sun, longitude));
}

function setSun(text) {
  state.sun = text;
  panel.setSun(text);
  if (state.dataset) lightSun();
  remember();
}

// The tools are loaded when they are first used. One of them at a time.
async function useTool(name) {
  const options = { globe, access, dataset: () => state.dataset, onMode: setMode };
  const isLatest = toolClicks.begin();
  let part;
  try {
    part = await import(name === "draft" ? "/viewer/draft.js" : "/viewer/measure.js");
  } catch {
    return isLatest() && panel.note("The tool could not be loaded: the server does not answer.");
  }
  if (!isLatest()) return;
  if (name === "draft") state.draft ??= new part.Draft(options);
  else state.measure ??= new part.Measure(options);
  const [other, tool] = name === "draft" ? [state.measure, state.draft] : [state.draft, state.measure];
  other?.end();
  return tool.toggle(name);
}

const openTool = () => (state.draft?.isOpen ? state.draft : state.measure);

function setMode(name) {
  panel.setTool(name);
  read(undefined);
}

async function copyLink() {
  address.write();
  try {
    await navigator.clipboard.writeText(location.href);
    panel.note("The link to this view is copied.");
  } catch {
    panel.note("The address bar has the link to this view.");
  }
}

const kKeys = {
  c: () => setSwitches({ ...state, contours: !state.contours }),
  w: () => setSwitches({ ...state, wireframe: !state.wireframe }),
  x: () => document.getElementById("compare").click(),
  d: () => useTool("distance"),
  l: () => useTool("sight"),
  e: () => useTool("draft"),
  Home: () => document.getElementById("home").click(),
  Escape: () => openTool()?.end(),
  Backspace: () => openTool()?.undo(),
  "?": () => document.getElementById("help").click(),
};

// Whether the page uses this key, pressed on the globe.
function pressKey(key) {
  const act = kKeys[key.length === 1 ? key.toLowerCase() : key];
  act?.();
  return act !== undefined;
}

// Labels of contours are placed when the view is at rest; their part of the page is loaded when it is first used.
async function labelContours() {
  if (!state.contours || globe.loading) return;
  const { placeLabels } = await import("/viewer/contour_labels.js");
  if (state.contours) globe.overlay.setLabels(placeLabels(globe.scene, 5 * globe.interval, formatHeight));
}

// Outlines of edits follow the drawn ground. They are read when they are first wanted, and anew for each version.
async function outlineEdits() {
  const { dataset } = state;
  const keyOf = ({ name, version }) => `${name} ${version}`;
  const key = keyOf(dataset);
  const isWanted = () => state.edits && key === keyOf(state.dataset) && Boolean(dataset.urls.edits);
  if (!isWanted()) return globe.overlay.setLine("edits", undefined);
  try {
    const { drawEdits, fetchEdits } = await import("/viewer/edit_outlines.js");
    if (state.editsOf?.key !== key) state.editsOf = { key, features: fetchEdits(dataset, access.headers) };
    const features = await state.editsOf.features;
    if (isWanted()) state.editsInView = drawEdits(globe.overlay, features, globe.viewTest(), (...at) => globe.heightAt(...at));
  } catch (error) {
    state.editsOf = undefined;
    panel.note(`The edits could not be read: ${error.message}.`);
    throw error;
  }
}

function setSwitches({ contours, wireframe, tiles3d, edits, imagery, right }) {
  Object.assign(state, { contours, wireframe, tiles3d, edits, imagery, right });
  globe.drape(imagery ? state.dataset : undefined, access.headers);
  globe.contours = contours;
  globe.wireframe = wireframe;
  globe.adaptToCamera();
  if (!contours) globe.overlay.setLabels([]);
  if (!edits) globe.overlay.setLine("edits", undefined);
  state.labelled = undefined;
  panel.setSwitches(state);
  remember();
}

function remember() {
  if (state.ready && !state.wanted) address.follow();
}

function fragmentOfView() {
  if (!state.ready || state.wanted) return undefined;
  return encodeView({ ...state, dataset: state.dataset.name, camera: globe.camera, exaggeration: globe.exaggeration, split: globe.split });
}

async function apply(view) {
  if (state.datasets.length === 0) return;
  const isLatest = views.begin();
  state.refreshing ??= setInterval(refresh, 400);
  const { isNamed, dataset, fraction } = startOf(view, state.datasets);
  state.wanted = view.dataset && !isNamed ? view : undefined;
  Object.assign(state, { dataset, fraction, isGone: false });
  globe.exaggeration = view.exaggeration ?? 1;
  panel.setExaggeration(globe.exaggeration);
  panel.splitter.place = globe.split = view.split;
  setSwitches(view);
  setColouring(view.colouring);
  setSun(view.sun);
  state.region = undefined;
  if (isNamed && view.camera) globe.camera = view.camera;
  else await lookAt(firstRegion(state.dataset), 0);
  if (!isLatest()) return;
  await show();
  if (!isLatest() || !state.wanted || tellPending()) return;
  if (state.moreWithToken) return ask(`${view.dataset} needs a token, or is not on this server.`);
  state.wanted = undefined;
  remember();
  complain(`There is no dataset ${view.dataset} on this server; this is ${state.dataset.name}.`);
}

function refresh() {
  state.drawn = globe.drawn();
  const isSplit = state.tiles3d || state.right !== undefined;
  panel.setStats(state.drawn, traffic, isSplit ? globe.tiles3d.drawn() : undefined, state.right !== undefined);
  panel.setInterval(state.contours ? globe.interval : 0);
  panel.setActivity(globe.loading ? "loading" : "");
  // The labels belong to one camera and one set of tiles. The tiles of another version have the same keys.
  const view = `${globe.camera} ${globe.exaggeration} ${globe.interval} ${globe.loads} ${state.drawn.keys}`;
  if (globe.loading) return;
  globe.lift();
  if (view === state.labelled) return;
  state.labelled = view;
  Promise.all([labelContours(), outlineEdits()]).catch(() => setTimeout(() => (state.labelled = undefined), kRetryMs));
}

// Throws UnknownToken. A reply to the token before does not count.
async function list() {
  const { token } = access;
  try {
    const found = await access.list();
    if (token === access.token) keep(found);
  } catch (error) {
    if (token === access.token) throw error;
  }
}

function keep({ datasets, preparing, moreWithToken }) {
  Object.assign(state, { datasets, preparing, moreWithToken });
  watch.isHasty = preparing.length > 0;
  panel.setDatasets(datasets, preparing, moreWithToken, state.dataset?.name);
}

async function useToken(token) {
  let found;
  try {
    found = await access.list(token);
  } catch (error) {
    return ask(error instanceof UnknownToken ? "The server does not know this token." : `That failed: ${error.message}.`);
  }
  access.token = token;
  state.isRefused = false;
  keep(found);
  if (state.datasets.length === 0) return ask(token ? "There is no dataset for this token." : "The datasets of this server need a token.");
  card.close();
  panel.setMessage(undefined);
  await apply(state.wanted ?? decodeView(location.hash));
}

async function read(position) {
  state.picked = position;
  panel.setReadout(position);
  if (!position) return;
  const height = await access.heightAt(state.dataset, position.longitude, position.latitude).catch(() => undefined);
  if (state.picked === position) panel.setReadout(position, height);
}

async function start() {
  panel.setActivity("loading");
  globe.onKey = pressKey;
  globe.onPick(read);
  globe.onSteer = () => state.ready && (state.region = undefined);
  onTheme((isLight) => (globe.isLight = isLight));
  globe.scene.camera.moveEnd.addEventListener(remember);
  globe.scene.canvas.addEventListener("webglcontextlost", () => panel.setLastMessage("The browser has dropped the picture. Reload the page."));
  addEventListener("hashchange", () => apply(decodeView(location.hash)));
  try {
    keep(await firstList);
  } catch (error) {
    complain(`The list of datasets could not be read: ${error.message}. Is the server running?`);
    watch.isLost = true;
    return watch.start();
  }
  watch.start();
  if (state.datasets.length > 0) return apply(decodeView(location.hash));
  tellEmpty();
}

window.terrace = { viewer: globe.widget, state, globe, traffic };
start();
