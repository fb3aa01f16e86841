"""A server that answers while it prepares a large source: preparing_test.py BINARY SOURCE_DIR.

The source is read over HTTP from a server of the test, which holds back the second half of the file as long as the test
wants. So every state lasts until the test has seen it.
"""
import array
import contextlib
import http.client
import json
import math
import os
import pathlib
import re
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()
sys.path.insert(0, str(SOURCE_DIR / "tests/load"))
from range_server import RangeServer  # noqa: E402

SAMPLE = SOURCE_DIR / "config/samples/jacksboro.tif"
SIDE = 3601
NAME = "hills.tif"
# Within the third of four rows of blocks of 1024 x 1024 samples. GDAL reads ahead, so that the second may be held as well.
HELD_FROM = 20_000_000
# Of 16 parts. How many are read by then depends on the two threads, and on what GDAL reads ahead for each.
PERCENT = "(?:6|12|18|25|31|37|43|50)"
TILES = ["/0/1/0.terrain", "/4/16/12.terrain", "/8/266/193.terrain", "/11/2130/1550.terrain", "/12/4266/3099.glb?compression=none"]
SAMPLE_TILE = "/jacksboro/9/272/359.terrain"


def write_large(path):
    """Writes a square degree of 1" hills as a GeoTIFF without compression, a row a strip. Rows are pieces of one long row:
    they differ, and are quick to write."""
    heights = array.array("h", (int(1000 + 400 * math.sin(i / 137) + 90 * math.sin(i / 11.3)) for i in range(4 * SIDE)))
    if sys.byteorder == "big":
        heights.byteswap()
    long_row, row_bytes = heights.tobytes(), 2 * SIDE
    short, long, double = "H", "I", "d"
    types = {short: 3, long: 4, double: 12}
    step = 1 / (SIDE - 1)
    samples_at = 65536  # behind the directory and its arrays
    tags = [(256, long, [SIDE]), (257, long, [SIDE]), (258, short, [16]), (259, short, [1]), (262, short, [1]),
            (273, long, [samples_at + row * row_bytes for row in range(SIDE)]), (277, short, [1]), (278, long, [1]),
            (279, long, [row_bytes] * SIDE), (339, short, [2]),
            (33550, double, [step, step, 0]), (33922, double, [0, 0, 0, 7, 47, 0]),
            (34735, short, [1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326])]
    arrays_at = 8 + 2 + 12 * len(tags) + 4
    entries, arrays = b"", b""
    for tag, kind, values in tags:
        packed = struct.pack(f"<{len(values)}{kind}", *values)
        if len(packed) > 4:
            value = struct.pack("<I", arrays_at + len(arrays))
            arrays += packed + bytes(-len(packed) % 8)
        else:
            value = packed.ljust(4, b"\0")
        entries += struct.pack("<HHI", tag, types[kind], len(values)) + value
    head = b"II*\0" + struct.pack("<IH", 8, len(tags)) + entries + bytes(4) + arrays
    assert len(head) <= samples_at
    with path.open("wb") as file:
        file.write(head.ljust(samples_at, b"\0"))
        for row in range(SIDE):
            first = 2 * (row * 7 % (2 * SIDE))
            file.write(long_row[first:first + row_bytes])


class Gate:
    """Holds back replies with bytes beyond HELD_FROM until it is opened."""

    def __init__(self, is_open=False):
        self.opened, self.fails = threading.Event(), False
        if is_open:
            self.opened.set()

    def pass_through(self, _, last):
        if last < HELD_FROM:
            return True
        self.opened.wait()
        return not self.fails

    def open(self):
        self.opened.set()


