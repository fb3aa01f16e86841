"""Builds the example for cesium-native against an installed one, and runs it: cesium_native_test.py TERRACE SOURCE_DIR BUILD_DIR [PREFIX]

Compares its height with /heights, its request of tiles with the server's log, and its credit with the configuration. Also asks as Cesium for
Unreal and Unity do: both are this library. Without PREFIX (CMake's or the environment's CESIUM_NATIVE_ROOT) it is skipped.
"""
import json
import pathlib
import re
import subprocess
import sys
import unittest
import urllib.request

TERRACE, ROOT, BUILD = sys.argv[1], pathlib.Path(sys.argv[2]).resolve(), pathlib.Path(sys.argv[3]) / "cesium_native"
PREFIX = sys.argv[4] if len(sys.argv) > 4 else ""
CONFIG = {"listen": "127.0.0.1:0",
          "datasets": [{"name": "jacksboro", "sources": [str(ROOT / "config/samples/jacksboro.tif")], "attribution": "USGS"}]}


class CesiumNative(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        for command in (["cmake", "-S", ROOT / "examples/cesium_native", "-B", BUILD, f"-DCMAKE_PREFIX_PATH={PREFIX}", "-DCMAKE_BUILD_TYPE=Release"],
                        ["cmake", "--build", BUILD]):
            done = subprocess.run(command, capture_output=True, text=True)
            assert done.returncode == 0, done.stdout + done.stderr
        (BUILD / "terrace.json").write_text(json.dumps(CONFIG))
        cls.log = open(BUILD / "log", "w+")
        cls.server = subprocess.Popen([TERRACE, "serve", "--config", BUILD / "terrace.json"], stdout=subprocess.PIPE, stderr=cls.log, text=True)
        cls.url = re.search(r"http://[^/\s]+", cls.server.stdout.readline())[0]

    @classmethod
    def tearDownClass(cls):
        cls.server.terminate()
        cls.server.communicate(timeout=60)

    def view(self, document):
        return subprocess.run([BUILD / "cesium_native_example", f"{self.url}/jacksboro/{document}", "36.3", "-84.2"], capture_output=True, text=True, timeout=120)

    def test_it_shows_terrain_of_both_documents(self):
        with urllib.request.urlopen(f"{self.url}/jacksboro/heights?locations=36.3,-84.2&certify=deepest", timeout=30) as reply:
            truth, = json.load(reply)["results"]
        for document, suffix in (("layer.json", r"\.terrain\?v[^ ]*extensions=octvertexnormals"), ("tileset.json", r"\.glb\?v")):
            done = self.view(document)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            tiles, triangles = map(int, re.search(r"(\d+) tiles shown, (\d+) triangles", done.stdout).groups())
            self.assertGreater(tiles, 3)
            self.assertGreater(triangles, 1000)
            height = float(re.search(r"height at [^:]*: (-?[\d.]+) m", done.stdout).group(1))
            self.assertLessEqual(abs(height - truth["elevation"]), truth["certified_error"])
            if document == "layer.json":
                self.assertIn("credit: USGS", done.stdout)
            self.log.flush()
            asked = re.findall(r'GET "([^"]+)" 200', pathlib.Path(self.log.name).read_text())
            self.assertTrue(any(re.search(suffix, target) for target in asked), asked[-5:])

    def test_it_says_what_is_wrong(self):
        done = self.view("none.json")
        self.assertEqual(done.returncode, 1)
        self.assertIn("404", done.stderr)


if __name__ == "__main__":
    if not PREFIX:
        print("SKIPPED: cesium_native_test needs an installed cesium-native: cmake -DCESIUM_NATIVE_ROOT=PREFIX")
        sys.exit(77)
    unittest.main(argv=sys.argv[:1])
