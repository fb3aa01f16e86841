"""The disk cache of the built binary: disk_cache_test.py BINARY SOURCE_DIR.

Warm restarts, kill -9 under load, power cuts, a full disk, another program, another server. Every body is compared with that of a server
without a disk cache. With TERRACE_LONG_TESTS=1 there are a hundred kills and power cuts, and the disk is full for a minute.
"""
import collections
import hashlib
import http.client
import json
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()
DEM = SOURCE_DIR / "config/samples/jacksboro.tif"
LONG = os.environ.get("TERRACE_LONG_TESTS") == "1"
FORMS = [".terrain", ".terrain?extensions=octvertexnormals", ".glb", ".terrain?error=40", ".glb?error=90", ".terrain?error=300"]


class Server:
    def __init__(self, *flags, binary=BINARY):
        self.log = tempfile.TemporaryFile(mode="w+")
        began = time.monotonic()
        self.process = subprocess.Popen(
            [binary, "serve", DEM, "--name", "d", "--listen", "127.0.0.1:0", "--worker-threads", "2", "--log-level", "warn",
             "--viewer", "false", *map(str, flags)], stdout=subprocess.PIPE, stderr=self.log, text=True)
        line = self.process.stdout.readline()
        self.ready_s = time.monotonic() - began
        found = re.search(r":(\d+)/", line)
        if not found:
            raise RuntimeError(f"no server: {line!r} {self.text()}")
        self.port = int(found[1])

    def text(self):
        self.log.seek(0)
        return self.log.read()

    def get(self, path):
        client = Client(self.port)
        try:
            return client.get(path, coding="identity")
        finally:
            client.connection.close()

    def metric(self, name, tier, kind):
        metrics = self.get("/metrics")[1].decode()
        return float(re.search(rf'^{name}{{tier="{tier}",kind="{kind}"}} (\S+)$', metrics, re.M)[1])

    def wait_until_written(self, kind, count):
        deadline = time.monotonic() + 20
        while self.metric("terrace_cache_written_total", "disk", kind) < count and time.monotonic() < deadline:
            time.sleep(0.02)

    def kill(self):
        self.process.kill()
        self.end()

    def stop(self):
        self.process.terminate()
        return self.end()

    def end(self):
        code = self.process.wait(timeout=30)
        self.process.stdout.close()
        return code

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.kill()
        self.log.close()


class Client:
    def __init__(self, port):
        self.connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)

    def get(self, path, coding="gzip"):
        self.connection.request("GET", path, headers={"Accept-Encoding": coding})
        response = self.connection.getresponse()
        return response.status, response.read(), response.getheader("Server-Timing") or ""


def digest(body):
    return hashlib.sha256(body).hexdigest()


def crawl(port, paths):
    """Returns {path: digest}, the number of replies of each tier, and all statuses other than 200."""
    client, digests, tiers, wrong = Client(port), {}, collections.Counter(), []
    for path in paths:
        status, body, timing = client.get(path)
        digests[path] = digest(body)
        tiers[re.match(r"cache;desc=(\w+)", timing)[1] if status == 200 else status] += 1
        if status != 200:
            wrong.append((path, status))
    client.connection.close()
    return digests, tiers, wrong


