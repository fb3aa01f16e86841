"""Versions of datasets, of the real binary: versions_test.py BINARY SOURCE_DIR.

Two servers with copies of one elevation model are replicas: all their replies about it are equal. A dataset that differs in a
sample, an option or the order of its sources has another version, and no cache keeps old bytes under the new version.
"""
import http.client
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

from srtm import SIDE, write_hgt

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()
NAME = "N46E007.hgt"
FOR_GOOD = "public, max-age=31536000, immutable"
GZIP = {"Accept-Encoding": "gzip"}


def set_sample(path, column, row, height):
    with open(path, "r+b") as file:
        file.seek(2 * (row * SIDE + column))
        file.write(height.to_bytes(2, "big", signed=True))


class Server:
    def __init__(self, config, folder):
        path = pathlib.Path(tempfile.mkdtemp(dir=folder)) / "terrace.json"
        path.write_text(json.dumps(config))
        self.log_path = path.with_name("log")
        with open(self.log_path, "w") as log:
            self.process = subprocess.Popen([BINARY, "serve", "--listen", "127.0.0.1:0", "--config", path],
                                            stdout=subprocess.PIPE, stderr=log, text=True)
        match = re.search(r"http://127\.0\.0\.1:(\d+)", self.process.stdout.readline())
        if not match:
            raise RuntimeError(f"did not start: {self.log_path.read_text()}")
        self.port = int(match.group(1))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(timeout=60)
        self.process.stdout.close()

    def get(self, target, headers={}):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        connection.request("GET", target, headers=headers)
        reply = connection.getresponse()
        body = reply.read()
        connection.close()
        return reply.status, reply.headers, body

    def json(self, target):
        status, _, body = self.get(target)
        assert status == 200, (target, status, body)
        return json.loads(body)

    def version(self):
        return self.json("/datasets")["datasets"][0]["version"]

    def log(self):
        return self.log_path.read_text()


