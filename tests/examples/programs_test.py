"""Runs the examples for Python with numpy, GDAL, QGIS and Blender, and compares what they read with /heights. Those for every dataset are
also run on data across the antimeridian, and on servers that show no dataset.

    programs_test.py TERRACE SOURCE_DIR

QGIS and Blender are large, so tools/install_deps.sh does not install them; what is missing is named and skipped.
"""
import functools
import http.server
import importlib.util
import json
import math
import os
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
import unittest
import unittest.mock
import urllib.request

TERRACE, ROOT = sys.argv[1], pathlib.Path(sys.argv[2])
EXAMPLES = ROOT / "examples"


def module(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def run(*command, **environment):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=240, env={**os.environ, **environment})
    assert done.returncode == 0, (command, done.stdout, done.stderr)
    return done.stdout


def python_with(*modules):
    """A Python that has them all: this one, or the system's; None if neither has."""
    for python in (sys.executable, "/usr/bin/python3"):
        found = subprocess.run([python, "-c", "import " + ", ".join(modules)], capture_output=True, env={**os.environ, "QT_QPA_PLATFORM": "offscreen"})
        if found.returncode == 0:
            return python
    return None


def start(test_class, *options):
    """The address of a server that ends with the tests of the class."""
    server = subprocess.Popen([TERRACE, "serve", *options, "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    test_class.addClassCleanup(server.communicate, timeout=60)
    test_class.addClassCleanup(server.terminate)
    return re.search(r"http://[^/\s]+", server.stdout.readline())[0]


def temporary_folder(test_class):
    folder = pathlib.Path(tempfile.mkdtemp())
    test_class.addClassCleanup(shutil.rmtree, folder)
    return folder


class Programs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.url = start(cls, "--config", ROOT / "config/samples/samples.json")
        cls.folder = temporary_folder(cls)

    def heights(self, *places):
        locations = "|".join(f"{lat},{lon}" for lat, lon in places)
        with urllib.request.urlopen(f"{self.url}/jacksboro/heights?locations={locations}", timeout=30) as reply:
            return [result["elevation"] for result in json.load(reply)["results"]]

    def around(self, lat, lon, degrees):
        """The lowest and the highest of the server's heights within some degrees."""
        steps = [degrees * share for share in (-1, -0.5, 0, 0.5, 1)]
        found = self.heights(*((lat + y, lon + x) for x in steps for y in steps))
        return min(found), max(found)

    def height_tiles(self):
        """height_tiles.vrt for this server."""
        (self.folder / "height_tiles.xml").write_text((EXAMPLES / "height_tiles.xml").read_text().replace("http://127.0.0.1:8080", self.url))
        return shutil.copy(EXAMPLES / "height_tiles.vrt", self.folder)

    def test_numpy_decodes_and_draws_a_tile(self):
        python = python_with("numpy")
        if not python:
            self.skipTest("SKIPPED: needs python3-numpy")
        picture = self.folder / "tile.png"
        said = run(python, EXAMPLES / "plot_tile.py", f"{self.url}/jacksboro", picture, "10", "20")
        # An independent decoder reads the same mesh.
        level, column, row = re.search(r"tile (\d+)/(\d+)/(\d+):", said).groups()
        with urllib.request.urlopen(f"{self.url}/jacksboro/{level}/{column}/{row}.terrain?error=20", timeout=30) as reply:
            vertices, triangles = module(EXAMPLES / "heights.py").decode(reply.read())
            bound = float(reply.headers["Terrain-Certified-Error"])
        heights = [height for _, _, height in vertices]
        self.assertIn(f"{len(vertices)} vertices, {len(triangles)} triangles, {min(heights):.1f} to {max(heights):.1f} m", said)
        most, mean = map(float, re.search(r"up to ([\d.]+) m from the source, ([\d.]+) m in the mean", said).groups())
        self.assertLessEqual(most, bound)
        self.assertLess(mean, 1)
        bytes_of_picture = picture.read_bytes()
        self.assertEqual(struct.unpack(">2I", bytes_of_picture[16:24]), (720, 720))
        self.assertGreater(len(bytes_of_picture), 100_000)

    def test_the_notebook_is_the_script(self):
        made = module(ROOT / "tools/write_notebook.py").notebook((EXAMPLES / "plot_tile.py").read_text())
        self.assertEqual(made, (EXAMPLES / "plot_tile.ipynb").read_text(), "run tools/write_notebook.py")
        self.assertGreater(len(json.loads(made)["cells"]), 8)

    def test_the_notebook_runs(self):
        python = python_with("numpy", "nbclient", "ipykernel")
        if not python:
            self.skipTest("SKIPPED: needs python3-nbclient and python3-ipykernel")
        code = ("import nbformat, nbclient, sys; book = nbformat.read(sys.argv[1], 4); nbclient.NotebookClient(book, timeout=60).execute(); "
                "print([output.get('data', {}).keys() for output in book.cells[-1].outputs])")
        self.assertIn("image/png", run(python, "-c", code, EXAMPLES / "plot_tile.ipynb", TERRACE_DATASET=f"{self.url}/jacksboro"))

    def test_gdal_reads_height_tiles(self):
        with urllib.request.urlopen(f"{self.url}/jacksboro/tiles.json", timeout=30) as reply:
            level = json.load(reply)["maxzoom"]
        self.assertIn(f"<TileLevel>{level}</TileLevel>", (EXAMPLES / "height_tiles.xml").read_text())
        tiles = self.height_tiles()
        for lat, lon in ((36.3, -84.2), (36.25, -84.31), (36.4, -84.15)):
            height = float(run("gdallocationinfo", "-wgs84", "-valonly", tiles, lon, lat))
            low, high = self.around(lat, lon, 0.0005)  # a pixel has 0.0007 degrees
            self.assertTrue(low - 0.1 <= height <= high + 0.1, (lat, lon, height, low, high))
            self.assertLess(high - low, 60)

    def test_qgis_shows_mesh_and_height_tiles(self):
        python = python_with("qgis.core")
        if not python:
            self.skipTest("SKIPPED: needs python3-qgis")
        picture = self.folder / "qgis.png"
        said = run(python, EXAMPLES / "qgis_area.py", f"{self.url}/jacksboro", picture, self.height_tiles())
        lat, lon, mesh, tiles = map(float, re.search(r"([\d.]+), (-[\d.]+): mesh ([\d.]+) m .* height tiles ([\d.]+) m", said).groups())
        self.assertLess(abs(mesh - self.heights((lat, lon))[0]), 10)
        low, high = self.around(lat, lon, 0.0005)
        self.assertTrue(low - 0.1 <= tiles <= high + 0.1, said)
        self.assertGreater(picture.stat().st_size, 10_000)

    def test_the_console_of_qgis_finds_the_height_tiles(self):
        qgis = unittest.mock.MagicMock()
        qgis.QgsApplication.instance.return_value = None  # defines the functions alone
        console = {"__name__": "console"}
        with unittest.mock.patch.dict(sys.modules, {"qgis": qgis, "qgis.core": qgis, "qgis.PyQt": qgis, "qgis.PyQt.QtCore": qgis}):
            exec((EXAMPLES / "qgis_area.py").read_text(), console)
        console["layers"] = unittest.mock.Mock(side_effect=KeyError)
        self.assertRaises(KeyError, console["main"])
        _, _, tiles = console["layers"].call_args.args
        self.assertEqual((ROOT / tiles).resolve(), (EXAMPLES / "height_tiles.vrt").resolve())

    def test_blender_draws_an_area(self):
        if not shutil.which("blender"):
            self.skipTest("SKIPPED: needs blender")
        picture = self.folder / "blender.png"
        said = run("blender", "--background", "--python-exit-code", "1", "--python", EXAMPLES / "blender_terrain.py", "--", f"{self.url}/jacksboro", picture)
        lows_and_highs = [tuple(map(float, pair)) for pair in re.findall(r"([\d.]+) to ([\d.]+) m", said)]
        self.assertEqual(len(lows_and_highs), 2, said)
        (low, high), (grid_low, grid_high) = lows_and_highs
        with urllib.request.urlopen(f"{self.url}/jacksboro/grid?bbox=-84.3,36.2,-84.2,36.3&width=257&height=257&format=json", timeout=30) as reply:
            about = json.load(reply)
        self.assertAlmostEqual(grid_low, about["offset"], delta=0.1)
        self.assertAlmostEqual(grid_high, about["offset"] + 65535 * about["scale"], delta=0.1)
        # Metres above a plane at the middle: the Earth's curvature lowers the corners by up to 4 m; the mesh may be 5 m off.
        self.assertTrue(abs(low - grid_low) < 10 and abs(high - grid_high) < 10, said)
        self.assertGreater(picture.stat().st_size, 10_000)
        self.assertTrue(picture.with_suffix(".blend").exists())


class AcrossTheAntimeridian(unittest.TestCase):
    """Hills from 179 E to 179 W, 18 to 16 S: their middle is the antimeridian."""

    @classmethod
    def setUpClass(cls):
        cls.folder = temporary_folder(cls)
        rows = (" ".join(f"{300 + 200 * math.sin(row / 5) * math.cos(column / 7):.2f}" for column in range(40)) for row in range(40))
        (cls.folder / "fiji.asc").write_text("ncols 40\nnrows 40\nxllcorner 179\nyllcorner -18\ncellsize 0.05\n" + "\n".join(rows) + "\n")
        (cls.folder / "fiji.prj").write_text('GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],'
                                             'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]]')
        cls.url = start(cls, cls.folder / "fiji.asc")

    def test_heights_are_read_off_tiles_on_both_sides(self):
        said = run(EXAMPLES / "heights.py", "--server", self.url)
        said += run(EXAMPLES / "heights.py", "--server", self.url, "--", "-17,-180", "-17.01,179.99", "-16.99,-179.99")
        found = re.findall(r"(\S+), (\S+): ([\d.]+) m in fiji; tile (\S+) .* has ([\d.]+) m, and is at most ([\d.]+) m off", said)
        self.assertEqual([(latitude, longitude) for latitude, longitude, *_ in found],
                         [("-17", "180"), ("-17", "-180"), ("-17.01", "179.99"), ("-16.99", "-179.99")], said)
        for _, _, height, _, drawn, error in found:
            self.assertLess(abs(float(height) - float(drawn)), float(error), said)
        self.assertEqual([int(tile.split("/")[1]) == 0 for _, _, _, tile, _, _ in found], [True, True, False, True], said)

    def test_curl_fetches_a_mesh_of_both_sides(self):
        said = run(EXAMPLES / "curl.sh", self.url, TMPDIR=str(self.folder))
        self.assertIn("bbox=179.975000,-17.025000,-179.975000,-16.975000", said)
        area, = self.folder.glob("tmp.*/area.obj")
        self.assertRegex(area.read_text(), r"(?m)^v -?\d")

    def test_numpy_draws_the_tile_in_the_middle(self):
        python = python_with("numpy")
        if not python:
            self.skipTest("SKIPPED: needs python3-numpy")
        picture = self.folder / "tile.png"
        said = run(python, EXAMPLES / "plot_tile.py", f"{self.url}/fiji", picture)
        self.assertIn("tile 7/0/51:", said)  # the deepest level, the first column east of the antimeridian
        most, certified = map(float, re.search(r"up to ([\d.]+) m from the source, .*certified: ([\d.]+) m", said).groups())
        self.assertLessEqual(most, certified)
        self.assertTrue(picture.exists())

    def test_matplotlib_maps_what_is_seen_on_both_sides(self):
        python = python_with("matplotlib")
        if not python:
            self.skipTest("SKIPPED: needs python3-matplotlib")
        counts = []
        for longitude in ("179.6", "180", "-180"):  # the view of 179.6 lies west of the antimeridian
            said = run(python, EXAMPLES / "view_map.py", f"{self.url}/fiji", self.folder / "view.png", f"-17,{longitude}", "100", "0.2", "21")
            counts.append(list(map(int, re.findall(r"\d+", said))))
        for seen, hidden, unknown in counts:
            self.assertTrue(seen > 0 and hidden > 0 and unknown == 0 and seen + hidden == 21 * 21, counts)
        self.assertEqual(counts[1], counts[2])


class Files(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


class NoDatasets(unittest.TestCase):
    def test_a_sentence_says_so(self):
        folder = temporary_folder(type(self))
        (folder / "closed.json").write_text(json.dumps({
            "datasets": [{"name": "hills", "sources": [str(ROOT / "config/samples/jacksboro.tif")]}], "tokens": [{"name": "key", "token": 16 * "k"}]}))
        (folder / "datasets").write_text('{"datasets":[],"preparing":[{"name":"hills","percent":3}]}\n')
        files = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Files, directory=folder))
        self.addCleanup(files.server_close)
        threading.Thread(target=files.serve_forever, daemon=True).start()
        self.addCleanup(files.shutdown)
        python = python_with("numpy")
        for url in (start(type(self), "--config", folder / "closed.json"), f"http://127.0.0.1:{files.server_port}"):
            for command in ((EXAMPLES / "heights.py", "--server", url), (EXAMPLES / "curl.sh", url),
                            *([(python, EXAMPLES / "plot_tile.py", f"{url}/hills", folder / "tile.png")] if python else [])):
                with self.subTest(command=command):
                    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
                    self.assertEqual(done.returncode, 1)
                    self.assertRegex(done.stderr, rf"\A(curl.sh: )?{url} shows no dataset.*\n\Z")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)  # says what is skipped, and why
