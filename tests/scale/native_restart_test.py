"""Rolling restarts of three nodes under cesium-native, which never asks again for a tile that failed: native_restart_test.py BINARY SOURCE_DIR.

TERRACE_NATIVE_CLIENT: a host program of cesium-native, called as
    PROGRAM URL flight --cam LON,LAT,HEIGHT,HEADING,PITCH --speed M/S --seconds S --fps N --sse PIXELS --cachemb MB --simul N --limit S
It flies, and prints "requests N status 200:N ..." (negative: no reply) and "tileset load errors N". TERRACE_LONG_TESTS=1: twenty rounds.
Skipped (exit code 77) without the client, nginx or openssl.
"""
import asyncio
import os
import pathlib
import re
import shutil
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import cluster  # noqa: E402
from rolling import DELAY_SECONDS, Balancer, RollingTest, roll  # noqa: E402

RollingTest.binary = pathlib.Path(sys.argv.pop(1)).resolve()
sys.argv.pop(1)
CLIENT = os.environ.get("TERRACE_NATIVE_CLIENT", "")
IS_LONG = os.environ.get("TERRACE_LONG_TESTS") == "1"
ROUNDS = 20 if IS_LONG else 1
CLIENTS = 3
FLIGHT_SECONDS = 40 if IS_LONG else 5


class Flights:
    """Clients that fly one flight after the other, each over ground that nobody has seen."""

    def __init__(self, url):
        self.url, self.flown, self.requests, self.failures = url, 0, 0, []

    async def fly(self, until):
        while not until():
            number = self.flown
            self.flown += 1
            lon, lat = -179 + number * 67.3 % 358, -60 + number * 37.7 % 120
            process = await asyncio.create_subprocess_exec(
                CLIENT, self.url, "flight", "--cam", f"{lon:.3f},{lat:.3f},60000,{45 + number * 90},-30", "--speed", "30000", "--seconds",
                str(FLIGHT_SECONDS), "--fps", "12", "--sse", "2", "--cachemb", "8", "--simul", "20", "--limit", "5", "--threads", "4",
                stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT)
            out = (await process.communicate())[0].decode(errors="replace")
            last = re.findall(r"requests (\d+) status ((?:-?\d+:\d+ )*)", out)
            errors = re.search(r"tileset load errors (\d+)", out)
            if process.returncode != 0 or not last or not errors:
                self.failures.append(f"flight {number} ended with {process.returncode}: {out[-2000:]}")
                continue
            requests, statuses = int(last[-1][0]), last[-1][1].split()
            self.requests += requests
            if statuses != [f"200:{requests}"] or errors[1] != "0" or "FAILED TILE" in out:
                self.failures.append(f"flight {number}: {statuses} of {requests}: {out[:2000]}")

    async def fly_while(self, task):
        await asyncio.gather(task, *(self.fly(task.done) for _ in range(CLIENTS)))
        return task.result()


class NativeRestarts(RollingTest):
    def check(self, statuses, flights):
        self.assertEqual(statuses, [0] * (3 * ROUNDS), "each drain ends in time")
        self.assertEqual(flights.failures, [])
        self.assertGreater(flights.requests, 100)
        print(f"\n{3 * ROUNDS} restarts: {flights.requests} requests of {flights.flown} flights, 0 failed")

    def test_behind_the_ring(self):
        nodes = self.nodes()
        nginx = cluster.Nginx(self.folder, nodes, is_tls=False).start()
        self.stack.callback(nginx.stop)
        flights = Flights(f"http://127.0.0.1:{nginx.port}/earth/layer.json")

        async def both():
            return await flights.fly_while(asyncio.ensure_future(roll(nodes, ROUNDS)))
        self.check(asyncio.run(both()), flights)
        log = (nginx.folder / "access.log").read_text().splitlines()
        replies = [(match[1], match[2]) for match in (re.search(r'" (\d+) \d+ .* (\S+)$', line) for line in log) if match]
        self.assertEqual({status for status, _ in replies}, {"200"})
        of_nodes = sum(node != "-" for _, node in replies)
        self.assertGreater(of_nodes, 100, "nginx answers all from its cache")
        print(f"{of_nodes} of {len(replies)} replies are of nodes, the others of nginx's cache")

    def test_behind_a_balancer_that_asks_readyz(self):
        nodes = self.nodes(drain_delay_s=DELAY_SECONDS)

        async def both():
            async with Balancer(nodes) as balancer:
                for node in nodes:
                    await balancer.wait_until_ready(node)
                flights = Flights(f"http://127.0.0.1:{balancer.port}/earth/layer.json")
                self.check(await flights.fly_while(asyncio.ensure_future(roll(nodes, ROUNDS, balancer))), flights)
        asyncio.run(both())


if __name__ == "__main__":
    if not CLIENT:
        print("SKIPPED: native_restart_test needs TERRACE_NATIVE_CLIENT, a host program of cesium-native")
        sys.exit(77)
    if missing := [tool for tool in (CLIENT, "nginx", "openssl") if not shutil.which(tool)]:
        print(f"SKIPPED: native_restart_test needs {', '.join(missing)}")
        sys.exit(77)
    unittest.main()
