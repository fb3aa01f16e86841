"""terrace mesh and terrace info, and the messages of all commands about bad rasters: mesh_info_test.py BINARY SOURCE_DIR."""
import html
import json
import math
import os
import pathlib
import random
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SAMPLE = pathlib.Path(sys.argv.pop(1)).resolve() / "config/samples/jacksboro.tif"


def run(*arguments, cwd=None):
    return subprocess.run([str(BINARY), *map(str, arguments)], cwd=cwd, capture_output=True, text=True, timeout=120)


def read_obj(path):
    vertices, triangles = [], []
    for line in path.read_text().splitlines():
        kind, *rest = line.split() or [""]
        if kind == "v":
            vertices.append(tuple(map(float, rest[:3])))
        elif kind == "f":
            triangles.append(tuple(int(part.split("/")[0]) - 1 for part in rest))
    return vertices, triangles


def area(a, b, c):
    """Twice the signed area in x and y: positive counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def grid(heights, header):
    """An ESRI ASCII grid."""
    rows = "\n".join(" ".join(map(str, row)) for row in heights)
    return f"ncols {len(heights[0])}\nnrows {len(heights)}\n{header}\n{rows}\n"


def read_glb(path):
    """The glTF document and its buffer."""
    data = path.read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20:20 + size]), data[28 + size:]


BUMPS = [[round(20 * math.sin(x / 3) + 15 * math.cos(y / 4), 2) for x in range(40)] for y in range(30)]
PLACE = "xllcorner 100\nyllcorner 200\ncellsize 2\nNODATA_value -9999"


class InFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def write(self, name, data):
        path = self.folder / name
        path.write_bytes(data if isinstance(data, bytes) else data.encode())
        return path

    def files(self):
        return sorted(path.name for path in self.folder.iterdir())

    def assert_refused(self, code, words, *arguments):
        result = run(*arguments)
        self.assertEqual((result.returncode, result.stdout), (code, ""), result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)
        self.assertRegex(result.stderr, r"(?m)^terrace: ")  # the log may have other lines before


class Mesh(InFolder):
    def mesh(self, dem, name, *arguments):
        out = self.folder / name
        result = run("mesh", dem, "--out", out, "--json", *arguments)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        return json.loads(result.stdout), out

    def test_keeps_the_error_it_promises(self):
        dem = self.write("bumps.asc", grid(BUMPS, PLACE))
        for bound in (20, 5, 1, 0):
            statistics, out = self.mesh(dem, "bumps.obj", "--max-error", bound, "--coordinates", "pixel")
            vertices, triangles = read_obj(out)
            self.assertEqual((statistics["points"], statistics["triangles"]), (len(vertices), len(triangles)))
            self.assertLessEqual(statistics["max_error"], bound)
            worst, squares = self.measure(vertices, triangles)
            self.assertAlmostEqual(worst, statistics["max_error"], delta=1e-3)
            self.assertAlmostEqual(math.sqrt(squares / 1200), statistics["rms_error"], delta=1e-3)

    def measure(self, vertices, triangles):
        """Measures every sample against the first triangle that contains it, in pixel coordinates."""
        self.assertAlmostEqual(sum(area(*(vertices[i] for i in t)) for t in triangles), 2 * 39 * 29, places=6)
        worst = squares = 0
        for y, row in enumerate(BUMPS):
            for x, height in enumerate(row):
                for corners in ([vertices[i] for i in t] for t in triangles):
                    weights = [area((x, y), corners[i - 2], corners[i - 1]) / area(*corners) for i in range(3)]
                    if min(weights) > -1e-9:
                        error = abs(sum(w * c[2] for w, c in zip(weights, corners)) - height)
                        worst, squares = max(worst, error), squares + error * error
                        break
                else:
                    self.fail(f"no triangle over {x}, {y}")
        return worst, squares

    def test_turns_triangles_counter_clockwise_in_the_files_axes(self):
        dem = self.write("bumps.asc", grid(BUMPS, PLACE))
        for coordinates in ("pixel", "crs"):
            vertices, triangles = read_obj(self.mesh(dem, "a.obj", "--points", 60, "--coordinates", coordinates)[1])
            self.assertGreater(min(area(*(vertices[i] for i in t)) for t in triangles), 0, coordinates)

    def test_puts_vertices_on_pixel_centres_of_the_reference_system(self):
        dem = self.write("bumps.asc", grid(BUMPS, PLACE))
        vertices, _ = read_obj(self.mesh(dem, "a.obj", "--points", 4)[1])
        self.assertEqual({v[:2] for v in vertices}, {(101, 201), (179, 201), (101, 259), (179, 259)})
        top_left = next(v for v in vertices if v[:2] == (101, 259))
        self.assertAlmostEqual(top_left[2], BUMPS[0][0], places=3)

    def raster_of_zeros(self, name, columns, rows):
        path = self.write(name + ".img", b"")
        os.truncate(path, columns * rows)  # a sparse file
        self.write(name + ".hdr", f"ENVI\nsamples = {columns}\nlines = {rows}\nbands = 1\ndata type = 1\ninterleave = bsq\nbyte order = 0\n")
        return path

    def test_a_raster_that_is_too_large_is_refused_by_the_limit_that_it_exceeds(self):
        for columns, rows, limit in ((40000, 2, "32768 on a side"), (2, 40000, "32768 on a side"), (30000, 30000, "536870912 in all")):
            path = self.raster_of_zeros("large", columns, rows)
            self.assert_refused(1, [f"{path}: {columns} x {rows} samples; a mesh may have {limit} at most: cut it with"],
                                "mesh", path, "--out", self.folder / "a.obj", "--points", 4)

    def test_prints_no_exponents(self):
        heights = [98765.4, 0, 0, 12345.6, 0, 0, 0, 0, 0]
        steep = self.write("steep.img", struct.pack("<9f", *heights))
        self.write("steep.hdr", "ENVI\nsamples = 3\nlines = 3\nbands = 1\ndata type = 4\ninterleave = bsq\nbyte order = 0\n"
                                "map info = {Geographic Lat/Lon, 1, 1, 10, 20, 0.00001, 0.00001, WGS-84}\n")
        mesh = run("mesh", steep, "--out", self.folder / "a.obj", "--points", 4)
        self.assertRegex(mesh.stdout, r"largest error \d+ m")
        info = run("info", steep)
        self.assertIn("0.00001 x 0.00001 degree", info.stdout)
        for result in (mesh, info):
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertNotRegex(result.stdout + result.stderr, r"\de[+-]\d")

    def test_tells_of_more_vertices_than_there_is_use_for(self):
        result = run("mesh", self.write("flat.asc", grid([[5] * 4] * 3, PLACE)), "--out", self.folder / "a.obj", "--points", 9)
        self.assertEqual(result.returncode, 0)
        self.assertRegex(result.stderr, r"^terrace: .*flat\.asc: 4 vertices meet every sample; there is no use for 9\n$")

        picture = self.write("grey.pgm", b"P5 3 2 255\n" + bytes([7] * 6))
        told = "4 vertices meet every sample; there is no use for 9\n"
        image = ("mesh", picture, "--image", "--out", self.folder / "a.ply")
        self.assertIn(told, run(*image, "--points", 9).stderr)
        self.assertEqual(run(*image, "--max-error", 0.1).stderr, "")

    def test_tells_of_angles_where_gltf_has_metres(self):
        told = "angles, heights metres"
        self.assertIn(told, run("mesh", SAMPLE, "--out", self.folder / "a.glb", "--points", 99).stderr)
        for arguments in ((self.folder / "a.ply",), (self.folder / "b.glb", "--coordinates", "pixel")):
            result = run("mesh", SAMPLE, "--points", 99, "--out", *arguments)
            self.assertEqual((result.returncode, result.stderr), (0, ""))

    def test_reaches_each_kind_of_goal(self):
        self.assertEqual(self.mesh(SAMPLE, "a.ply", "--points", 1000)[0]["points"], 1000)
        self.assertLessEqual(self.mesh(SAMPLE, "a.ply", "--rms", 4)[0]["rms_error"], 4)
        statistics, _ = self.mesh(SAMPLE, "a.ply", "--max-error", 10)
        self.assertLessEqual(statistics["max_error"], 10)
        self.assertEqual(statistics["input"], {"path": str(SAMPLE), "width": 403, "height": 344, "voids": 0})
        self.assertEqual(statistics["criterion"], "delaunay")
        self.assertEqual(set(statistics["seconds"]), {"read", "triangulate", "write"})
        self.assertGreater(statistics["peak_rss_bytes"], 1 << 20)

    def test_joins_triangles_by_their_fit_on_request(self):
        delaunay = self.mesh(SAMPLE, "a.ply", "--max-error", 10)[0]["points"]
        for options in ([], ["--measure", "sum-squares"], ["--measure", "max-max"], ["--qthresh", 0.4]):
            statistics, _ = self.mesh(SAMPLE, "b.ply", "--max-error", 10, "--criterion", "data-dependent", *options)
            self.assertEqual(statistics["criterion"], "data-dependent")
            self.assertLessEqual(statistics["max_error"], 10)
            self.assertLess(statistics["points"], delaunay, options)

    def test_gives_the_same_bytes_whatever_the_threads(self):
        rows = [[round(40 * math.sin(x / 9) * math.cos(y / 7 + x / 90), 2) for x in range(700)] for y in range(500)]
        large = self.write("large.asc", grid(rows, PLACE))  # meshed in six blocks
        for dem, bound in ((SAMPLE, 20), (large, 1)):
            goal = ("--max-error", bound, "--coordinates", "pixel")
            statistics, one = self.mesh(dem, "one.glb", *goal)
            self.assertLessEqual(statistics["max_error"], bound)
            for threads in (2, 4):
                more = self.mesh(dem, "more.glb", *goal, "--threads", threads)[1]
                self.assertEqual(one.read_bytes(), more.read_bytes())
            self.assertEqual(one.read_bytes()[:4], b"glTF")

    def test_of_degrees_keep_their_error_in_a_glb(self):
        # Spikes on a plain: triangles between them are thin and steep.
        picks = random.Random(4)
        size, cell, west, north = 400, 1 / 3600, 10.003, 46.5
        rows = [[0] * size for _ in range(size)]
        for _ in range(60):
            rows[picks.randrange(size)][picks.randrange(size)] = 5000
        dem = self.write("spikes.asc", grid(rows, f"xllcorner {west}\nyllcorner {north - size * cell:.15f}\ncellsize {cell:.18f}"))
        statistics, out = self.mesh(dem, "a.glb", "--max-error", 5, "--criterion", "data-dependent")
        gltf, buffer = read_glb(out)
        matrix = gltf["nodes"][0]["matrix"]
        count = statistics["points"]
        vertices = []
        for stored in struct.iter_unpack("<3f", buffer[:12 * count]):
            x, z, south = (sum(matrix[4 * k + i] * stored[k] for k in range(3)) + matrix[12 + i] for i in range(3))
            vertices.append(((x - west) / cell - 0.5, (north + south) / cell - 0.5, z))
        accessor = gltf["accessors"][1]
        form = "<3H" if accessor["componentType"] == 5123 else "<3I"
        offset = gltf["bufferViews"][1]["byteOffset"]
        errors = {}
        for triangle in struct.iter_unpack(form, buffer[offset:offset + struct.calcsize(form) * statistics["triangles"]]):
            corners = [vertices[i] for i in triangle]
            whole = area(*corners)
            for y in range(math.floor(min(c[1] for c in corners)), math.ceil(max(c[1] for c in corners)) + 1):
                for x in range(math.floor(min(c[0] for c in corners)), math.ceil(max(c[0] for c in corners)) + 1):
                    shares = [area((x, y), corners[i - 2], corners[i - 1]) / whole for i in range(3)]
                    if min(shares) >= -1e-9 and 0 <= x < size and 0 <= y < size:
                        off = abs(sum(s * c[2] for s, c in zip(shares, corners)) - rows[y][x])
                        errors[x, y] = min(off, errors.get((x, y), off))
        self.assertGreater(len(errors), 0.99 * size * size)
        self.assertAlmostEqual(max(errors.values()), statistics["max_error"], delta=0.001)

    def test_drops_what_the_bound_does_not_need(self):
        dem = self.write("bumps.asc", grid(BUMPS, PLACE))
        for bound in (5, 1):
            arguments = "--max-error", bound, "--coordinates", "pixel"
            greedy, _ = self.mesh(dem, "greedy.obj", *arguments)
            compact, out = self.mesh(dem, "compact.obj", *arguments, "--compact")
            self.assertEqual((greedy["compact"], compact["compact"]), (False, True))
            self.assertLess(compact["points"], 0.9 * greedy["points"])
            vertices, triangles = read_obj(out)
            self.assertEqual((compact["points"], compact["triangles"]), (len(vertices), len(triangles)))
            worst, _ = self.measure(vertices, triangles)
            self.assertLessEqual(worst, bound + 1e-3)
            self.assertAlmostEqual(worst, compact["max_error"], delta=1e-3)

    def test_meshes_rasters_without_a_georeference(self):
        pixels = b"".join(struct.pack("B", (x * y) % 251) for y in range(20) for x in range(30))
        dem = self.write("plain.pgm", b"P5\n30 20\n255\n" + pixels)
        vertices, _ = read_obj(self.mesh(dem, "a.obj", "--max-error", 0)[1])
        self.assertEqual((max(v[0] for v in vertices), max(v[1] for v in vertices)), (29, 19))
        self.assert_refused(2, ["no georeference", "--coordinates pixel"],
                            "mesh", dem, "-o", self.folder / "b.obj", "--points", 4, "--coordinates", "crs")

    def test_a_failure_leaves_no_file_and_keeps_the_old_one(self):
        broken = self.write("broken.tif", b"II*\0 this is no raster")
        out = self.write("a.obj", "kept")
        self.assert_refused(1, ["broken.tif"], "mesh", broken, "--out", out, "--points", 4)
        self.assertEqual((out.read_text(), self.files()), ("kept", ["a.obj", "broken.tif"]))

    def test_an_interrupted_run_leaves_nothing(self):
        heights = [[x * y % 1000 for x in range(1500)] for y in range(1500)]  # takes far longer than the signal
        dem = self.write("large.asc", grid(heights, PLACE))
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            process = subprocess.Popen([BINARY, "mesh", dem, "--out", self.folder / "a.obj", "--max-error", "0"],
                                       preexec_fn=lambda: signal.signal(number, signal.SIG_DFL))
            until = time.monotonic() + 60
            while not any(name.endswith(".part") for name in self.files()) and time.monotonic() < until:
                time.sleep(0.01)
            process.send_signal(number)
            self.assertEqual(process.wait(timeout=60), -number)
            self.assertEqual(self.files(), ["large.asc"])

    def test_never_writes_over_what_it_reads(self):
        dem = self.write("dem.obj", grid(BUMPS, PLACE))
        self.assert_refused(2, ["dem.obj", "is the file that is read"], "mesh", dem, "-o", dem, "--points", 4)
        image = self.write("photo.ply", b"P6\n40 30\n255\n" + bytes(3600))
        self.assert_refused(2, ["photo.ply", "is the file that is read"],
                            "mesh", dem, "--color", image, "-o", image, "--points", 4)
        self.assertEqual(dem.read_text(), grid(BUMPS, PLACE))

    def test_keeps_links_and_permissions(self):
        dem = self.write("dem.asc", grid(BUMPS, PLACE))
        (self.folder / "link.obj").symlink_to("between.obj")
        (self.folder / "between.obj").symlink_to("real.obj")
        for mode in (None, 0o640):  # a new file, and an existing one
            if mode:
                (self.folder / "real.obj").chmod(mode)
            self.mesh(dem, "link.obj", "--points", 9)
            self.assertTrue((self.folder / "link.obj").is_symlink())
            self.assertEqual(len(read_obj(self.folder / "real.obj")[0]), 9)
        self.assertEqual((self.folder / "real.obj").stat().st_mode & 0o777, 0o640)

    def test_what_is_told_never_gets_into_a_file(self):
        whole, closed = self.folder / "whole.obj", self.folder / "closed.obj"
        run("mesh", SAMPLE, "-o", whole, "--max-error", 20)
        with_streams_closed = ["sh", "-c", 'exec "$0" "$@" <&- >&- 2>&-', str(BINARY)]
        done = subprocess.run([*with_streams_closed, "mesh", SAMPLE, "-o", closed, "--max-error", "20"], timeout=120)
        self.assertEqual(done.returncode, 0)
        self.assertEqual(closed.read_bytes(), whole.read_bytes())

    def test_finds_undeclared_voids(self):
        heights = [[500 + x for x in range(30)] for _ in range(30)]
        heights[3][:20] = [-9999] * 20
        dem = self.write("dem.asc", grid(heights, "xllcorner 100\nyllcorner 200\ncellsize 2"))
        out = self.folder / "dem.obj"
        found = run("mesh", dem, "-o", out, "--max-error", 1)
        self.assertIn("samples taken for voids, though the file does not declare them: 20 samples of -9999; --nodata declared", found.stderr)
        self.assertIn("and across 20 voids;", found.stdout)
        self.assertGreaterEqual(min(z for _, _, z in read_obj(out)[0]), 500)
        for nodata, least in (("declared", -9999), ("500", -9999), ("-9999", 500)):
            told = run("mesh", dem, "-o", out, "--max-error", 1, "--nodata", nodata)
            self.assertEqual((told.returncode, told.stderr), (0, ""))
            self.assertAlmostEqual(min(z for _, _, z in read_obj(out)[0]), least, delta=1)
        self.assertEqual(run("mesh", dem, "-o", out, "--max-error", 1, "--nodata", "none").returncode, 2)

    def test_tells_of_voids(self):
        heights = [[-9999 if x < 10 else h for x, h in enumerate(row)] for row in BUMPS]
        dem = self.write("dem.asc", grid(heights, PLACE))
        result = run("mesh", dem, "-o", self.folder / "a.obj", "--points", 9)
        self.assertIn("of 900 samples and across 300 voids;", result.stdout)
        result = run("mesh", dem, "-o", self.folder / "a.obj", "--points", 9, "--json")
        self.assertEqual(json.loads(result.stdout)["input"]["voids"], 300)

    def test_tells_of_coordinates_that_are_not_metres(self):
        for unit, metres, coordinates, is_told in (("Meter", 1, "crs", False), ("Foot_US", 1200 / 3937, "crs", True),
                                                   ("Foot_US", 1200 / 3937, "pixel", False)):
            self.write("county.prj", f"""PROJCS["county",GEOGCS["NAD83",DATUM["D_North_American_1983",
                SPHEROID["GRS_1980",6378137,298.257222101]],PRIMEM["Greenwich",0],UNIT["Degree",0.0174532925199433]],
                PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",36],PARAMETER["central_meridian",-120],
                PARAMETER["scale_factor",1],PARAMETER["false_easting",0],PARAMETER["false_northing",0],
                UNIT["{unit}",{metres!r}]]""")
            dem = self.write("county.asc", grid(BUMPS, PLACE))
            result = run("mesh", dem, "-o", self.folder / "a.obj", "--max-error", 1, "--coordinates", coordinates)
            self.assertEqual(result.returncode, 0, result.stderr)
            words = "x and y of the mesh are in its reference system's unit (US survey foot), heights in metres"
            self.assertEqual(words in result.stderr, is_told, result.stderr)

    def test_says_what_is_wrong_with_its_arguments(self):
        out = self.folder / "a.obj"
        for words, arguments in ((["exactly one goal"], ["--out", out]),
                                 (["exactly one goal"], ["--out", out, "--points", 9, "--rms", 1]),
                                 (["--points", "from 4"], ["--out", out, "--points", 3]),
                                 (["--max-error", "metres"], ["--out", out, "--max-error", "nan"]),
                                 (["--max-error", "metres"], ["--out", out, "--max-error", -1]),
                                 (["--threads", "1 to 256"], ["--out", out, "--points", 9, "--threads", 0]),
                                 (["pixel, crs, enu, ecef or geographic"], ["--out", out, "--points", 9, "--coordinates", "polar"]),
                                 (["--compact", "--max-error"], ["--out", out, "--points", 9, "--compact"]),
                                 (["--compact", "--max-error"], ["--out", out, "--rms", 9, "--compact"]),
                                 (["delaunay or data-dependent"], ["--out", out, "--points", 9, "--criterion", "best"]),
                                 (["belong to --criterion data-dependent"],
                                  ["--out", out, "--points", 9, "--qthresh", 0.5]),
                                 (["belong to --criterion data-dependent"],
                                  ["--out", out, "--points", 9, "--measure", "max-max"]),
                                 (["from 0 to 1"],
                                  ["--out", out, "--points", 9, "--criterion", "data-dependent", "--qthresh", 2]),
                                 (["sum-max, sum-squares, max-max or normals"],
                                  ["--out", out, "--points", 9, "--criterion", "data-dependent", "--measure", "mean"]),
                                 ([".obj", ".ply", ".glb"], ["--out", "a.txt", "--points", 9])):
            self.assert_refused(2, words, "mesh", SAMPLE, *arguments)
        self.assert_refused(1, ["/nowhere/a.obj", "folder"], "mesh", SAMPLE, "--out", "/nowhere/a.obj", "--points", 9)
        self.assertEqual(self.files(), [])


class Info(unittest.TestCase):
    def test_tells_what_a_raster_holds(self):
        result = run("info", SAMPLE)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        for part in ("403 x 344", "EPSG:4326", "levels", "floor", "voids", "overviews", "no vertical datum stated"):
            self.assertIn(part, result.stdout)

    def test_tells_the_same_as_json(self):
        (info,) = json.loads(run("info", SAMPLE, "--json").stdout)
        self.assertEqual((info["width"], info["height"], info["levels"][0]), (403, 344, 0))
        self.assertEqual(info["valid_samples"] + info["void_samples"], 403 * 344)
        self.assertLess(info["heights"]["min"], info["heights"]["max"])
        self.assertTrue(info["advice"])

    def test_says_when_the_cache_folder_cannot_keep_anything(self):
        with tempfile.NamedTemporaryFile() as file:
            result = run("info", "--cache-dir", file.name, SAMPLE)
        self.assertEqual(result.returncode, 0)
        self.assertIn("cache_dir ", result.stderr)
        self.assertIn("403 x 344", result.stdout)

    def test_shows_the_others_when_one_fails(self):
        result = run("info", "/nowhere.tif", SAMPLE, "--json")
        self.assertEqual(result.returncode, 1)
        self.assertIn("/nowhere.tif", result.stderr)
        self.assertEqual(len(json.loads(result.stdout)), 1)


class InfoOfFiles(InFolder):
    WGS84 = ('GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],'
             'UNIT["degree",0.0174532925199433]]')

    def place(self, name, west, cell, void=False):
        heights = [[-9999 if void and x > 20 else round(h, 2) for x, h in enumerate(row)] for row in BUMPS]
        self.write(name + ".prj", self.WGS84)
        return self.write(name + ".asc",
                          grid(heights, f"xllcorner {west}\nyllcorner 20\ncellsize {cell}\nNODATA_value -9999"))

    def test_takes_what_heights_are_as_a_configuration_does(self):
        dem = self.write("a.asc", grid([[1, 2, 77], [3, 4, 5]], "xllcorner 7\nyllcorner 46\ncellsize 0.001"))
        self.write("a.prj", self.WGS84)
        (info,) = json.loads(run("info", "--nodata", "77", "--vertical", "ellipsoid", "--json", dem).stdout)
        self.assertEqual((info["void_samples"], info["heights"]["max"]), (1, 5))
        self.assertIn("ellipsoid", info["counts_from"])
        for flag in ("--vertical", "--nodata"):
            self.assert_refused(2, [flag + ": must be"], "info", flag, "foo", dem)

    def test_a_coarse_source_before_a_fine_one_is_told(self):
        fine, coarse = self.place("fine", 10, 0.01), self.place("coarse", 9, 0.1)
        told = "1 source lies within the bounds of a coarser one that comes before, and finer heights show only in its voids"
        self.assertIn(told, run("info", "--mosaic", coarse, fine).stdout)
        self.assertNotIn("within the bounds", run("info", "--mosaic", fine, coarse).stdout)

    def test_a_folder_is_one_dataset(self):
        self.place("b", 10.4, 0.01)
        self.place("a", 10, 0.01, void=True)
        self.place("coarse", 9, 0.1)
        self.write("readme.txt", "not a raster")
        result = run("info", self.folder)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        for part in (f"{self.folder}\n", "3, in the order in which they count",
                     "1 source lies at least partly under one that comes before\n", "west 9,", "east 13,", "with voids: 1 source; small ones"):
            self.assertIn(part, result.stdout)
        self.assertLess(result.stdout.index("a.asc"), result.stdout.index("b.asc"))
        self.assertLess(result.stdout.index("b.asc"), result.stdout.index("coarse.asc"))

    def test_tells_all_that_is_wrong_in_a_folder(self):
        self.place("a", 10, 0.01)
        for name in ("b.asc", "c.asc"):
            self.write(name, grid(BUMPS, PLACE))  # without a reference system
        self.assert_refused(1, ["b.asc: states no", "c.asc: states no"], "info", self.folder)

    def test_doubts_heights_that_are_hardly_metres(self):
        self.write("cm.prj", self.WGS84)
        place = "xllcorner 10\nyllcorner 20\ncellsize 0.01"
        dem = self.write("cm.asc", grid([[100 * h + 90000 for h in row] for row in BUMPS], place))
        (info,) = json.loads(run("info", "--json", dem).stdout)
        self.assertTrue(any("hardly metres" in advice for advice in info["advice"]), info["advice"])

    def test_says_what_a_vrt_needs_to_be_served(self):
        self.place("a", 10, 0.01)
        vrt = self.write("a.vrt", f"""<VRTDataset rasterXSize="40" rasterYSize="30"><SRS>{html.escape(self.WGS84)}</SRS>
            <GeoTransform>10, 0.01, 0, 20.3, 0, -0.01</GeoTransform><VRTRasterBand dataType="Float32" band="1"><SimpleSource>
            <SourceFilename relativeToVRT="1">a.asc</SourceFilename><SourceBand>1</SourceBand></SimpleSource>
            </VRTRasterBand></VRTDataset>""")
        self.assertIn('allowed_drivers of its configuration lists "VRT"', run("info", vrt).stdout)

    def test_tells_what_looks_like_a_raster_and_has_no_part_in_it(self):
        self.place("a", 10, 0.01), self.place("b", 10.4, 0.01)
        (info,) = json.loads(run("info", self.folder, "--json").stdout)
        self.assertEqual(info["left_out"], [])
        empty, _ = self.write("empty.tif", b""), self.write("notes.txt", "no raster, and no such name")
        text = run("info", self.folder)
        self.assertEqual(text.returncode, 0)
        self.assertRegex(text.stdout, rf"left out +{re.escape(str(empty))} \(no raster")
        self.assertNotIn("notes.txt", text.stdout)
        (info,) = json.loads(run("info", self.folder, "--json").stdout)
        self.assertEqual([file.split()[0] for file in info["left_out"]], [str(empty)])

    def test_the_order_of_the_command_line_counts(self):
        fine, coarse = self.place("fine", 10, 0.01), self.place("coarse", 9, 0.1)
        (info,) = json.loads(run("info", "--mosaic", "--json", coarse, fine).stdout)
        self.assertEqual([source["path"] for source in info["sources"]], [str(coarse), str(fine)])
        self.assertEqual(len(json.loads(run("info", "--json", coarse, fine).stdout)), 2)


class BadRasters(InFolder):
    SERVE = ("serve", "--listen", "127.0.0.1:0")  # a free port

    def test_are_refused_with_the_reason(self):
        empty = self.write("empty.tif", b"")
        text = self.write("notes.tif", "not a raster")
        plain = self.write("plain.pgm", b"P5\n4 4\n255\n" + bytes(range(16)))
        for command in (self.SERVE, ("info",)):
            for dem in ("/nowhere.tif", empty, text, self.folder):
                self.assert_refused(1, [str(dem)], *command, dem)
            self.assert_refused(1, [str(plain), "georeference", "gdal_translate -a_srs", "-a_ullr"], *command, plain)

    def test_of_voids_only_are_refused(self):
        voids = self.write("voids.asc", grid([[-9999] * 5] * 5, PLACE))
        self.write("voids.prj", 'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],'
                                'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]]')
        for arguments in (self.SERVE, ["info"], ["mesh", "--points", "4", "--out", str(self.folder / "a.obj")]):
            self.assert_refused(1, ["voids.asc"], *arguments, voids)
        self.assertNotIn("a.obj", self.files())

    def test_are_all_told_together(self):
        self.assert_refused(1, ["/nowhere/a.tif", "/nowhere/b.tif"], *self.SERVE, "/nowhere/a.tif", "/nowhere/b.tif")


if __name__ == "__main__":
    unittest.main()
