"""Archives, of the real binary: archive_test.py BINARY SOURCE_DIR.

What an archive gives is what building gives, byte for byte, with sources and without; a damaged archive never gives a
wrong byte.
"""
import functools
import gzip
import http.client
import http.server
import json
import os
import pathlib
import re
import signal
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import unittest

from srtm import write_hgt

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()
NAME = "N46E007.hgt"
LEVELS = range(0, 11)
QUANTIZED = {"Accept": "application/vnd.quantized-mesh;extensions=octvertexnormals-watermask-metadata"}
SAME = ("ETag", "Terrain-Max-Error", "Terrain-Certified-Error", "Content-Type", "Content-Encoding", "Cache-Control", "Vary")


class Server:
    def __init__(self, config, folder, *arguments):
        path = pathlib.Path(tempfile.mkdtemp(dir=folder)) / "terrace.json"
        path.write_text(json.dumps(config))
        self.log_path = path.with_name("log")
        with open(self.log_path, "w") as log:
            self.process = subprocess.Popen(
                [BINARY, "serve", "--listen", "127.0.0.1:0", "--cache-bytes", "0", "--config", path, *arguments],
                stdout=subprocess.PIPE, stderr=log, text=True)
        match = re.search(r"http://127\.0\.0\.1:(\d+)", self.process.stdout.readline())
        if not match:
            raise RuntimeError(f"did not start: {self.log_path.read_text()}")
        self.port = int(match.group(1))
        self.connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        self.version = json.loads(self.get("/datasets", {"Accept-Encoding": "identity"})[2])["datasets"][0]["version"]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(timeout=60)
        self.process.stdout.close()
        self.connection.close()

    def get(self, target, headers={}):
        self.connection.request("GET", target, headers={"Accept-Encoding": "gzip", **headers})
        reply = self.connection.getresponse()
        return reply.status, reply.headers, reply.read()

    def tier(self, target, headers={}):
        return re.match(r"cache;desc=(\w+)", self.get(target, headers)[1]["Server-Timing"])[1]

    def log(self):
        return self.log_path.read_text()


class Bucket(http.server.SimpleHTTPRequestHandler):
    """Files over HTTP with ranges, as an object store serves them."""

    def do_GET(self):
        try:
            data = pathlib.Path(self.translate_path(self.path)).read_bytes()
        except OSError:
            return self.send_error(404)
        asked = re.match(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        self.send_response(206 if asked else 200)
        self.send_header("Accept-Ranges", "bytes")
        if asked:
            first, last = int(asked[1]), min(int(asked[2]), len(data) - 1)
            self.send_header("Content-Range", f"bytes {first}-{last}/{len(data)}")
            data = data[first:last + 1]
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_):
        pass


class ArchiveTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.scratch = pathlib.Path(scratch.name)
        write_hgt(cls.scratch / NAME)
        cls.options = {"name": "cell", "sources": [str(cls.scratch / NAME)], "water": {"sea_level": 500},
                       "metadata_availability": 4, "finest_error": 30, "attribution": "nobody"}
        cls.place = cls.scratch / "baked"
        config = cls.scratch / "bake.json"
        config.write_text(json.dumps({"datasets": [cls.options]}))
        done = subprocess.run([BINARY, "bake", "--config", config, "--out", cls.place, "--format", "terrain,glb,png",
                               "--extensions", "octvertexnormals,watermask,metadata"], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr

    def serve(self, *arguments, **options):
        return Server({"datasets": [{**self.options, **options}]}, self.scratch, *arguments)

    def serve_alone(self, place=None):
        return Server({"datasets": [{"name": "cell", "baked": str(place or self.place)}]}, self.scratch)

    def tiles(self):
        for folder, suffix in (("terrain", "terrain"), ("glb", "glb"), ("png", "png")):
            manifest = json.loads((self.place / folder / "manifest.json").read_text())
            for level, ranges in enumerate(manifest["available"]):
                for west, south, east, north in ranges:
                    for x in range(west, east + 1):
                        for y in range(south, north + 1):
                            yield f"/cell/{level}/{x}/{y}.{suffix}?v={manifest['dataset']['version']}"

    def copy(self):
        place = pathlib.Path(tempfile.mkdtemp(dir=self.scratch)) / "baked"
        shutil.copytree(self.place, place)
        return place

    def expect_same(self, target, headers, live, *others):
        wanted = live.get(target, headers)
        self.assertEqual(wanted[0], 200, target)
        for other in others:
            found = other.get(target.replace(live.version, other.version), headers)
            self.assertEqual((found[0], found[2]), (200, wanted[2]), target)
            for name in SAME:
                self.assertEqual(found[1][name], wanted[1][name], f"{target} {name}")

    def expect_same_document(self, target, live, *others):
        """The same apart from the version, which is that of the archives if there are no sources."""
        wanted = gzip.decompress(live.get(target)[2]).decode()
        self.assertIn(live.version, wanted)
        for other in others:
            found = gzip.decompress(other.get(target.replace(live.version, other.version))[2]).decode()
            self.assertEqual(found.replace(other.version, live.version), wanted, target)

    def test_every_tile_and_document_equals_what_building_gives(self):
        with self.serve() as live, self.serve(baked=str(self.place)) as both, self.serve_alone() as alone:
            count = 0
            for target in self.tiles():
                headers = QUANTIZED if ".terrain" in target else {}
                self.expect_same(target, headers, live, both, alone)
                self.assertEqual(both.tier(target, headers), "archive")
                if count % 40 == 0 and headers:
                    for names in ("", "octvertexnormals", "watermask", "metadata", "watermask-metadata"):
                        some = {"Accept": f"application/vnd.quantized-mesh;extensions={names}"} if names else {}
                        self.expect_same(target, some, live, both, alone)
                        self.assertEqual(both.tier(target, some), "archive")
                if count % 40 == 0:
                    for coding in ("identity", "br", "zstd", "gzip;q=0.5, br"):
                        self.expect_same(target, {**headers, "Accept-Encoding": coding}, live, both, alone)
                count += 1
            self.assertGreater(count, 500)
            for document in ("layer.json", "tileset.json"):
                self.expect_same(f"/cell/{document}", {}, live, both)
                self.expect_same_document(f"/cell/{document}", live, alone)
            text = gzip.decompress(live.get("/cell/tileset.json")[2]).decode()
            template = re.search(r'"(3dtiles/[^"]*?/)\{level\}/\{x\}/\{y\}(\.\d+\.subtree[^"]*)"', text)
            self.expect_same(f"/cell/{template[1]}0/0/0{template[2]}", {}, live, both, alone)

    def test_what_was_not_baked_is_built_or_404_with_the_reason(self):
        plain = "/cell/5/33/24.terrain"
        with self.serve(baked=str(self.place)) as both, self.serve_alone() as alone:
            self.assertEqual(both.tier(plain + "?error=3", QUANTIZED), "miss")
            for target, reason in ((plain + "?error=3", "one error"), ("/cell/heights?locations=46.5,7.5", "sources"),
                                   ("/cell/mesh?bbox=7.1,46.1,7.2,46.2&error=50", "sources"),
                                   ("/cell/5/33/24.glb?compression=none", "compression"),
                                   # Documents promise no tile that the archive lacks.
                                   ("/cell/layer.json?error=3", "one error"), ("/cell/layer.json?fraction=0.1", "one error"),
                                   ("/cell/tileset.json?fraction=0.1", "one error"), ("/cell/tileset.json?compression=none", "compression"),
                                   ("/cell/grid?surface=source&bbox=7.3,46.3,7.32,46.32&width=3&height=3", "sources"),
                                   ("/cell/sight?surface=source&from=46.3,7.3,900&to=46.32,7.33,900", "sources")):
                status, _, body = alone.get(target, {"Accept-Encoding": "identity"})
                self.assertEqual((status, reason in body.decode()), (404, True), (target, body))
            self.assertEqual(both.get("/cell/heights?locations=46.5,7.5")[0], 200)

    def test_heights_of_the_tiles_are_those_of_the_sources_as_drawn(self):
        """Without sources, heights, grids and rays are read from the archive's tiles: what a server with sources says of the drawn surface."""
        box = "bbox=7.3,46.3,7.32,46.32&width=33&height=33"
        with self.serve() as live, self.serve_alone() as alone:
            level = len(json.loads(gzip.decompress(live.get("/cell/layer.json")[2]))["available"]) - 1
            points = "|".join(f"{46.3 + 0.0007 * i},{7.3 + 0.00091 * i}" for i in range(40))
            for target in (f"/cell/heights?surface=served&normals=1&locations={points}",
                           f"/cell/heights?surface=served&level={level - 2}&locations={points}", f"/cell/grid?surface=served&format=json&{box}",
                           f"/cell/grid?surface=served&format=f32&{box}", "/cell/sight?surface=served&from=46.3,7.3,900&to=46.32,7.33,900",
                           "/cell/sight?surface=served&heights=ground&from=46.3,7.3,2&to=46.31,7.31,2"):
                wanted, found = live.get(target, {"Accept-Encoding": "identity"}), alone.get(target, {"Accept-Encoding": "identity"})
                self.assertEqual((wanted[0], found[0], found[2]), (200, 200, wanted[2]), target)
                without = target.replace("surface=served&", "")
                if "/heights?" not in target:  # grids and rays have no other surface here
                    self.assertEqual(alone.get(without, {"Accept-Encoding": "identity"})[2], wanted[2], without)
            for target, reason in ((f"/cell/heights?surface=served&format=glb&locations={points}", "leave out the parameter format"),
                                   (f"/cell/heights?surface=served&error=3&locations={points}", "one error"),
                                   (f"/cell/grid?datum=orthometric&{box}", "")):
                status, _, body = alone.get(target)
                self.assertIn(status, (400, 404), target)
                self.assertIn(reason, body.decode(), target)
        with self.serve_alone(self.place / "glb") as alone:
            status, _, body = alone.get(f"/cell/grid?{box}")
            self.assertEqual((status, "has none" in body.decode()), (404, True), body)

    def test_serve_place(self):
        with Server({"datasets": []}, self.scratch, str(self.place / "glb")) as server:
            self.assertEqual(server.get("/cell/tileset.json")[0], 200)
            status, _, body = server.get("/cell/layer.json")
            self.assertEqual((status, "no .terrain tiles" in body.decode()), (404, True), body)
            self.assertEqual(server.get("/cell/tiles.json")[0], 404)
            self.assertEqual(server.get("/cell/0/0/0.terrain")[0], 404)
            self.assertEqual(server.get("/readyz")[0], 200)
            self.assertEqual(server.get("/metrics")[0], 200)

    def test_files_of_archives_are_told(self):
        folder = self.place / "glb"
        for name in ["top.pmtiles", *(f"units/{path.name}" for path in (folder / "units").iterdir())][:2]:
            done = subprocess.run([BINARY, "serve", folder / name, "--check-config"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60)
            self.assertEqual((done.returncode, f"name its folder: terrace serve {folder}" in done.stdout), (2, True), done.stdout)
        done = subprocess.run([BINARY, "serve", "/tmp/not-there.pmtiles", "--check-config"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=60)
        self.assertNotEqual(done.returncode, 0)

    def test_single_file_and_folder(self):
        single, folder = self.scratch / "one.pmtiles", self.scratch / "static"
        for form, out in (("single", single), ("folder", folder)):
            done = subprocess.run([BINARY, "bake", "--config", self.scratch / "bake.json", "--out", out, "--form", form,
                                   "--extensions", "octvertexnormals,watermask,metadata"], capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
        with self.serve() as live, Server({"datasets": []}, self.scratch, single) as server:
            for target in self.tiles():
                if ".terrain" not in target:
                    continue
                self.expect_same(target, QUANTIZED, live, server)
                stored = (folder / target[len("/cell/"):].split("?")[0]).read_bytes()
                self.assertEqual(stored, server.get(target, QUANTIZED)[2])
            self.expect_same_document("/cell/layer.json", live, server)
            self.assertEqual((folder / "layer.json").read_bytes(), gzip.decompress(server.get("/cell/layer.json")[2]))

    def test_levels_that_edits_add_have_metadata_where_tiles_lie_below(self):
        box = [[7.2, 46.2], [7.201, 46.2], [7.201, 46.201], [7.2, 46.201], [7.2, 46.2]]
        (self.scratch / "precise.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [
            {"type": "Feature", "properties": {"terrain": {"op": "precision", "error_m": 20}},
             "geometry": {"type": "Polygon", "coordinates": [box]}}]}))
        options = {"name": "cell", "sources": [str(self.scratch / NAME)], "edits": [str(self.scratch / "precise.geojson")],
                   "metadata_availability": 1, "finest_error": 160}
        config, place = self.scratch / "precise.json", self.scratch / "precise"
        config.write_text(json.dumps({"datasets": [options]}))
        done = subprocess.run([BINARY, "bake", "--config", config, "--out", place, "--format", "terrain", "--extensions", "metadata"],
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        manifest = json.loads((place / "manifest.json").read_text())
        finest = manifest["dataset"]["finest_level"]
        self.assertGreater(len(manifest["available"]), finest + 2)
        headers = {"Accept": "application/vnd.quantized-mesh;extensions=metadata"}
        counts = {True: 0, False: 0}
        with Server({"datasets": [options]}, self.scratch) as live, self.serve_alone(place) as alone:
            for level in range(finest - 1, len(manifest["available"])):
                for west, south, east, north in manifest["available"][level]:
                    for x in range(west, east + 1):
                        for y in range(south, north + 1):
                            target = f"/cell/{level}/{x}/{y}.terrain?v={manifest['dataset']['version']}"
                            self.expect_same(target, headers, live, alone)
                            status, fields, body = alone.get(target, headers)
                            stated, has = "metadata" in fields["Content-Type"], b'{"available":' in gzip.decompress(body)
                            self.assertEqual((status, stated), (200, has), target)
                            counts[has and level >= finest] += 1
        self.assertGreater(min(counts.values()), 8)

    def test_missing_archive_is_named_before_the_start(self):
        done = subprocess.run([BINARY, "serve", "--config", "/dev/stdin", "--check-config"], text=True, timeout=60,
                              input=json.dumps({"datasets": [{"name": "cell", "baked": "/nowhere/baked"}]}), capture_output=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("/nowhere/baked", done.stderr)

    def test_archive_of_another_version_is_not_used(self):
        version = json.loads((self.place / "terrain/manifest.json").read_text())["dataset"]["version"]
        with self.serve(baked=str(self.place), attribution="somebody") as server:
            self.assertEqual(server.tier("/cell/5/33/24.terrain", QUANTIZED), "miss")
            warnings = [line for line in server.log().splitlines() if "archive" in line and "not used" in line]
            self.assertEqual(len(warnings), 1, server.log())
            served = json.loads(server.get("/datasets", {"Accept-Encoding": "identity"})[2])["datasets"][0]["version"]
            self.assertIn(version, warnings[0])
            self.assertIn(served, warnings[0])

    def bake(self, name, *arguments, levels="0-5"):
        place = self.scratch / name
        done = subprocess.run([BINARY, "bake", "--config", self.scratch / "bake.json", "--out", place, "--levels", levels, *arguments],
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        return place

    def test_bakes_with_other_tiles_have_other_versions(self):
        bakes = [self.bake("coarse", "--error", "5000"), self.bake("fine", "--error", "50"),
                 self.bake("short", "--error", "5000", levels="0-4"), self.bake("normals", "--error", "5000", "--extensions", "octvertexnormals")]
        manifests = [json.loads((place / "manifest.json").read_text()) for place in bakes]
        self.assertEqual(len({manifest["dataset"]["generation"] for manifest in manifests}), 1)
        versions = []
        for place in bakes:
            with self.serve_alone(place) as server:
                versions.append(server.version)
                self.assertIn(server.version, gzip.decompress(server.get("/cell/layer.json")[2]).decode())
        self.assertEqual(len(set(versions)), 4, versions)
        with self.serve_alone(self.bake("coarse.pmtiles", "--error", "5000", "--form", "single")) as server:
            self.assertEqual(server.version, versions[0])

    def test_archives_with_other_errors_are_not_one_dataset(self):
        place = self.copy()
        shutil.rmtree(place / "glb")
        self.bake("meshes", "--error", "5000", "--format", "glb").rename(place / "glb")
        config = json.dumps({"datasets": [{"name": "cell", "baked": str(place)}]})
        done = subprocess.run([BINARY, "serve", "--config", "/dev/stdin", "--listen", "127.0.0.1:0"], text=True, timeout=60,
                              input=config, capture_output=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn(f"{place}/terrain and {place}/glb have different errors", done.stderr)
        with self.serve(baked=str(place)) as server:  # the sources have what the archives lack
            self.assertEqual(server.tier("/cell/5/33/24.terrain", QUANTIZED), "archive")
            self.assertEqual(server.get("/cell/5/33/24.glb")[0], 200)

    def test_archive_that_comes_later_is_used(self):
        place = pathlib.Path(tempfile.mkdtemp(dir=self.scratch)) / "baked"
        with self.serve(baked=str(place)) as server:
            def wait_for(tier):
                end = time.monotonic() + 30
                while server.tier("/cell/4/16/12.terrain") != tier and time.monotonic() < end:
                    time.sleep(0.2)
                self.assertEqual(server.tier("/cell/4/16/12.terrain"), tier, server.log())
            wait_for("miss")
            self.copy().rename(place)
            wait_for("archive")
            place.rename(place.with_name("old"))
            wait_for("miss")
            self.bake("later.pmtiles", "--form", "single").rename(place)
            wait_for("archive")

    def test_damaged_file_is_built_or_503(self):
        place = self.copy()
        unit = place / "terrain/top.pmtiles"
        data = bytearray(unit.read_bytes())
        data[-1000] ^= 1
        unit.write_bytes(data)
        short = next((place / "terrain/units").iterdir())
        os.truncate(short, short.stat().st_size - 1)
        with self.serve() as live, self.serve(baked=str(place)) as both, self.serve_alone(place) as alone:
            broken = 0
            for target in self.tiles():
                if ".terrain" not in target:
                    continue
                self.expect_same(target, QUANTIZED, live, both)
                status, _, body = alone.get(target, QUANTIZED)
                self.assertIn(status, (200, 503))
                if status == 200:
                    self.assertEqual(body, live.get(target, QUANTIZED)[2])
                broken += status == 503
            self.assertGreater(broken, 1)
            for server in (both, alone):
                self.assertIn("top.pmtiles is damaged", server.log())
                self.assertIn(short.name, server.log())

    def test_archive_alone_that_lost_a_file_is_degraded_until_it_is_back(self):
        place = self.copy()
        unit = next((place / "png/units").glob("*.pmtiles"))  # terrain is opened at the start, for the tileset
        away, target = unit.with_suffix(".away"), f"/cell/{unit.stem.replace('-', '/')}.png"
        degraded = "degraded\ndataset cell: files of its archive are missing or cannot be read\n"
        with self.serve_alone(place) as server:
            self.assertEqual(server.get("/readyz")[2].decode(), "ready\n")
            unit.rename(away)
            self.assertEqual(server.get(target)[0], 503)
            self.assertEqual(server.get("/readyz")[2].decode(), degraded)
            end = time.monotonic() + 30
            while "is served now" not in server.log() and time.monotonic() < end:  # it opens the archive anew once
                time.sleep(0.1)
            self.assertEqual(server.get("/readyz")[2].decode(), degraded)
            with self.serve_alone(place) as other:
                self.assertEqual(other.get("/readyz")[2].decode(), degraded)
            away.rename(unit)
            self.assertEqual(server.get(target)[0], 200)
            self.assertEqual(server.get("/readyz")[2].decode(), "ready\n")

    def test_unfinished_archive(self):
        place = self.copy()
        for manifest in place.rglob("manifest.json"):
            manifest.unlink()
        with self.serve(baked=str(place)) as server:
            self.assertEqual(server.get("/cell/0/0/0.terrain")[0], 200)
            self.assertIn("has not finished", server.log())
        done = subprocess.run([BINARY, "serve", "--config", "/dev/stdin", "--listen", "127.0.0.1:0"], text=True, timeout=60,
                              input=json.dumps({"datasets": [{"name": "cell", "baked": str(place)}]}), capture_output=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("has not finished", done.stderr)

    def test_archive_that_is_baked_again_is_opened_again(self):
        place = self.copy()
        with self.serve_alone(place) as server:
            manifest = place / "terrain/manifest.json"
            changed = json.loads(manifest.read_text())
            changed["dataset"]["name"] = "other"
            del changed["checksum"]
            time.sleep(1.1)
            replacement = manifest.with_suffix(".new")
            replacement.write_text(json.dumps(changed))
            replacement.rename(manifest)
            end = time.monotonic() + 30
            while "is served now" not in server.log() and time.monotonic() < end:
                time.sleep(0.2)
            self.assertIn("is served now", server.log())
            self.assertEqual(server.get("/cell/0/0/0.terrain")[0], 200)

    def test_archive_in_a_bucket(self):
        bucket = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Bucket, directory=self.place))
        threading.Thread(target=bucket.serve_forever, daemon=True).start()
        self.addCleanup(bucket.server_close)
        self.addCleanup(bucket.shutdown)
        url = f"/vsicurl/http://127.0.0.1:{bucket.server_address[1]}/"
        datasets = [{"name": "cell", "baked": url + "terrain"}]
        with self.serve() as live, Server({"datasets": datasets, "allowed_prefixes": [url]}, self.scratch) as remote:
            for target in ("/cell/0/0/0.terrain", "/cell/5/33/24.terrain", "/cell/9/532/387.terrain"):
                self.expect_same(target, QUANTIZED, live, remote)
            self.assertEqual(remote.tier("/cell/5/33/24.terrain", QUANTIZED), "archive")
        done = subprocess.run([BINARY, "serve", "--config", "/dev/stdin", "--listen", "127.0.0.1:0"], text=True, timeout=60,
                              input=json.dumps({"datasets": datasets}), capture_output=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("allowed prefix", done.stderr)

    def test_archive_in_a_bucket_that_is_baked_again_is_opened_again(self):
        """Nothing watches its files: look-ups find that they are of another bake."""
        place = self.copy()
        bucket = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Bucket, directory=place))
        threading.Thread(target=bucket.serve_forever, daemon=True).start()
        self.addCleanup(bucket.server_close)
        self.addCleanup(bucket.shutdown)
        url = f"/vsicurl/http://127.0.0.1:{bucket.server_address[1]}/"
        other = self.bake("other-errors", "--error", "5000", levels="0-10")
        tile = "/cell/9/532/387.terrain"
        with self.serve_alone(other) as local:
            wanted = local.get(tile)[2]
        with Server({"datasets": [{"name": "cell", "baked": url + "terrain"}], "allowed_prefixes": [url]}, self.scratch) as remote:
            self.assertEqual(remote.get("/cell/0/0/0.terrain")[0], 200)  # of another file
            (place / "terrain").rename(place / "old")
            other.rename(place / "terrain")
            end = time.monotonic() + 60
            while remote.get(tile)[2] != wanted and time.monotonic() < end:
                time.sleep(0.2)
            self.assertEqual(remote.get(tile)[2], wanted, remote.log())
            self.assertIn("its archive is no longer the one that was opened", remote.log())
            self.assertNotEqual(json.loads(gzip.decompress(remote.get("/datasets")[2]))["datasets"][0]["version"], remote.version)

    def test_a_bucket_that_is_away_is_not_an_empty_one(self):
        class Away(http.server.BaseHTTPRequestHandler):
            status = 500

            def do_GET(self):
                self.send_error(self.status)
            do_HEAD = do_GET

            def log_message(self, *_):
                pass
        bucket = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Away)
        threading.Thread(target=bucket.serve_forever, daemon=True).start()
        url = f"/vsicurl/http://127.0.0.1:{bucket.server_address[1]}/"

        def serve():
            config = {"datasets": [{"name": "cell", "baked": url + "terrain"}], "allowed_prefixes": [url]}
            done = subprocess.run([BINARY, "serve", "--config", "/dev/stdin", "--listen", "127.0.0.1:0"], text=True, timeout=60,
                                  input=json.dumps(config), capture_output=True, env={**os.environ, "GDAL_HTTP_MAX_RETRY": "0"})
            self.assertEqual(done.returncode, 1)
            return done.stderr
        self.assertRegex(serve(), r"manifest\.json cannot be looked up now: HTTP response code: 500")
        Away.status = 404
        self.assertIn("has no manifest.json", serve())
        bucket.shutdown()
        bucket.server_close()
        self.assertIn("manifest.json cannot be looked up now", serve())

    def test_python_reader(self):
        reader = SOURCE_DIR / "docs/formats/read_archive.py"
        with self.serve_alone() as server:
            for suffix, level, x, y in (("terrain", 0, 1, 0), ("terrain", 9, 532, 387), ("glb", 5, 33, 24), ("png", 8, 132, 90)):
                status, _, wanted = server.get(f"/cell/{level}/{x}/{y}.{suffix}", {"Accept-Encoding": "identity", **QUANTIZED})
                self.assertEqual(status, 200, (suffix, level, x, y))
                read = subprocess.run([sys.executable, reader, self.place / suffix, str(level), str(x), str(y)],
                                      capture_output=True, check=True).stdout
                self.assertEqual(read, wanted)
            done = subprocess.run([sys.executable, reader, self.place / "terrain", "9", "0", "0"], capture_output=True, text=True)
            self.assertNotEqual(done.returncode, 0)


if __name__ == "__main__":
    unittest.main()
