"""terrace mesh of a DEM with edits and of an area, against a server's /mesh: mesh_area_test.py BINARY SOURCE_DIR."""
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import urllib.request

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SAMPLE = pathlib.Path(sys.argv.pop(1)).resolve() / "config/samples/jacksboro.tif"
BOX = "-84.23,36.28,-84.17,36.32"


def ring(west, south, east, north, *height):
    return [[[west, south, *height], [east, south, *height], [east, north, *height], [west, north, *height], [west, south, *height]]]


def feature(terrain, rings):
    return {"type": "Feature", "properties": {"terrain": terrain}, "geometry": {"type": "Polygon", "coordinates": rings}}


EDITS = {"type": "FeatureCollection", "features": [
    feature({"op": "flatten", "height": 400, "blend_m": 60}, ring(-84.21, 36.29, -84.20, 36.30)),
    feature({"op": "precision", "error_m": 1, "blend_m": 60}, ring(-84.215, 36.285, -84.195, 36.305)),
    feature({"op": "hole"}, ring(-84.19, 36.30, -84.18, 36.31))]}


def run(*arguments):
    return subprocess.run([str(BINARY), "mesh", *map(str, arguments)], capture_output=True, text=True, timeout=120)


class MeshOfAreas(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        cls.edits = cls.folder / "edits.geojson"
        cls.edits.write_text(json.dumps(EDITS))
        cls.server = subprocess.Popen([BINARY, "serve", SAMPLE, "--edits", cls.edits, "--listen", "127.0.0.1:0", "--log-level", "error",
                                       "--cache-dir", cls.folder / "cache"], stdout=subprocess.PIPE, text=True)
        cls.addClassCleanup(cls.stop)
        cls.base = re.search(r"http://[\d.:]+", cls.server.stdout.readline())[0] + "/jacksboro/mesh"

    @classmethod
    def stop(cls):
        cls.server.terminate()
        cls.server.stdout.close()
        cls.server.wait(60)

    def mesh(self, name, *arguments):
        out = self.folder / name
        result = run(SAMPLE, "--out", out, "--json", *arguments)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        return json.loads(result.stdout), out.read_bytes()

    def served(self, query):
        with urllib.request.urlopen(self.base + "?" + query, timeout=60) as reply:
            return reply.read(), reply.headers

    def test_is_the_mesh_that_a_server_makes(self):
        for form, coordinates in (("glb", "enu"), ("obj", "ecef"), ("ply", "geographic")):
            with self.subTest(format=form, coordinates=coordinates):
                statistics, data = self.mesh("a." + form, "--edits", self.edits, "--bbox", BOX, "--max-error", 8, "--coordinates", coordinates)
                served, headers = self.served(f"bbox={BOX}&error=8&format={form}&coordinates={coordinates}")
                self.assertEqual(data, served)
                self.assertEqual(statistics["edits"], 3)
                self.assertLessEqual(statistics["max_error"], float(headers["Terrain-Max-Error"]))
                self.assertGreater(statistics["triangles"], 1000)

    def test_edits_change_it(self):
        arguments = ("--bbox", BOX, "--max-error", 8)
        plain, before = self.mesh("plain.glb", *arguments)
        edited, after = self.mesh("edited.glb", "--edits", self.edits, *arguments)
        self.assertNotEqual(before, after)
        self.assertEqual((plain["edits"], edited["edits"]), (0, 3))
        self.assertAlmostEqual(edited["origin"][0], 36.30, 6)
        self.assertEqual(edited["criterion"], "delaunay")
        self.assertGreater(edited["peak_rss_bytes"], 1 << 20)

    def test_the_whole_raster_is_the_default(self):
        statistics, _ = self.mesh("whole.obj", "--edits", self.edits, "--max-error", 50)
        text = run(SAMPLE, "--out", self.folder / "whole.obj", "--edits", self.edits, "--max-error", 50).stdout
        self.assertRegex(text, rf"{statistics['points']} vertices, .* 3 edits; largest error .* metres east, north and up of latitude 36\.3")

    def test_says_what_does_not_belong_together(self):
        out = ("--out", self.folder / "no.obj")
        wrong = self.folder / "wrong.geojson"
        wrong.write_text(json.dumps({"type": "FeatureCollection", "features": [
            feature({"op": "flaten", "height": 1}, ring(-84.21, 36.29, -84.20, 36.30))]}))
        for code, words, arguments in (
                (2, "the only goal is --max-error", ("--edits", self.edits, "--points", 100)),
                (2, "the only goal is --max-error", ("--edits", self.edits, "--max-error", 0)),
                (2, "leave out", ("--bbox", BOX, "--max-error", 5, "--compact")),
                (2, "enu, ecef or geographic", ("--bbox", BOX, "--max-error", 5, "--coordinates", "pixel")),
                (2, "belongs to --edits, --bbox and --vertical", ("--max-error", 5, "--coordinates", "enu")),
                (2, "--bbox: south must be below north", ("--bbox", "-84.23,36.32,-84.17,36.28", "--max-error", 5)),
                (2, "outside the dataset", ("--bbox", "10,10,11,11", "--max-error", 5)),
                (1, "flaten", ("--edits", wrong, "--max-error", 5)),
                (2, "is the file that is read", ("--edits", self.folder / "no.obj", "--max-error", 5))):
            with self.subTest(arguments=arguments):
                (self.folder / "no.obj").write_text("{}")
                result = run(SAMPLE, *out, *arguments)
                self.assertEqual((result.returncode, result.stdout), (code, ""), result.stderr)
                self.assertIn(words, result.stderr)
                self.assertEqual((self.folder / "no.obj").read_text(), "{}")


if __name__ == "__main__":
    unittest.main()