class Server:
    """`datasets`: by name the source. Ends with the block; `returncode` and `log` are known then."""

    def __init__(self, folder, prefix, datasets, *arguments):
        config = {"listen": "127.0.0.1:0", "cache_dir": str(folder / "cache"), "allowed_prefixes": [prefix], "drain_timeout_s": 5,
                  "access_log": "off", "log_level": "info", "datasets": [{"name": name, "sources": [str(source)]} for name, source in datasets.items()]}
        path = folder / "terrace.json"
        path.write_text(json.dumps(config))
        environment = os.environ | {"CPL_VSIL_CURL_CACHE_SIZE": "33554432"}
        self.process = subprocess.Popen([BINARY, "serve", "--config", path, *arguments], env=environment, stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True)
        self.lines, self.said = [], threading.Condition()
        self.reader = threading.Thread(target=self.read_log)
        self.reader.start()

    def read_log(self):
        for line in self.process.stderr:
            with self.said:
                self.lines.append(line)
                self.said.notify_all()
        with self.said:
            self.lines.append("")
            self.said.notify_all()

    @property
    def log(self):
        return "".join(self.lines)

    def wait_for(self, pattern):
        """The match in the log; fails if the process ends before."""
        with self.said:
            while not (found := re.search(pattern, self.log)):
                if self.lines and self.lines[-1] == "":
                    raise AssertionError(f"no {pattern} in:\n{self.log}")
                self.said.wait()
            return found

    def wait_until_it_answers(self):
        self.port = int(self.wait_for(r"127\.0\.0\.1:(\d+)/ answers; being prepared: \w+ \(\d+ %\)")[1])

    def wait_until_complete(self):
        line = self.process.stdout.readline()
        found = re.match(r"terrace: serving (\d+) datasets? at http://127\.0\.0\.1:(\d+)/$", line)
        if not found:
            raise AssertionError(f"{line}\n{self.log}")
        self.port = int(found[2])
        return int(found[1])

    def get(self, target):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        try:
            connection.request("GET", target)
            reply = connection.getresponse()
            return reply.status, dict(reply.getheaders()), reply.read()
        finally:
            connection.close()

    def text(self, target):
        status, _, body = self.get(target)
        return status, body.decode()

    def eventually(self, target, status, pattern):
        """Asks until the status is this one and the pattern is the whole text."""
        until = time.monotonic() + 120
        while not ((seen := self.text(target))[0] == status and re.fullmatch(pattern, seen[1])):
            if time.monotonic() > until:
                raise AssertionError(f"{target}: {seen}\n{self.log}")
            time.sleep(0.05)

    def tiles(self, name):
        replies = [self.get(f"/{name}{tile}") for tile in TILES]
        assert [status for status, *_ in replies] == [200] * len(TILES), (replies, self.log)
        return [(headers["ETag"], body) for _, headers, body in replies]

    def end(self):
        """Waits for the end of the process, and returns its code."""
        self.returncode = self.process.wait(120)
        self.reader.join()
        return self.returncode

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            self.end()
        self.reader.join()
        self.process.stdout.close()
        self.process.stderr.close()


