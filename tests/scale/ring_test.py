"""Three nodes behind the ring that docker/cluster ships: ring_test.py BINARY SOURCE_DIR.

A cold storm, a node that is killed, a node that is added, and data that changes node by node, under clients that never retry; only while
nginx itself is reloaded they do as libcurl does. TERRACE_LONG_TESTS=1: 5,000 tiles from 64 connections. Skipped (exit code 77) without nginx or openssl.
"""
import asyncio
import collections
import contextlib
import http.server
import json
import os
import pathlib
import shutil
import signal
import sys
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import cluster  # noqa: E402

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "e2e"))
from srtm import write_hgt  # noqa: E402

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
sys.argv.pop(1)
IS_LONG = os.environ.get("TERRACE_LONG_TESTS") == "1"
TILES, CONNECTIONS = (5000, 64) if IS_LONG else (600, 32)


class Ring(unittest.TestCase):
    def setUp(self):
        stack = contextlib.ExitStack()
        self.addCleanup(stack.close)
        self.stack, self.folder = stack, stack.enter_context(cluster.scratch())

    def node(self, datasets):
        node = cluster.Node(BINARY, self.folder, datasets)
        self.stack.callback(node.stop, signal.SIGKILL)
        return node.start()

    def ring(self, nodes, changes=()):
        nginx = cluster.Nginx(self.folder, nodes, changes=changes).start()
        self.stack.callback(nginx.stop)
        return nginx

    def draw(self, nginx, targets, seen, during=None, is_curl=False):
        """Draws the targets once; with `during`, a coroutine, around and around until it ends."""
        async def both():
            if during is None:
                return await cluster.draw(nginx.port, CONNECTIONS, targets, seen)
            task = asyncio.ensure_future(during)
            await asyncio.gather(task, cluster.draw(nginx.port, CONNECTIONS, targets, seen, until=task.done, is_curl=is_curl))
        asyncio.run(both())

    def assert_all_good(self, seen):
        self.assertEqual(seen.failures[:5], [], f"{len(seen.failures)} of {seen.replies} failed")
        self.assertEqual(seen.wrong[:5], [])

    @staticmethod
    def builds(nodes):
        return [node.sum_of("terrace_tile_builds_total") for node in nodes]

    def test_what_every_node_refuses_is_503_and_the_rest_is_answered(self):
        class Refusing(http.server.BaseHTTPRequestHandler):
            protocol_version, wbufsize = "HTTP/1.1", 4096

            def do_GET(self):
                self.send_response(503 if self.path.startswith("/big/") else 200)
                self.send_header("Retry-After", "5")
                self.send_header("Cache-Control", "no-store")
                self.send_header("Content-Length", "2")
                self.end_headers()
                self.wfile.write(b"ok")

            def log_message(self, *_):
                pass
        servers = [http.server.ThreadingHTTPServer(("127.0.0.1", 0), Refusing) for _ in range(3)]
        for server in servers:
            server.daemon_threads, server.port = True, server.server_address[1]
            threading.Thread(target=server.serve_forever, daemon=True).start()
        replies = collections.Counter()

        async def draw(nginx):
            client = cluster.Client(nginx.port)
            for i in range(100):
                for dataset in ("big", "earth"):
                    status, fields, _ = await client.get(f"/{dataset}/9/{i}/1.terrain")
                    replies[dataset, status, fields.get("retry-after")] += 1
            client.close()
        asyncio.run(draw(self.ring(servers)))
        self.assertEqual(replies, {("big", 503, "5"): 100, ("earth", 200, "5"): 100})
        replies.clear()
        for server in servers:
            server.shutdown()
            server.server_close()
        asyncio.run(draw(self.ring(servers)))
        self.assertEqual(replies, {("big", 503, "1"): 100, ("earth", 503, "1"): 100})

    def test_a_cold_storm_builds_each_tile_once(self):
        nodes = [self.node(cluster.earth()) for _ in range(3)]
        nginx, seen = self.ring(nodes), cluster.Seen()
        version = nodes[0].version()
        self.assertEqual({node.version() for node in nodes}, {version})
        targets = [target for target in cluster.tiles(TILES, query=f"?v={version}") for _ in (1, 2)]  # two clients each, at a time
        begun = time.monotonic()
        self.draw(nginx, targets, seen)
        seconds = time.monotonic() - begun
        self.assert_all_good(seen)
        builds = self.builds(nodes)
        self.assertEqual(sum(builds), TILES, builds)
        self.assertGreater(min(builds), TILES / 9, "each node has its part")
        print(f"\n{seen.replies} replies for {TILES} cold tiles from {CONNECTIONS} connections in {seconds:.1f} s: {builds} builds by node")

    def test_formats_and_errors_of_a_tile_are_on_one_node(self):
        nodes = [self.node(cluster.earth()) for _ in range(3)]
        nginx, seen = self.ring(nodes), cluster.Seen()
        plain = cluster.tiles(40)
        forms = [target.replace(".terrain", suffix) for target in plain for suffix in (".terrain", ".terrain?error=2000", ".glb")]
        self.draw(nginx, forms, seen)
        self.assert_all_good(seen)
        node_of = nginx.node_of()
        by_tile = collections.defaultdict(set)
        for path, node in node_of.items():
            by_tile[path.rpartition(".")[0]].add(node)
        self.assertEqual(len(by_tile), 40)
        self.assertEqual({len(found) for found in by_tile.values()}, {1})
        self.assertEqual(len(set(node_of.values())), 3)

    def test_a_killed_node_costs_no_reply_and_moves_its_keys_alone(self):
        nodes = [self.node(cluster.earth()) for _ in range(3)]
        nginx, seen = self.ring(nodes), cluster.Seen()
        self.draw(nginx, cluster.tiles(TILES), seen)
        before = nginx.node_of()

        async def kill():
            await asyncio.sleep(0.5)
            nodes[1].process.send_signal(signal.SIGKILL)
            await asyncio.sleep(2.5)
        # Other errors, so that nginx has no copies and asks the nodes.
        everything = [target for error in (1000, 2000, 4000) for target in cluster.tiles(TILES, query=f"?error={error}")]
        self.draw(nginx, everything, seen, kill())
        self.draw(nginx, cluster.tiles(TILES, query="?error=3000"), seen)
        self.assert_all_good(seen)
        self.check_moves(before, nginx.node_of(), lost=f"127.0.0.1:{nodes[1].port}", gained=None, share=1 / 3)

    def test_a_node_that_hangs_costs_no_reply(self):
        nodes = [self.node(cluster.earth()) for _ in range(3)]
        # In less time than 35 and 80 s.
        nginx, seen = self.ring(nodes, [("proxy_read_timeout 35s", "proxy_read_timeout 2s"),
                                        ("proxy_next_upstream_timeout 80s", "proxy_next_upstream_timeout 5s")]), cluster.Seen()
        nodes[1].process.send_signal(signal.SIGSTOP)
        self.draw(nginx, cluster.tiles(60), seen)
        self.assert_all_good(seen)
        self.assertEqual(seen.replies, 60)

    def test_an_added_node_costs_no_reply_and_takes_keys_alone(self):
        nodes = [self.node(cluster.earth()) for _ in range(3)]
        nginx, seen = self.ring(nodes), cluster.Seen()
        self.draw(nginx, cluster.tiles(TILES), seen)
        before = nginx.node_of()
        nodes.append(self.node(cluster.earth()))

        async def add():
            await asyncio.sleep(0.5)
            nginx.reload(nodes)
            await asyncio.sleep(2.5)
        everything = [target for error in (1000, 2000, 4000) for target in cluster.tiles(TILES, query=f"?error={error}")]
        # nginx closes idle connections at once when it reloads, so clients do here what HTTP asks of them, and libcurl does.
        self.draw(nginx, everything, seen, add(), is_curl=True)
        print(f"\n{seen.repeated} of {seen.replies} requests crossed the closing of an idle connection, and were sent again")
        self.draw(nginx, cluster.tiles(TILES, query="?error=3000"), seen)
        self.assert_all_good(seen)
        self.check_moves(before, nginx.node_of(), lost=None, gained=f"127.0.0.1:{nodes[3].port}", share=1 / 4)

    def check_moves(self, before, after, lost, gained, share):
        moved = {path for path, node in before.items() if after[path] != node}
        for path in moved:
            self.assertEqual(before[path] if lost else after[path], lost or gained, "no other key moves")
        if lost:
            self.assertNotIn(lost, after.values())
        print(f"\n{len(moved)} of {len(before)} keys moved ({len(moved) / len(before):.1%}; 1/N is {share:.1%})")
        self.assertLess(abs(len(moved) / len(before) - share), 0.12)

    def test_data_that_changes_node_by_node_is_never_mixed(self):
        """An outside checker has the bytes of both versions, from servers that have only one of them each."""
        old, new = self.folder / "old", self.folder / "new"
        for folder, phase in ((old, 0.0), (new, 1.0)):
            folder.mkdir()
            write_hgt(folder / "N46E007.hgt", phase=phase)

        def alps(folder):
            return [{"name": "alps", "sources": [str(folder / "N46E007.hgt")]}]
        oracles = [self.node(alps(folder)) for folder in (old, new)]
        versions = [node.version() for node in oracles]
        paths = self.paths_of(oracles[0])
        expected = {(version, path): node.get(path) for node, version in zip(oracles, versions) for path in paths}
        folders = [self.folder / f"data{i}" for i in range(3)]
        for folder in folders:
            folder.mkdir()
            shutil.copy(old / "N46E007.hgt", folder)
        nodes = [self.node(alps(folder)) for folder in folders]
        nginx = self.ring(nodes)
        state = {"done": False, "kept": {}, "fresh": 0, "late": 0, "failures": [], "wrong": []}
        self.run_change(nginx, nodes, folders, new / "N46E007.hgt", versions, paths, expected, state)
        self.assertEqual(state["failures"][:5], [])
        self.assertEqual(state["wrong"][:5], [])
        self.assertEqual([node.version() for node in nodes], [versions[1]] * 3)
        self.assertGreater(state["fresh"], 100)
        self.assertEqual({version for version, _ in state["kept"]}, set(versions), "tiles of both versions were kept for good")
        print(f"\n{state['fresh']} tiles in the version asked for, {state['late']} from a node of the other version (no-store); "
              f"{len(state['kept'])} URLs kept for good, all right")

    @staticmethod
    def paths_of(node):
        layer = json.loads(node.get("/alps/layer.json"))
        paths = []
        for z, ranges in enumerate(layer["available"]):
            for part in ranges:
                paths += [f"/alps/{z}/{x}/{y}.terrain" for x in range(part["startX"], part["endX"] + 1)
                          for y in range(part["startY"], part["endY"] + 1)]
        return paths[:300]

    def run_change(self, nginx, nodes, folders, source, versions, paths, expected, state):
        async def viewer(number):
            client = cluster.Client(nginx.port)
            while not state["done"]:
                try:
                    status, fields, layer = await client.get("/alps/layer.json")
                    if status != 200:
                        state["failures"].append(f"layer.json: {status}")
                        continue
                    version = json.loads(cluster.plain(fields, layer))["version"]
                    for path in paths[number::8][:20]:
                        await self.check(client, path, version, versions, expected, state)
                except cluster.Failed as error:
                    state["failures"].append(str(error))
            client.close()

        async def change():
            await asyncio.sleep(1)
            for node, folder in zip(nodes, folders):
                beside = folder / "beside"
                shutil.copy(source, beside)
                os.utime(beside, (978307200, 978307200))
                os.rename(beside, folder / "N46E007.hgt")
                end = time.monotonic() + 30
                while await asyncio.to_thread(node.version) != versions[1]:
                    self.assertLess(time.monotonic(), end, "the change is not seen")
                    await asyncio.sleep(0.05)
                await asyncio.sleep(0.5)
            state["done"] = True
        async def both():
            await asyncio.gather(change(), *(viewer(i) for i in range(8)))
            # What a cache would have kept for good is still right, and so is every tile now.
            client = cluster.Client(nginx.port)
            for path in paths:
                await self.check(client, path, versions[1], versions, expected, state)
            client.close()
        asyncio.run(both())

    @staticmethod
    async def check(client, path, version, versions, expected, state):
        status, fields, body = await client.get(f"{path}?v={version}")
        if status != 200:
            state["failures"].append(f"{path}: {status}")
            return
        is_kept = cluster.FOR_GOOD in fields["cache-control"]
        body = cluster.plain(fields, body)
        if is_kept:
            state["fresh"] += 1
            state["kept"][version, path] = True
            if body != expected[version, path]:
                state["wrong"].append(f"{path}?v={version}: bytes of another version, for good")
        else:
            state["late"] += 1
            if fields["cache-control"] != "no-store" or body not in [expected[one, path] for one in versions if one != version]:
                state["wrong"].append(f"{path}?v={version}: {fields['cache-control']}, bytes of no or the wrong version")


if __name__ == "__main__":
    if missing := [tool for tool in ("nginx", "openssl") if not shutil.which(tool)]:
        print(f"SKIPPED: ring_test needs {', '.join(missing)}; tools/install_deps.sh --test installs it")
        sys.exit(77)
    unittest.main()
