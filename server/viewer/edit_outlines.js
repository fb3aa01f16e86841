// Outlines of a dataset's edits on the drawn ground.
const kMaxDrawn = 2000;  // features in view
const kPieces = 8;  // of an edge, so that it follows the ground
const kMaxPoints = 60000;

// The features of /{dataset}/edits.geojson. Throws if the server does not answer.
export async function fetchEdits(dataset, headers) {
  const reply = await fetch(`${dataset.urls.edits}?v=${dataset.version}`, { headers });
  if (!reply.ok) throw new Error(`the server answered ${reply.status}`);
  return (await reply.json()).features;
}

function subdivided(line, pieces) {
  return line.flatMap(([longitude, latitude], i) => {
    const next = line[i + 1];
    if (!next) return [[longitude, latitude]];
    return Array.from({ length: pieces }, (_, k) => [
      longitude + ((next[0] - longitude) * k) / pieces, latitude + ((next[1] - latitude) * k) / pieces,
    ]);
  });
}

// The box of a line: [west, south, east, north]. A line may have more places than a call may have arguments.
function boxOf(line) {
  return line.reduce(([west, south, east, north], [longitude, latitude]) =>
    [Math.min(west, longitude), Math.min(south, latitude), Math.max(east, longitude), Math.max(north, latitude)],
  [Infinity, Infinity, -Infinity, -Infinity]);
}

// Places that are drawn at no height, as in a hole, take the height of the place before them.
function onGround(places, heightAt) {
  const heights = places.map((at) => heightAt(...at));
  let height = heights.find((value) => value !== undefined) ?? 0;
  return places.map(([longitude, latitude], i) => ({ longitude, latitude, height: (height = heights[i] ?? height) }));
}

// Draws the features in view. `isInView(box)`; `heightAt(longitude, latitude)`: of the drawn ground, undefined where nothing
// is drawn. Returns how many there are in view.
export function drawEdits(overlay, features, isInView, heightAt) {
  const seen = features.filter(({ geometry }) => geometry.coordinates.some((line) => isInView(boxOf(line))));
  const drawn = seen.slice(0, kMaxDrawn);
  const corners = drawn.reduce((sum, { geometry }) => sum + geometry.coordinates.reduce((n, line) => n + line.length, 0), 0);
  const pieces = corners * kPieces < kMaxPoints ? kPieces : 1;
  overlay.setLine("edits", drawn.flatMap(({ properties, geometry }) => geometry.coordinates.map((line) => ({
    className: `edit ${properties.op}`,
    points: onGround(subdivided(line, pieces), heightAt),
  }))));
  return seen.length;
}
