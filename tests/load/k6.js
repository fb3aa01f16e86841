// For k6 (https://k6.io): viewers arrive at a rate that does not depend on the server. Each sends six requests of the
// walk at a time, as a browser does, and pauses.
//
//   terrace fly http://HOST:PORT/DATASET --circle LON,LAT,H,RADIUS --urls walk.txt
//   k6 run -e BASE=http://HOST:PORT -e WALK=$PWD/walk.txt -e VIEWERS=5 -e SECONDS=60 tests/load/k6.js
// VIEWERS: new viewers a second. 503 with Retry-After is allowed during overload and counted separately. Any other 5xx,
// and a request without a reply, fail the run.
import http from "k6/http";
import { check, sleep } from "k6";
import { Counter, Trend } from "k6/metrics";

const paths = open(__ENV.WALK).trim().split("\n");
const base = __ENV.BASE;
const refused = new Counter("refused");
const tile = new Trend("tile_duration", true);

export const options = {
  scenarios: {
    viewers: {
      executor: "constant-arrival-rate",
      rate: Number(__ENV.VIEWERS || 5),
      timeUnit: "1s",
      duration: `${__ENV.SECONDS || 60}s`,
      preAllocatedVUs: 50,
      maxVUs: 1000,
    },
  },
  thresholds: { checks: ["rate==1"] },
};

const REQUESTS_PER_VIEWER = 120;
const AT_ONCE = 6;

export default function () {
  let at = Math.floor(Math.random() * paths.length);
  for (let asked = 0; asked < REQUESTS_PER_VIEWER; asked += AT_ONCE) {
    const batch = [];
    for (let i = 0; i < AT_ONCE; i++, at++) {
      batch.push(["GET", base + paths[at % paths.length], null, { headers: { "Accept-Encoding": "gzip" } }]);
    }
    let wait = 0;
    for (const reply of http.batch(batch)) {
      const told = reply.status === 503 && Number(reply.headers["Retry-After"]) > 0;
      if (told) {
        refused.add(1);
        wait = Math.max(wait, Number(reply.headers["Retry-After"]));
      } else {
        tile.add(reply.timings.duration);
      }
      check(reply, { "200, or 503 with Retry-After": () => reply.status === 200 || told });
    }
    sleep(wait || 0.1);
  }
}
