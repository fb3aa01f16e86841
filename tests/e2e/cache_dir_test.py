"""Where the real binary stores the statistics of sources, and its behaviour without such a folder: cache_dir_test.py BINARY SOURCE_DIR."""
import http.client
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest

from srtm import write_hgt

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()
VARIABLES = ("CACHE_DIRECTORY", "XDG_CACHE_HOME", "HOME")


def kept_in(folder):
    return sorted(path.name for path in folder.glob("*.statistics*")) if folder.is_dir() else []


class Server:
    def __init__(self, environment, *arguments):
        self.log_file = tempfile.TemporaryFile("w+")
        self.process = subprocess.Popen([BINARY, "serve", "--listen", "127.0.0.1:0", *map(str, arguments)], env=environment,
                                        stdout=subprocess.PIPE, stderr=self.log_file, text=True)
        ready = re.search(r"127\.0\.0\.1:(\d+)", self.process.stdout.readline())
        self.port = int(ready[1]) if ready else None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(30)
        self.process.stdout.close()
        self.log_file.close()

    def log(self):
        self.log_file.seek(0)
        return self.log_file.read()

    def get(self, target):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        try:
            connection.request("GET", target)
            reply = connection.getresponse()
            return reply.status, reply.read()
        finally:
            connection.close()

    def tiles(self):
        """Some tiles of each level."""
        levels = json.loads(self.get("/N46E007/layer.json")[1])["available"]
        bodies = []
        for level, ranges in enumerate(levels):
            for box in ranges:
                for x in sorted({box["startX"], (box["startX"] + box["endX"]) // 2, box["endX"]}):
                    status, body = self.get(f"/N46E007/{level}/{x}/{(box['startY'] + box['endY']) // 2}.terrain")
                    assert status == 200, (level, x, status)
                    bodies.append(body)
        return bodies

    def wait_for_state(self, state):
        until = time.monotonic() + 20
        while not (body := self.get("/readyz")[1].decode()).startswith(state) and time.monotonic() < until:
            time.sleep(0.1)
        return body


class CacheDir(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.dem = pathlib.Path(cls.scratch.name) / "N46E007.hgt"
        write_hgt(cls.dem)
        with Server(cls.environment(), cls.dem, "--cache-dir", "none", "--cache-bytes", "0") as server:
            cls.oracle = server.tiles()

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    @staticmethod
    def environment(**variables):
        return {key: value for key, value in os.environ.items() if key not in VARIABLES} | {
            key: str(value) for key, value in variables.items()}

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(dir=self.scratch.name))

    def serve(self, *arguments, environment=None):
        return Server(environment or self.environment(), self.dem, "--cache-bytes", "0", *arguments)

    def test_the_default_place_is_that_of_the_environment(self):
        service, xdg, home = (self.folder / name for name in ("service", "xdg", "home"))
        for variables, place in (
                ({"CACHE_DIRECTORY": f"{service}:/second", "XDG_CACHE_HOME": xdg, "HOME": home}, service),
                ({"XDG_CACHE_HOME": xdg, "HOME": home}, xdg / "terrace"),
                ({"XDG_CACHE_HOME": "relative", "HOME": home}, home / ".cache/terrace")):
            with self.subTest(place=place.name):
                environment = self.environment(**variables)
                self.assertEqual(kept_in(place), [])
                with self.serve(environment=environment) as server:
                    self.assertEqual(server.get("/readyz")[1], b"ready\n")
                    self.assertIn(f"cache_dir: {place}, for up to 8192 MiB", server.log())
                    self.assertEqual(len(kept_in(place)), 1)
                written = (place / kept_in(place)[0]).stat().st_ino
                done = subprocess.run([BINARY, "info", self.dem], env=environment, capture_output=True, text=True, timeout=60)
                self.assertEqual((done.returncode, done.stderr), (0, ""))
                self.assertEqual([(place / name).stat().st_ino for name in kept_in(place)], [written], "info uses the same file")

    def test_without_a_place_and_switched_off_averages_are_in_memory(self):
        unusable = self.environment(HOME="/dev/null")
        for arguments, environment, why in (((), self.environment(), "neither CACHE_DIRECTORY"), ((), unusable, "/dev/null"),
                                            (("--cache-dir", "none"), None, "configuration"), (("--cache-dir", ""), None, "configuration"),
                                            (("--cache-dir-bytes", "0"), None, "configuration")):
            with self.subTest(arguments=arguments, why=why):
                xdg = self.environment(XDG_CACHE_HOME=self.folder)
                with self.serve(*arguments, environment=environment or xdg) as server:
                    self.assertRegex(server.log(), f"cache_dir: none, .*{why}")
                    self.assertEqual(server.get("/readyz")[1], b"ready\n", "nobody asked for it")
                self.assertEqual(list(self.folder.iterdir()), [])

    def test_bytes_are_those_without_it(self):
        for _ in ("made", "loaded"):
            with self.serve("--cache-dir", self.folder) as server:
                self.assertTrue(server.tiles() == self.oracle)
        self.assertEqual(len(kept_in(self.folder)), 1)

    def expect_degraded(self, folder, reason, *arguments):
        with self.serve("--cache-dir", folder, *arguments) as server:
            body = server.get("/readyz")[1].decode()
            self.assertRegex(body, f"\\Adegraded\ncache_dir: .*{reason}.*in memory")
            self.assertNotIn(str(self.folder), body, "names no file")
            self.assertEqual(len(re.findall(f"cache_dir {folder}", server.log())), 1, server.log())
            self.assertTrue(server.tiles() == self.oracle)
            self.assertIn("\nterrace_degraded 1\n", server.get("/metrics")[1].decode())

    def test_a_file_in_its_place_is_told(self):
        (self.folder / "file").write_text("x")
        self.expect_degraded(self.folder / "file", "Not a directory")

    def test_a_bound_that_is_too_small_is_told(self):
        self.expect_degraded(self.folder, "cache_dir_bytes", "--cache-dir-bytes", "1000")
        self.assertEqual(kept_in(self.folder), [])

    def mount(self, size):
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", self.folder], capture_output=True, text=True)
        if mounted.returncode != 0:
            self.skipTest(f"no file system can be mounted: {mounted.stderr.strip()}")
        self.addCleanup(subprocess.run, ["umount", "-l", self.folder])

    def test_a_full_disk_is_told(self):
        self.mount("256k")
        self.expect_degraded(self.folder, "No space left on device")
        self.assertEqual(kept_in(self.folder), [])

    def test_a_disk_that_may_not_be_written_to_is_told_unless_it_has_what_is_wanted(self):
        self.mount("16m")
        subprocess.run(["mount", "-o", "remount,ro", self.folder], check=True)
        self.expect_degraded(self.folder, "Read-only file system")
        subprocess.run(["mount", "-o", "remount,rw", self.folder], check=True)
        with self.serve("--cache-dir", self.folder):
            pass
        subprocess.run(["mount", "-o", "remount,ro", self.folder], check=True)
        with self.serve("--cache-dir", self.folder) as server:
            self.assertEqual(server.get("/readyz")[1], b"ready\n")
            self.assertTrue(server.tiles() == self.oracle)

    def test_one_that_vanishes_is_made_again_or_told(self):
        place = self.folder / "cache"
        with self.serve("--cache-dir", place) as server:
            for path in place.iterdir():
                path.unlink()
            self.assertTrue(server.tiles() == self.oracle)
            until = time.monotonic() + 20
            while not kept_in(place) and time.monotonic() < until:
                time.sleep(0.1)
            self.assertEqual(len(kept_in(place)), 1)
            self.assertEqual(server.wait_for_state("ready"), "ready\n")
            self.assertTrue(server.tiles() == self.oracle)
        with self.serve("--cache-dir", place) as server:
            place.rename(self.folder / "elsewhere")
            place.write_text("x")
            self.assertTrue(server.tiles() == self.oracle)
            self.assertRegex(server.wait_for_state("degraded"), "cache_dir: .*in memory")
            until = time.monotonic() + 20
            while "is served now" not in server.log() and time.monotonic() < until:
                time.sleep(0.1)
            self.assertRegex(server.get("/readyz")[1].decode(), "Not a directory")
            self.assertTrue(server.tiles() == self.oracle)


if __name__ == "__main__":
    unittest.main()