class Versions(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        cls.dem = cls.folder / NAME
        write_hgt(cls.dem)
        cls.expected = cls.version_of(cls.dem)

    @classmethod
    def copy(cls, path, time_of=946684800):
        """Copies the file into another folder, with another inode and time."""
        copy = pathlib.Path(tempfile.mkdtemp(dir=cls.folder)) / path.name
        shutil.copyfile(path, copy)
        os.utime(copy, (time_of, time_of))
        return copy

    @classmethod
    def config(cls, *dems, server={}, **dataset):
        return {"datasets": [{"name": "alps", "sources": [str(dem) for dem in dems], **dataset}], **server}

    @classmethod
    def version_of(cls, *dems, **dataset):
        with Server(cls.config(*dems, **dataset), cls.folder) as server:
            return server.version()

    def test_replicas_on_copies_agree_on_everything(self):
        copy = self.copy(self.dem)
        cache = {"cache_dir": str(self.folder / "cache")}
        targets = ["/alps/layer.json", "/alps/layer.json?error=5", "/alps/tileset.json", "/alps/tileset.json?fraction=0.25",
                   "/datasets", "/alps/heights?locations=46.5,7.5", "/alps/heights?path=46.2,7.2|46.7,7.8&samples=9",
                   "/alps/mesh?bbox=7.4,46.4,7.5,46.5&error=20"]
        with Server(self.config(self.dem), self.folder) as one, Server(self.config(copy, server=cache), self.folder) as other:
            self.assertEqual(one.version(), other.version())
            version = one.version()
            self.assertRegex(version, "^[0-9a-f]{12}$")
            layer = one.json("/alps/layer.json")
            self.assertEqual(layer["version"], version)
            for z in (0, 5, 9, 11):
                ranges = layer["available"][z][0]
                x, y = (ranges["startX"] + ranges["endX"]) // 2, (ranges["startY"] + ranges["endY"]) // 2
                targets += [f"/alps/{z}/{x}/{y}.{form}" for form in (f"terrain?v={version}", "glb", "glb?compression=none")]
            x, y = 2 ** 8 * (180 + 7.5) // 360, 90
            targets += [f"/alps/8/{int(x)}/{y}.png?v={version}", "/alps/0/0/0.png"]
            root = one.json("/alps/tileset.json")["root"]
            first = root if "implicitTiling" in root else root["children"][0]
            targets.append("/alps/" + first["implicitTiling"]["subtrees"]["uri"].replace("{level}", "0").replace("{x}", "0")
                           .replace("{y}", "0"))
            for target in targets:
                for headers in ({}, GZIP):
                    a, b = one.get(target, headers), other.get(target, headers)
                    self.assertEqual((a[0], b[0]), (200, 200), target)
                    self.assertEqual(a[1]["ETag"], b[1]["ETag"], target)
                    self.assertIsNotNone(a[1]["ETag"], target)
                    self.assertEqual(a[2], b[2], target)
                    self.assertEqual(other.get(target, {**headers, "If-None-Match": a[1]["ETag"]})[0], 304, target)
        with Server(self.config(copy, server=cache), self.folder) as again:
            self.assertEqual(again.version(), version, "from the statistics cache")

    def test_one_sample_makes_another_version(self):
        for column, row in ((0, 0), (600, 600), (1200, 1200)):
            changed = self.copy(self.dem, os.stat(self.dem).st_mtime)
            set_sample(changed, column, row, 1777)
            self.assertNotEqual(self.version_of(changed), self.expected, (column, row))

    def test_every_option_that_changes_bytes_makes_another_version(self):
        seen = {self.expected: "none"}
        for option in ({"attribution": "a survey"}, {"error_fraction": 0.25}, {"finest_error": 3}, {"floor": -5}, {"max_void_gap": 8},
                       {"voids": "floor"}, {"feather": 50}, {"criterion": "data-dependent"}, {"compact": True},
                       {"glb_compression": "meshopt"}, {"draco_speed": 3}, {"draco_normal_bits": 10}, {"vertical": "ellipsoid"},
                       {"nodata": [1000]}, {"metadata_availability": 5}, {"water": {"sea_level": 700}},
                       {"water": {"mask": str(self.dem)}}):
            version = self.version_of(self.dem, **option)
            self.assertNotIn(version, seen, f"{option} as {seen.get(version)}")
            seen[version] = option
        self.assertEqual(self.version_of(self.dem, water={"mask": str(self.copy(self.dem))}),
                         self.version_of(self.copy(self.dem), water={"mask": str(self.dem)}))
        self.assertEqual(self.version_of(self.dem, public=True), self.expected, "who may see tiles changes none")

    def test_the_order_of_sources_counts(self):
        other = self.copy(self.dem)
        set_sample(other, 600, 600, 1)
        self.assertNotEqual(self.version_of(self.dem, other), self.version_of(other, self.dem))
        self.assertEqual(self.version_of(self.dem, other), self.version_of(self.copy(self.dem), self.copy(other)))

    def test_info_tells_the_version_that_would_be_served(self):
        for flags, options in (([], {}), (["--vertical", "ellipsoid"], {"vertical": "ellipsoid"})):
            printed = subprocess.run([BINARY, "info", "--json", *flags, self.copy(self.dem)], check=True, stdout=subprocess.PIPE).stdout
            self.assertEqual(json.loads(printed)[0]["version"], self.version_of(self.dem, **options))
        text = subprocess.run([BINARY, "info", self.dem], check=True, stdout=subprocess.PIPE, text=True).stdout
        self.assertRegex(text, rf"version +{self.expected}\n")

    def test_a_file_that_is_touched_stays_what_it_was(self):
        dem = self.copy(self.dem)
        with Server(self.config(dem), self.folder) as server:
            etag = server.get("/alps/layer.json")[1]["ETag"]
            os.utime(dem, (978307200, 978307200))
            self.wait_until(lambda: "is served now" in server.log())
            self.assertIn(f"version {self.expected}", server.log())
            self.assertEqual(server.get("/alps/layer.json", {"If-None-Match": etag})[0], 304)

    def test_a_replaced_source_is_another_version_from_the_next_document_on(self):
        dem = self.copy(self.dem)
        with Server(self.config(dem), self.folder) as server:
            def tile_of(layer):
                tiles = layer["available"][11][0]
                x, y = (tiles["startX"] + tiles["endX"]) // 2, (tiles["startY"] + tiles["endY"]) // 2
                return "/alps/" + layer["tiles"][0].replace("{z}", "11").replace("{x}", str(x)).replace("{y}", str(y))
            old_layer, old_tag = server.json("/alps/layer.json"), server.get("/alps/layer.json")[1]["ETag"]
            old = server.get(tile_of(old_layer))
            self.assertEqual(old[1]["Cache-Control"], FOR_GOOD)
            beside = dem.with_suffix(".new")
            write_hgt(beside, phase=1.0)
            os.utime(beside, (978307200, 978307200))
            os.rename(beside, dem)
            self.wait_until(lambda: server.version() != self.expected)
            status, headers, body = server.get("/alps/layer.json", {"If-None-Match": old_tag})
            self.assertEqual((status, headers["Cache-Control"]), (200, "no-cache"))
            layer = json.loads(body)
            self.assertNotEqual(tile_of(layer), tile_of(old_layer), "no cache by URL may answer with the old tile")
            new, late = server.get(tile_of(layer)), server.get(tile_of(old_layer))
            self.assertEqual(new[1]["Cache-Control"], FOR_GOOD)
            self.assertNotEqual(new[1]["ETag"], old[1]["ETag"])
            self.assertEqual(late[1]["Cache-Control"], "no-store", "the current bytes by an old name are not kept")
            self.assertEqual(late[2], new[2])
            self.assertRegex(server.log(), rf"served now, version {layer['version']}")
            metrics = server.get("/metrics")[2].decode()
            self.assertEqual(re.findall(r"terrace_dataset_info\{.*", metrics),
                             [f'terrace_dataset_info{{dataset="alps",version="{layer["version"]}"}} 1'])

    def wait_until(self, condition, seconds=20):
        end = time.monotonic() + seconds
        while not condition():
            self.assertLess(time.monotonic(), end, "nothing happened")
            time.sleep(0.05)


if __name__ == "__main__":
    unittest.main()