class DiskCache(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with Server() as server:
            layer = json.loads(server.get("/d/layer.json")[1])
            tiles = [f"/d/{z}/{x}/{y}" for z, ranges in enumerate(layer["available"]) for r in ranges
                     for x in range(r["startX"], r["endX"] + 1) for y in range(r["startY"], r["endY"] + 1)]
            forms = [tile + form for tile in tiles for form in FORMS]
            random.Random(1).shuffle(forms)
            cls.paths = forms[:1000]
            cls.oracle, tiers, wrong = crawl(server.port, cls.paths)
            assert not wrong and tiers["disk"] == 0, (wrong, tiers)

    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.directory = pathlib.Path(self.scratch.name) / "cache"
        self.addCleanup(self.scratch.cleanup)

    def flags(self, directory=None):
        return "--disk-cache", directory or self.directory

    def test_first_thousand_tiles_after_a_restart_come_from_disk(self):
        with Server(*self.flags()) as server:
            self.assertEqual(crawl(server.port, self.paths)[0], self.oracle)
            self.assertEqual(server.stop(), 0)
            self.assertNotIn("disk cache", server.text())
        with Server(*self.flags()) as server:
            digests, tiers, _ = crawl(server.port, self.paths)
            self.assertEqual(digests, self.oracle)
            print(f"after a restart: {len(digests)} tiles, {dict(tiers)}", file=sys.stderr)
            self.assertGreaterEqual(tiers["disk"], 0.95 * len(self.paths), tiers)
            self.assertEqual(server.metric("terrace_cache_hits_total", "disk", "tiles"), tiers["disk"])
            self.assertEqual(server.metric("terrace_cache_damaged_total", "disk", "tiles"), 0)
            again = crawl(server.port, self.paths)[1]
            self.assertEqual(again["hit"], len(self.paths), again)

    def test_refinements_on_disk_serve_other_errors_without_the_source(self):
        fine = [path for path in self.paths if path.endswith(".terrain?error=40")][:40]
        coarse = [path for path in self.paths if path.endswith(".terrain?error=300")]
        coarse = [path for path in coarse if path.replace("=300", "=40") in fine] or [p.replace("=40", "=300") for p in fine]
        with Server() as server:
            wanted = crawl(server.port, coarse)[0]
        with Server(*self.flags()) as server:
            crawl(server.port, fine)
            server.stop()
        with Server(*self.flags()) as server:
            digests, tiers, _ = crawl(server.port, coarse)
            self.assertEqual(digests, wanted)
            self.assertEqual(tiers["miss"], len(coarse), tiers)
            self.assertEqual(server.metric("terrace_cache_hits_total", "disk", "refinements"), len(coarse))
            self.assertIn('terrace_refinements_total{use="made"} 0', server.get("/metrics")[1].decode())

    def load(self, port, stop, wrong, tiers):
        client, choice = Client(port), random.Random()
        try:
            while not stop.is_set():
                path = choice.choice(self.paths)
                status, body, timing = client.get(path)
                tiers[timing.split(",")[0]] += 1
                if status != 200 or digest(body) != self.oracle[path]:
                    wrong.append((path, status))
        except (OSError, http.client.HTTPException):
            pass  # killed
        finally:
            client.connection.close()

    def test_kill_9_under_load_leaves_nothing_wrong(self):
        rounds, wrong, tiers, ready = 100 if LONG else 6, [], collections.Counter(), []
        for number in range(rounds):
            # No memory cache: every tile is read from disk or built.
            with Server(*self.flags(), "--cache-bytes", 0, "--refinement-cache-bytes", 0) as server:
                ready.append(server.ready_s)
                stop = threading.Event()
                threads = [threading.Thread(target=self.load, args=(server.port, stop, wrong, tiers)) for _ in range(3)]
                for thread in threads:
                    thread.start()
                if number == 0:
                    server.wait_until_written("tiles", 1)
                time.sleep(random.Random(number).uniform(0.05, 0.8))
                server.kill()
                stop.set()
                for thread in threads:
                    thread.join()
        with Server(*self.flags()) as server:
            self.assertEqual(crawl(server.port, self.paths)[0], self.oracle)
        print(f"{rounds} kills: {sum(tiers.values())} answers {dict(tiers)}, {len(wrong)} wrong, "
              f"ready in {max(ready):.2f} s at most", file=sys.stderr)
        self.assertEqual(wrong, [])
        self.assertGreater(tiers["cache;desc=disk"], 0, tiers)
        self.assertGreater(tiers["cache;desc=miss"], 0, tiers)

    def test_a_power_cut_leaves_nothing_wrong(self):
        """A copy of the image below the file system has only what the file system has written by itself, as after a power cut."""
        if shutil.which("mkfs.ext4") is None:
            self.skipTest("needs mkfs.ext4 of e2fsprogs")
        folder = pathlib.Path(self.scratch.name)
        image, cut, disk, after = folder / "image", folder / "cut", folder / "disk", folder / "after"
        with open(image, "wb") as file:
            file.truncate(192 << 20)
        subprocess.run(["mkfs.ext4", "-q", image], check=True)
        self.mount(image, disk)
        wrong, tiers, recovered = [], collections.Counter(), collections.Counter()
        cuts = 100 if LONG else 4
        for number in range(cuts):
            with Server("--disk-cache", disk / "cache", "--cache-bytes", 0, "--refinement-cache-bytes", 0) as server:
                stop = threading.Event()
                threads = [threading.Thread(target=self.load, args=(server.port, stop, wrong, tiers)) for _ in range(3)]
                for thread in threads:
                    thread.start()
                time.sleep(random.Random(number).uniform(0.3, 2.5))
                server.process.send_signal(signal.SIGSTOP)
                shutil.copyfile(image, cut)
                server.kill()
                stop.set()
                for thread in threads:
                    thread.join()
            self.mount(cut, after)
            some = random.Random(number).sample(self.paths, 150)
            with Server("--disk-cache", after / "cache") as server:
                digests, found, failed = crawl(server.port, some)
                recovered += found
                wrong += failed + [path for path in some if digests[path] != self.oracle[path]]
            subprocess.run(["umount", after], check=True)
        print(f"{cuts} power cuts: {sum(tiers.values())} answers before and {sum(recovered.values())} after {dict(recovered)}, {len(wrong)} wrong",
              file=sys.stderr)
        self.assertEqual(wrong, [])
        self.assertGreater(recovered["disk"], 0, recovered)

    def mount(self, image, folder):
        folder.mkdir(exist_ok=True)
        # ext4 writes old data every second, so cuts find intermediate states.
        mounted = subprocess.run(["mount", "-o", "loop,commit=1", image, folder], capture_output=True, text=True)
        if mounted.returncode != 0:
            self.skipTest(f"no image can be mounted: {mounted.stderr.strip()}")
        self.addCleanup(subprocess.run, ["umount", "-l", folder], capture_output=True)

    def test_a_killed_server_has_lost_nothing_that_was_written(self):
        some = self.paths[:200]
        with Server(*self.flags()) as server:
            crawl(server.port, some)
            server.wait_until_written("tiles", len(some))
            server.kill()
        with Server(*self.flags()) as server:
            self.assertEqual(crawl(server.port, some)[1]["disk"], len(some))

    def test_a_full_disk_costs_no_request(self):
        disk = pathlib.Path(self.scratch.name) / "disk"
        disk.mkdir()
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64m", "tmpfs", disk], capture_output=True, text=True)
        if mounted.returncode != 0:
            self.skipTest(f"no file system can be mounted: {mounted.stderr.strip()}")
        self.addCleanup(subprocess.run, ["umount", "-l", disk])
        full_s = 60 if LONG else 5
        config = pathlib.Path(self.scratch.name) / "small.json"
        config.write_text(json.dumps({"disk_cache": {"directory": str(disk / "cache"), "tile_bytes": "16MiB",
                                                     "refinement_bytes": "16MiB"}}))
        with Server("--config", config, "--cache-bytes", 0, "--refinement-cache-bytes", 0) as server:
            self.assertEqual(crawl(server.port, self.paths[:100])[2], [])
            server.wait_until_written("tiles", 100)
            with open(disk / "filler", "wb", buffering=0) as filler:
                try:
                    while filler.write(bytes(4096)) > 0:
                        pass
                except OSError:
                    pass
            until, crawled = time.monotonic() + full_s, 0
            while time.monotonic() < until:
                digests, _, wrong = crawl(server.port, self.paths)
                self.assertEqual((digests, wrong), (self.oracle, []))
                crawled += 1
            # Preallocated space may be enough for all tiles, but not for refinements.
            self.assertEqual(server.metric("terrace_cache_on", "disk", "refinements"), 0)
            self.assertGreater(server.metric("terrace_cache_errors_total", "disk", "refinements"), 0)
            self.assertGreater(crawl(server.port, self.paths[:100])[1]["disk"], 90, "what is on a full disk can be read")
            self.assertIn("disk cache of refinements", server.text())
            (disk / "filler").unlink()
            before = server.metric("terrace_cache_written_total", "disk", "refinements")
            freed = time.monotonic()
            while server.metric("terrace_cache_on", "disk", "refinements") == 0 and time.monotonic() < freed + 20:
                time.sleep(0.05)
            recovered_s = time.monotonic() - freed
            digests, _, wrong = crawl(server.port, self.paths)
            self.assertEqual((digests, wrong), (self.oracle, []))
            server.wait_until_written("refinements", before + 1)
            written = server.metric("terrace_cache_written_total", "disk", "refinements")
            print(f"full for {full_s} s: {crawled * len(self.paths)} answers, 0 failed, storing again after {recovered_s:.1f} s",
                  file=sys.stderr)
            self.assertGreater(written, before)
            self.assertLess(recovered_s, 15)  # the aim is 5 s, but test machines are slow

    def test_another_program_finds_none_of_its_tiles(self):
        build_id = re.search(r"Build ID: (\w+)", subprocess.run(["readelf", "-n", BINARY], capture_output=True, text=True).stdout)
        self.assertIsNotNone(build_id, "the program has a build id")
        old = bytes.fromhex(build_id[1])
        program = BINARY.read_bytes()
        self.assertEqual(program.count(old), 1)
        other = pathlib.Path(self.scratch.name) / "terrace"
        other.write_bytes(program.replace(old, bytes(reversed(old))))
        other.chmod(0o755)
        some = self.paths[:50]
        with Server(*self.flags()) as server:
            crawl(server.port, some)
            server.stop()
        with Server(*self.flags(), binary=other) as server:
            self.assertEqual(crawl(server.port, some)[1]["disk"], 0)
            server.stop()
        with Server(*self.flags()) as server:
            self.assertEqual(crawl(server.port, some)[1]["disk"], len(some))

    def test_other_options_find_none_of_its_tiles(self):
        some = self.paths[:50]
        with Server(*self.flags()) as server:
            crawl(server.port, some)
            server.stop()
        with Server(*self.flags(), "--compact", "true") as server:
            self.assertEqual(crawl(server.port, some)[1]["disk"], 0)

    def refused(self, directory):
        result = subprocess.run([BINARY, "serve", DEM, "--listen", "127.0.0.1:0", "--disk-cache", directory], capture_output=True,
                                text=True, timeout=60)
        self.assertEqual((result.returncode, result.stdout), (1, ""))
        return result.stderr

    def test_a_second_server_is_refused(self):
        with Server(*self.flags()):
            self.assertEqual(self.refused(self.directory), f"terrace: disk_cache: {self.directory} is used by another process; "
                             "give each server a directory of its own\n")
        with Server(*self.flags()) as server:  # the lock ended with the process
            self.assertEqual(server.get("/livez")[0], 200)

    def test_what_is_no_directory_is_refused(self):
        file = pathlib.Path(self.scratch.name) / "file"
        file.write_text("")
        self.assertIn(f"terrace: disk_cache: {file}/cache cannot be made: {file}: Not a", self.refused(file / "cache"))
        self.assertIn(f"terrace: disk_cache: {file} cannot be used: Not a directory", self.refused(file))

    def test_a_damaged_store_is_begun_anew(self):
        some = self.paths[:50]
        with Server(*self.flags()) as server:
            crawl(server.port, some)
            server.stop()
        for file in (self.directory / "tiles").iterdir():
            if file.name != "LOCK":
                file.write_bytes(b"\xa5" * file.stat().st_size)
        with Server(*self.flags()) as server:
            digests, tiers, wrong = crawl(server.port, some)
            self.assertEqual((digests, wrong, tiers["disk"]), ({path: self.oracle[path] for path in some}, [], 0))
            self.assertIn("too damaged to be opened, begun anew", server.text())
            server.stop()
        shutil.rmtree(self.directory)

    def test_a_store_that_ended_two_starts_is_thrown_away(self):
        some = self.paths[:50]
        with Server(*self.flags()) as server:
            crawl(server.port, some)
            server.stop()
        foreign = self.directory / "tiles" / "0"  # a tile pyramid of another program
        foreign.mkdir()
        (foreign / "0.png").write_text("dear")
        for unfinished, found in ((1, len(some)), (2, 0)):
            (self.directory / "lock").write_bytes(b"." * unfinished)
            with Server(*self.flags()) as server:
                self.assertEqual(crawl(server.port, some)[1]["disk"], found, unfinished)
                self.assertEqual((self.directory / "lock").stat().st_size, 0)
                self.assertEqual("the last 2 starts ended" in server.text(), found == 0)
                server.stop()
        self.assertEqual((foreign / "0.png").read_text(), "dear")
        shutil.rmtree(self.directory)


if __name__ == "__main__":
    unittest.main()