class Preparing(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.dem = pathlib.Path(cls.scratch.name) / NAME
        write_large(cls.dem)
        oracle_folder = pathlib.Path(cls.scratch.name) / "oracle"
        oracle_folder.mkdir()
        with Server(oracle_folder, "/vsicurl/http://127.0.0.1/none/", {"hills": cls.dem, "jacksboro": SAMPLE}) as server:
            server.wait_until_complete()
            cls.oracle = server.tiles("hills")
            cls.sample_oracle = server.get(SAMPLE_TILE)[2]

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(dir=self.scratch.name))
        self.gate = Gate()

    @contextlib.contextmanager
    def remote(self):
        """The URL of the large source, and its server."""
        with RangeServer(self.scratch.name, lambda first, last: self.gate.pass_through(first, last)) as remote:
            self.prefix = f"/vsicurl/{remote.url}"
            try:
                yield self.prefix + NAME, remote
            finally:
                self.gate.open()

    def serve(self, datasets, *arguments):
        return Server(self.folder, self.prefix, datasets, *arguments)

    def expect_pending(self, server):
        server.eventually("/readyz", 200, f"degraded\ndataset hills: being prepared, {PERCENT} %\n")
        for target in ("/hills/layer.json", f"/hills{TILES[0]}", "/hills/tileset.json", "/hills/heights?locations=46.5,7.5"):
            status, headers, body = server.get(target)
            self.assertEqual((status, headers["Retry-After"], headers["Cache-Control"]), (503, "5", "no-store"), target)
            self.assertRegex(json.loads(body)["detail"], f"^this dataset is being prepared: {PERCENT} % of its sources is read$")
        status, _, body = server.get(SAMPLE_TILE)
        self.assertEqual((status, body == self.sample_oracle), (200, True))
        listed = json.loads(server.get("/datasets")[2])
        self.assertEqual([dataset["name"] for dataset in listed["datasets"]], ["jacksboro"])
        self.assertEqual([(pending["name"], bool(re.fullmatch(PERCENT, str(pending["percent"])))) for pending in listed["preparing"]], [("hills", True)])
        self.assertIn("\nterrace_degraded 1\n", server.text("/metrics")[1])

    def test_it_is_served_when_it_is_there_and_others_before(self):
        with self.remote() as (hills, remote):
            datasets = {"hills": hills, "jacksboro": SAMPLE}
            with self.serve(datasets) as server:
                server.wait_until_it_answers()
                self.expect_pending(server)
                # The pass ends after the block that it reads, and keeps those that it has read.
                server.process.send_signal(signal.SIGTERM)
                server.wait_for("stopping: SIGTERM")
                self.gate.open()
                self.assertEqual(server.end(), 0, server.log)
                self.assertEqual(server.process.stdout.read(), "", "it was never complete")

            self.gate = Gate()
            with self.serve(datasets) as server:
                server.wait_until_it_answers()
                server.wait_for(r"\d+ of 16 parts were prepared before")
                self.gate.open()
                self.assertEqual(server.wait_until_complete(), 2)
                self.assertEqual(server.text("/readyz"), (200, "ready\n"))
                self.assertNotIn("preparing", server.text("/datasets")[1])
                self.assertTrue(server.tiles("hills") == self.oracle, "the same bytes as with statistics from the beginning")

            before = remote.bytes
            self.gate = Gate(is_open=True)
            with self.serve(datasets) as server:
                self.assertEqual(server.wait_until_complete(), 2)
                self.assertNotIn("answers; being prepared", server.log)
                self.assertLess(remote.bytes - before, 1_000_000, "its statistics are kept")
                self.assertTrue(server.tiles("hills") == self.oracle)

    def test_a_reload_meanwhile_serves_what_is_there(self):
        with self.remote() as (hills, _):
            with self.serve({"hills": hills}) as server:
                server.wait_until_it_answers()
                server.eventually("/readyz", 503, f"opening\ndataset hills: being prepared, {PERCENT} %\n")
                config = json.loads((self.folder / "terrace.json").read_text())
                config["datasets"].append({"name": "jacksboro", "sources": [str(SAMPLE)]})
                (self.folder / "terrace.json").write_text(json.dumps(config))
                server.process.send_signal(signal.SIGHUP)
                self.expect_pending(server)
                self.gate.open()
                self.assertEqual(server.wait_until_complete(), 2)
                self.assertTrue(server.tiles("hills") == self.oracle)

    def test_alone_it_is_not_ready_and_its_page_is_there(self):
        with self.remote() as (hills, _):
            with self.serve({"hills": hills}, "--viewer", "false") as server:
                server.wait_until_it_answers()
                server.eventually("/readyz", 503, f"opening\ndataset hills: being prepared, {PERCENT} %\n")
                status, _, page = server.get("/")
                self.assertEqual(status, 200)
                self.assertRegex(page.decode(), f"hills: being prepared, {PERCENT} %")
                self.gate.open()
                self.assertEqual(server.wait_until_complete(), 1)
                self.assertEqual(server.text("/readyz"), (200, "ready\n"))

    def test_wrong_sources_end_the_start_before_any_is_read(self):
        wrong = self.folder / "wrong.tif"
        wrong.write_text("no raster")
        with self.remote() as (hills, remote):
            with self.serve({"hills": hills, "jacksboro": SAMPLE, "wrong": wrong}) as server:
                self.assertEqual(server.end(), 1)  # although the gate is closed
                self.assertRegex(server.log, "terrace: dataset wrong: .*wrong.tif")
                self.assertEqual(server.process.stdout.read(), "")
            self.assertLess(remote.bytes, 1_000_000)

    def test_only_geotiffs_are_read_over_the_network(self):
        # GDAL's driver for .hgt returns zeros where the network delivers nothing.
        (pathlib.Path(self.scratch.name) / "N46E007.hgt").write_bytes(bytes(2 * SIDE * SIDE))
        mosaic = self.folder / "mosaic.vrt"
        with self.remote():
            mosaic.write_text(f'''<VRTDataset rasterXSize="2" rasterYSize="2"><VRTRasterBand dataType="Int16" band="1"><SimpleSource>
                <SourceFilename>{self.prefix}N46E007.hgt</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>''')
            for source, message in ((f"{self.prefix}N46E007.hgt", "its format is SRTMHGT: only GeoTIFFs are read over the network"),
                                    (mosaic, "N46E007.hgt: only GeoTIFFs .* are read over the network")):
                with self.serve({"hills": source}, "--allowed-drivers", "GTiff,SRTMHGT,VRT") as server:
                    self.assertEqual(server.end(), 1)
                    self.assertRegex(server.log, message)

    def test_what_cannot_be_read_is_told_and_others_are_served(self):
        with self.remote() as (hills, _):
            self.gate.fails = True
            with self.serve({"hills": hills, "jacksboro": SAMPLE}) as server:
                server.wait_until_it_answers()
                self.gate.open()
                server.eventually("/readyz", 200, "degraded\ndataset hills: cannot be opened as its files are now; the log has the reason\n")
                status, headers, body = server.get("/hills/layer.json")
                self.assertEqual((status, headers["Retry-After"]), (503, "5"))
                self.assertIn(b"cannot be opened", body)
                self.assertEqual(server.get(SAMPLE_TILE)[0], 200)
                self.assertEqual(json.loads(server.get("/datasets")[2])["preparing"][0]["failed"], True)
                self.gate.fails = False  # tried again
                self.assertEqual(server.wait_until_complete(), 2)
                self.assertTrue(server.tiles("hills") == self.oracle)

    def test_what_cannot_be_read_ends_a_server_that_has_nothing_else(self):
        with self.remote() as (hills, _):
            self.gate.fails = True
            with self.serve({"hills": hills}) as server:
                server.wait_until_it_answers()
                self.gate.open()
                self.assertEqual(server.end(), 1)
                self.assertRegex(server.log, "terrace: dataset hills: .*hills.tif")


if __name__ == "__main__":
    unittest.main()
