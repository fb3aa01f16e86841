"""Rolling restarts of three nodes under wrk and under clients that never retry: restart_test.py BINARY SOURCE_DIR.

Behind the ring, and behind a balancer that only asks /readyz, as that of Kubernetes. TERRACE_LONG_TESTS=1: twenty rounds.
Skipped (exit code 77) without nginx, openssl or wrk.
"""
import asyncio
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import cluster  # noqa: E402
from rolling import DELAY_SECONDS, Balancer, RollingTest, roll  # noqa: E402

RollingTest.binary = pathlib.Path(sys.argv.pop(1)).resolve()
sys.argv.pop(1)
ROUNDS = 20 if os.environ.get("TERRACE_LONG_TESTS") == "1" else 2


class Restarts(RollingTest):
    def wrk(self, url, targets, seconds):
        script = self.folder / "paths.lua"
        script.write_text("local paths = {" + ",".join(f'"{target}"' for target in targets) + "}\nlocal at = 0\n"
                          "request = function() at = at % #paths + 1; return wrk.format('GET', paths[at]) end\n")
        return subprocess.Popen(["wrk", "-t1", "-c8", f"-d{seconds}s", "--timeout", "30s", "-s", script, url], stdout=subprocess.PIPE, text=True)

    def check(self, statuses, seen, wrk):
        wrk.send_signal(signal.SIGINT)
        report = wrk.communicate(timeout=90)[0]
        self.assertEqual(statuses, [0] * (3 * ROUNDS), "each drain ends in time")
        self.assertEqual(seen.failures[:5], [], f"{len(seen.failures)} of {seen.replies} failed")
        self.assertEqual(seen.wrong, [])
        self.assertNotIn("Socket errors", report)
        self.assertNotIn("Non-2xx", report)
        requests = int(re.search(r"(\d+) requests in", report)[1])
        self.assertGreater(requests, 100)
        print(f"\n{3 * ROUNDS} restarts: {requests} requests of wrk and {seen.replies} of clients that never retry, 0 failed")

    def test_behind_the_ring(self):
        nodes = self.nodes()
        nginx = cluster.Nginx(self.folder, nodes).start()
        self.stack.callback(nginx.stop)
        # nginx's own copies would hide the nodes: every target is another one.
        fresh = [target for error in range(500, 20000, 7) for target in cluster.tiles(50, query=f"?error={error}")]
        wrk = self.wrk(f"https://localhost:{nginx.port}", fresh[:20000], 600)
        self.stack.callback(wrk.kill)
        seen = cluster.Seen()

        async def both():
            task = asyncio.ensure_future(roll(nodes, ROUNDS))
            await asyncio.gather(task, cluster.draw(nginx.port, 8, fresh[::-1], seen, until=task.done, pause=0.05))
            return task.result()
        self.check(asyncio.run(both()), seen, wrk)

    def test_behind_a_balancer_that_asks_readyz(self):
        nodes = self.nodes(drain_delay_s=DELAY_SECONDS)
        targets, seen = cluster.tiles(300), cluster.Seen()

        async def both():
            async with Balancer(nodes) as balancer:
                for node in nodes:
                    await balancer.wait_until_ready(node)
                wrk = self.wrk(f"http://127.0.0.1:{balancer.port}", targets, 600)
                self.stack.callback(wrk.kill)
                task = asyncio.ensure_future(roll(nodes, ROUNDS, balancer))
                await asyncio.gather(task, cluster.draw(balancer.port, 8, targets, seen, is_tls=False, until=task.done, pause=0.1))
                await asyncio.to_thread(self.check, task.result(), seen, wrk)
        asyncio.run(both())


if __name__ == "__main__":
    if missing := [tool for tool in ("nginx", "openssl", "wrk") if not shutil.which(tool)]:
        print(f"SKIPPED: restart_test needs {', '.join(missing)}; tools/install_deps.sh --test installs it")
        sys.exit(77)
    unittest.main()
