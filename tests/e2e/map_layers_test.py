"""Hillshades, slopes, contours and imagery of the real binary: map_layers_test.py BINARY SOURCE_DIR.

Compares them with GDAL's command line tools: gdaldem on rasters that gdalwarp made of the same DEM, ogr2ogr as a reader
of vector tiles, gdalwarp of the image.
"""
import array
import contextlib
import json
import math
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.error
import urllib.request

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()
DEM = SOURCE_DIR / "config/samples/jacksboro.tif"
WORLD = 20037508.342789244
LEVEL, COLUMN, ROW = 11, 544, 802  # inside the DEM, which the tiles around it touch


def run(*command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, (command, done.stderr)
    return done.stdout


def box(level, column, row):
    """West, south, east, north of a tile in EPSG:3857."""
    size = 2 * WORLD / 2 ** level
    return column * size - WORLD, WORLD - (row + 1) * size, (column + 1) * size - WORLD, WORLD - row * size


def latitude(level, y):
    return math.degrees(math.atan(math.sinh(math.pi * (1 - 2 * y / 2 ** level))))


def quantile(values, share):
    return sorted(values)[int(share * (len(values) - 1))]


class Server:
    def __init__(self, folder, datasets):
        config = folder / "terrace.json"
        config.write_text(json.dumps({"listen": "127.0.0.1:0", "cache_dir": str(folder / "cache"), "datasets": datasets}))
        self.process = subprocess.Popen([BINARY, "serve", "--config", config], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        found = re.search(r"http://\S+?(?=[/\s]*$)", line)
        assert found, line + (self.process.stderr.read() if self.process.poll() is not None else "")
        self.url = found[0].rstrip("/")

    def get(self, path, **headers):
        with urllib.request.urlopen(urllib.request.Request(self.url + path, headers=headers), timeout=60) as reply:
            return reply.read(), reply.headers

    def status(self, path):
        with contextlib.suppress(urllib.error.HTTPError):
            with urllib.request.urlopen(self.url + path, timeout=60) as reply:
                return reply.status, {}
        try:
            urllib.request.urlopen(self.url + path, timeout=60)
        except urllib.error.HTTPError as error:
            return error.code, json.loads(error.read())
        raise AssertionError(path)

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        self.process.communicate(timeout=60)


class MapLayers(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        # An image of a part of the DEM in another reference system: colours tell the position, with a transparent part.
        west, south, east, north = box(LEVEL, COLUMN, ROW)
        run("gdalwarp", "-q", "-t_srs", "EPSG:32616", "-te_srs", "EPSG:3857", "-te", west - 4000, south - 4000, east + 4000, north + 4000,
            "-tr", 60, 60, "-r", "bilinear", DEM, cls.folder / "utm.tif")
        ramp = cls.folder / "ramp.txt"
        ramp.write_text("200 20 60 200 255\n500 40 200 80 255\n700 240 200 40 255\n900 250 250 250 255\nnv 0 0 0 0\n")
        run("gdaldem", "color-relief", "-q", "-alpha", cls.folder / "utm.tif", ramp, cls.folder / "photo.tif")
        cls.server = Server(cls.folder, [
            {"name": "hills", "sources": [str(DEM)]},
            {"name": "photo", "sources": [str(DEM)], "imagery": {"image": str(cls.folder / "photo.tif"), "attribution": "A. Pilot"}}])
        cls.addClassCleanup(cls.server.stop)

    def pixels(self, path):
        """Width, and for each band its bytes, of a reply's picture as GDAL reads it."""
        suffix = path.split("?")[0].rsplit(".", 1)[1]
        data, headers = self.server.get(path)
        self.assertEqual(headers["Content-Type"], {"png": "image/png", "webp": "image/webp", "jpg": "image/jpeg"}[suffix])
        file = self.folder / ("tile." + suffix)
        file.write_bytes(data)
        return self.bands(file)

    def bands(self, raster, kind="Byte", *options):
        raw = self.folder / "raw.bin"
        run("gdal_translate", "-q", "-of", "ENVI", "-co", "INTERLEAVE=BSQ", "-ot", kind, *options, raster, raw)
        width, height = json.loads(run("gdalinfo", "-json", raw))["size"]
        values = array.array({"Byte": "B", "Float32": "f"}[kind], raw.read_bytes())
        return width, [values[i:i + width * height] for i in range(0, len(values), width * height)]

    def warped(self, margin=20, level=LEVEL, column=COLUMN, row=ROW):
        """The DEM on the pixels of a tile, and some around it, by gdalwarp."""
        west, south, east, north = box(level, column, row)
        step = (east - west) / 256
        out = self.folder / f"warped-{level}-{column}-{row}.tif"
        if not out.exists():
            run("gdalwarp", "-q", "-t_srs", "EPSG:3857", "-te", west - margin * step, south - margin * step, east + margin * step,
                north + margin * step, "-ts", 256 + 2 * margin, 256 + 2 * margin, "-r", "bilinear", "-ot", "Float32", DEM, out)
        return out

    def oracle(self, *command, margin=20):
        out = self.folder / "oracle.tif"
        out.unlink(missing_ok=True)
        scale = math.cos(math.radians(latitude(LEVEL, ROW + 0.5)))
        run("gdaldem", command[0], "-q", self.warped(margin), out, *command[1:], "-s", scale)
        _, (values,) = self.bands(out, "Float32", "-srcwin", margin, margin, 256, 256)
        return values

    def test_hillshades_are_those_of_gdaldem(self):
        for query, options in (("", ()), ("?azimuth=90&altitude=30", ("-az", 90, "-alt", 30)), ("?zfactor=2.5", ("-z", 2.5)),
                               ("?azimuth=360&altitude=90", ("-az", 0, "-alt", 90))):
            width, bands = self.pixels(f"/hills/hillshade/{LEVEL}/{COLUMN}/{ROW}.png{query}")
            self.assertEqual((width, len(bands)), (256, 1), "grey without alpha where all pixels have a height")
            off = [abs(a - b) for a, b in zip(bands[0], self.oracle("hillshade", *options))]
            # Both interpolate the same samples; positions by PROJ and by GDAL's approximation differ a little.
            self.assertLess(sum(off) / len(off), 0.6, query)
            self.assertLessEqual(quantile(off, 0.99), 3, query)
            self.assertGreater(max(bands[0]) - min(bands[0]), 20, "there are hills")

    def test_slopes_are_those_of_gdaldem(self):
        width, (steps,) = self.pixels(f"/hills/slope/{LEVEL}/{COLUMN}/{ROW}.png?style=degrees")
        self.assertEqual(width, 256)
        off = [abs(a / 2 - b) for a, b in zip(steps, self.oracle("slope"))]
        self.assertLess(sum(off) / len(off), 0.25)
        self.assertLessEqual(quantile(off, 0.99), 0.7)
        self.assertGreater(max(steps), 40, "there are slopes")
        # Without the scale of the map they would be this much too small.
        wrong = [abs(a / 2 - b) for a, b in zip(steps, self.oracle_without_scale())]
        self.assertGreater(sum(wrong), 3 * sum(off))

    def oracle_without_scale(self):
        out = self.folder / "unscaled.tif"
        run("gdaldem", "slope", "-q", self.warped(), out)
        return self.bands(out, "Float32", "-srcwin", 20, 20, 256, 256)[1][0]

    def test_colours_of_slopes_are_those_of_the_manual(self):
        _, (steps,) = self.pixels(f"/hills/slope/{LEVEL}/{COLUMN}/{ROW}.png?style=degrees")
        file = self.folder / "colours.png"
        file.write_bytes(self.server.get(f"/hills/slope/{LEVEL}/{COLUMN}/{ROW}.png")[0])
        rgb = self.bands(file, "Byte", "-expand", "rgb")[1]
        manual = (SOURCE_DIR / "docs/map-layers.md").read_text()
        stops = [[int(n) for n in match] for match in re.findall(r"^\| (\d+) \| (\d+), (\d+), (\d+) \|", manual, re.MULTILINE)]
        self.assertEqual(len(stops), 8)
        known = {2 * degrees: tuple(color) for degrees, *color in stops}
        seen = {step: tuple(band[i] for band in rgb) for i, step in enumerate(steps)}
        common = set(known) & set(seen)
        self.assertGreaterEqual(len(common), 3, sorted(seen))
        for step in common:
            self.assertEqual(seen[step], known[step], step)

    def test_webp_has_the_same_pixels(self):
        for layer, query in (("hillshade", ""), ("slope", "?style=degrees"), ("hillshade", "?size=512")):
            level, column, row = (LEVEL - 1, COLUMN // 2, ROW // 2) if "512" in query else (LEVEL, COLUMN, ROW)
            width, png = self.pixels(f"/hills/{layer}/{level}/{column}/{row}.png{query}")
            again, webp = self.pixels(f"/hills/{layer}/{level}/{column}/{row}.webp{query}")
            self.assertEqual(width, again)
            there = [i for i in range(width * width) if len(png) == 1 or png[1][i] == 255]
            self.assertGreater(len(there), width * width / 3)
            for band in webp[:3]:
                self.assertEqual([band[i] for i in there], [png[0][i] for i in there])
            if len(png) == 2:
                self.assertEqual(webp[3], png[1])

    def test_tiles_of_512_pixels_are_the_four_below(self):
        for layer in ("hillshade", "slope"):
            query = "style=degrees&" if layer == "slope" else ""
            width, (large, *_) = self.pixels(f"/hills/{layer}/{LEVEL - 1}/{COLUMN // 2}/{ROW // 2}.png?{query}size=512")
            self.assertEqual(width, 512)
            for dx, dy in ((0, 0), (0, 1), (1, 0)):
                _, (small, *_) = self.pixels(f"/hills/{layer}/{LEVEL}/{COLUMN // 2 * 2 + dx}/{ROW // 2 * 2 + dy}.png?{query}")
                for y in range(256):
                    at = (256 * dy + y) * 512 + 256 * dx
                    self.assertEqual(large[at:at + 256], small[256 * y:256 * y + 256], (layer, dx, dy, y))

    def test_nothing_is_drawn_where_no_height_is(self):
        # Level 8 reaches beyond the DEM.
        for path in ("hillshade/8/67/100.png", "slope/8/67/100.png?style=degrees"):
            _, bands = self.pixels("/hills/" + path)
            self.assertEqual(len(bands), 2, path)
            transparent = bands[1].count(0)
            self.assertGreater(transparent, 0)
            self.assertGreater(bands[1].count(255), 0)
            self.assertEqual(transparent + bands[1].count(255), len(bands[1]))

    def lines(self, level, column, row, query=""):
        """{height: lines in units of the tile}, as ogr2ogr reads the tile."""
        data, headers = self.server.get(f"/hills/contours/{level}/{column}/{row}.mvt{query}")
        self.assertEqual(headers["Content-Type"], "application/vnd.mapbox-vector-tile")
        file, out = self.folder / f"{row}.mvt", self.folder / "lines.json"
        file.write_bytes(data)
        out.unlink(missing_ok=True)
        run("ogr2ogr", "-f", "GeoJSON", "-oo", "CLIP=NO", out, file, "contour")
        found = {}
        for feature in json.loads(out.read_text())["features"]:
            properties, geometry = feature["properties"], feature["geometry"]
            parts = geometry["coordinates"] if geometry["type"] == "MultiLineString" else [geometry["coordinates"]]
            # GDAL turns y upwards from the tile's southern edge.
            found[properties["ele"]] = (bool(properties["index"]), [[(round(x), 4096 - round(y)) for x, y, *_ in part] for part in parts])
        return found

    def test_contours_have_the_interval_and_the_index_of_the_request(self):
        for query, interval in (("", 100), ("?interval=20", 20), ("?interval=12.5", 12.5)):
            lines = self.lines(LEVEL, COLUMN, ROW, query)
            self.assertGreater(len(lines), 2, query)
            for height, (is_index, _) in lines.items():
                self.assertEqual(height % interval, 0)
                self.assertEqual(is_index, height % (5 * interval) == 0, (height, interval))

    def test_contours_lie_at_their_heights(self):
        """Vertices in metres of EPSG:3857, compared with the heights that /heights has there."""
        west, _, east, north = box(LEVEL, COLUMN, ROW)
        unit = (east - west) / 4096
        off = []
        for height, (_, parts) in self.lines(LEVEL, COLUMN, ROW, "?interval=50").items():
            points = [point for part in parts for point in part][::15][:60]
            texts = []
            for x, y in points:
                lon = math.degrees((west + x * unit) / 6378137)
                lat = math.degrees(math.atan(math.sinh((north - y * unit) / 6378137)))
                texts.append(f"{lat:.7f},{lon:.7f}")
            results = json.loads(self.server.get("/hills/heights?locations=" + "|".join(texts))[0])["results"]
            off += [abs(result["elevation"] - height) for result in results]
        self.assertGreater(len(off), 100)
        self.assertLess(quantile(off, 0.5), 2)
        self.assertLess(quantile(off, 0.95), 12)  # samples are 75 m apart, pixels 62 m

    def test_contours_meet_at_the_edges(self):
        """Pieces of line that cross an edge are the same in both tiles."""
        def crossing(lines, axis, edge):
            pieces = set()
            for height, (_, parts) in lines.items():
                for part in parts:
                    for a, b in zip(part, part[1:]):
                        if min(a[axis], b[axis]) < edge < max(a[axis], b[axis]):
                            # Where it crosses, and how steeply: also if collinear vertices are left out elsewhere.
                            share = (edge - a[axis]) / (b[axis] - a[axis])
                            where = a[1 - axis] + share * (b[1 - axis] - a[1 - axis])
                            if 0 < where < 4096:
                                pieces.add((height, round(where, 6)))
            return pieces
        for axis, here, there in ((0, (COLUMN, ROW), (COLUMN + 1, ROW)), (1, (COLUMN, ROW - 1), (COLUMN, ROW))):
            ours = crossing(self.lines(LEVEL, *here, "?interval=20"), axis, 4096)
            theirs = crossing(self.lines(LEVEL, *there, "?interval=20"), axis, 0)
            self.assertGreater(len(ours), 5)
            self.assertEqual(ours, theirs)

    def test_contours_are_compressed_if_the_client_likes_and_repeat_bit_for_bit(self):
        path = f"/hills/contours/{LEVEL}/{COLUMN}/{ROW}.mvt"
        plain, headers = self.server.get(path)
        self.assertEqual((headers["Content-Encoding"], headers["Vary"]), (None, "Accept-Encoding"))
        self.assertIsNone(headers["Terrain-Max-Error"])
        packed, headers = self.server.get(path, **{"Accept-Encoding": "gzip"})
        self.assertEqual(headers["Content-Encoding"], "gzip")
        self.assertLess(len(packed), len(plain))
        self.assertEqual(plain, self.server.get(path + "?v=other")[0])
        tag = self.server.get(path)[1]["ETag"]
        with self.assertRaises(urllib.error.HTTPError) as caught:
            self.server.get(path, **{"If-None-Match": tag})
        self.assertEqual(caught.exception.code, 304)

    def test_imagery_is_that_of_gdalwarp(self):
        document = json.loads(self.server.get("/photo/imagery/tiles.json")[0])
        level = document["maxzoom"]
        scale = 2 ** (LEVEL - level)
        column, row = int((COLUMN + 0.5) / scale), int((ROW + 0.5) / scale)
        west, south, east, north = box(level, column, row)
        oracle = self.folder / "photo-oracle.tif"
        run("gdalwarp", "-q", "-t_srs", "EPSG:3857", "-te", west, south, east, north, "-ts", 256, 256, "-r", "bilinear", self.folder / "photo.tif", oracle)
        expected = self.bands(oracle)[1]
        for suffix, most in (("webp", 8), ("jpg", 8)):
            width, bands = self.pixels(f"/photo/imagery/{level}/{column}/{row}.{suffix}")
            self.assertEqual(width, 256)
            off = [abs(a - b) for band, right in zip(bands[:3], expected) for a, b in zip(band, right)]
            self.assertLess(sum(off) / len(off), most, suffix)

    def test_imagery_of_terrain_tiles_is_that_of_gdalwarp(self):
        entry = next(d for d in json.loads(self.server.get("/datasets")[0])["datasets"] if d["name"] == "photo")
        level, (west, south, east, north) = entry["imagery"]["geodetic_max_level"], entry["imagery"]["bounds"]
        self.assertEqual(entry["imagery"]["attribution"], "A. Pilot")
        step = 180 / 2 ** level
        column, row = int(((west + east) / 2 + 180) / step), int(((south + north) / 2 + 90) / step)
        oracle = self.folder / "geodetic-oracle.tif"
        run("gdalwarp", "-q", "-t_srs", "EPSG:4326", "-te", column * step - 180, row * step - 90, (column + 1) * step - 180,
            (row + 1) * step - 90, "-ts", 256, 256, "-r", "bilinear", self.folder / "photo.tif", oracle)
        expected = self.bands(oracle)[1]
        path = entry["urls"]["imagery_geodetic"].format(z=level, x=column, y=row)
        width, bands = self.pixels(path)
        self.assertEqual(width, 256)
        off = [abs(a - b) for band, right in zip(bands[:3], expected) for a, b in zip(band, right)]
        self.assertLess(sum(off) / len(off), 8)

    def test_imagery_has_alpha_at_its_edge(self):
        document = json.loads(self.server.get("/photo/imagery/tiles.json")[0])
        level = document["maxzoom"] - 4
        west, south, east, north = document["bounds"]
        n = 2 ** level
        column = int(((west + east) / 2 + 180) / 360 * n)
        row = int((1 - math.asinh(math.tan(math.radians((south + north) / 2))) / math.pi) / 2 * n)
        _, bands = self.pixels(f"/photo/imagery/{level}/{column}/{row}.webp")
        self.assertEqual(len(bands), 4)
        self.assertGreater(bands[3].count(0), 0)
        self.assertGreater(bands[3].count(255), 0)
        _, jpeg = self.pixels(f"/photo/imagery/{level}/{column}/{row}.jpg")
        empty = [i for i in range(65536) if bands[3][i] == 0]
        grey = sorted(jpeg[0][i] for i in empty)[len(empty) // 2]
        self.assertAlmostEqual(grey, 188, delta=2)

    def entry(self, server, name):
        return next(d for d in json.loads(server.get("/datasets")[0])["datasets"] if d["name"] == name)

    def test_a_replaced_image_is_another_version(self):
        folder = pathlib.Path(tempfile.mkdtemp(dir=self.folder))
        image = folder / "photo.tif"

        def paint(red, path):
            run("gdal_translate", "-q", "-b", 1, "-b", 1, "-b", 1, "-ot", "Byte", "-scale", 0, 1e6, red, red, self.folder / "utm.tif", path)
        paint(30, image)
        server = Server(folder, [{"name": "swap", "sources": [str(DEM)], "imagery": {"image": str(image)}}])
        try:
            before = self.entry(server, "swap")
            level, (west, south, east, north) = before["imagery"]["geodetic_max_level"], before["imagery"]["bounds"]
            step = 180 / 2 ** level
            place = {"z": level, "x": int(((west + east) / 2 + 180) / step), "y": int(((south + north) / 2 + 90) / step)}

            def middle():
                file = folder / "tile.webp"
                data, headers = server.get(before["urls"]["imagery_geodetic"].format(**place))
                file.write_bytes(data)
                return self.bands(file)[1][0][128 * 256 + 128], headers["Cache-Control"]
            red, cache = middle()
            self.assertAlmostEqual(red, 30, delta=4)
            self.assertIn("immutable", cache)
            paint(220, folder / "next.tif")
            (folder / "next.tif").rename(image)
            end = time.monotonic() + 30
            while self.entry(server, "swap")["version"] == before["version"] and time.monotonic() < end:
                time.sleep(0.1)
            self.assertNotEqual(self.entry(server, "swap")["version"], before["version"])
            red, cache = middle()
            self.assertAlmostEqual(red, 220, delta=4)
            self.assertEqual(cache, "no-store", "the URL has the old version")
        finally:
            server.stop()

    def test_a_palette_is_shown_in_its_colours_and_coarse_levels_use_averages(self):
        folder = pathlib.Path(tempfile.mkdtemp(dir=self.folder))
        # Columns of two colours, a pixel wide: their average is neither.
        lines = "\n".join(" ".join(str(x % 2) for x in range(512)) for _ in range(512))
        (folder / "plain.asc").write_text(f"ncols 512\nnrows 512\nxllcorner -84.4\nyllcorner 36.2\ncellsize 0.0004\n{lines}\n")
        run("gdal_translate", "-q", "-ot", "Byte", "-a_srs", "EPSG:4326", folder / "plain.asc", folder / "plain.vrt")
        vrt = (folder / "plain.vrt").read_text()
        table = '<ColorInterp>Palette</ColorInterp><ColorTable><Entry c1="200" c2="200" c3="40" c4="255"/><Entry c1="0" c2="0" c3="40" c4="255"/></ColorTable>'
        (folder / "plain.vrt").write_text(re.sub(r"<VRTRasterBand[^>]*>", lambda found: found[0] + table, vrt))
        run("gdal_translate", "-q", folder / "plain.vrt", folder / "palette.tif")
        server = Server(folder, [{"name": "palette", "sources": [str(DEM)], "imagery": {"image": str(folder / "palette.tif")}}])
        try:
            level = self.entry(server, "palette")["imagery"]["max_level"]
            shown = {}
            for z in (level + 0, level - 3):
                n = 2 ** z
                x, y = int((-84.3 + 180) / 360 * n), int((1 - math.asinh(math.tan(math.radians(36.3))) / math.pi) / 2 * n)
                data, _ = server.get(f"/palette/imagery/{z}/{x}/{y}.webp")
                (folder / "tile.webp").write_bytes(data)
                bands = self.bands(folder / "tile.webp")[1]
                inside = [i for i in range(65536) if len(bands) == 3 or bands[3][i] == 255]
                shown[z] = sorted(bands[0][i] for i in inside), sorted(bands[2][i] for i in inside)
            fine, coarse = shown[level][0], shown[level - 3][0]
            self.assertGreater(quantile(fine, 0.98) - quantile(fine, 0.02), 80, "single pixels")
            self.assertAlmostEqual(quantile(coarse, 0.5), 100, delta=12)
            self.assertLess(quantile(coarse, 0.9) - quantile(coarse, 0.1), 40, "averages")
            self.assertAlmostEqual(quantile(shown[level - 3][1], 0.5), 40, delta=12)
        finally:
            server.stop()

    def test_images_that_cannot_be_used_are_refused_at_the_start(self):
        folder = pathlib.Path(tempfile.mkdtemp(dir=self.folder))
        run("gdal_translate", "-q", "-of", "PNG", "-b", 1, "-ot", "Byte", "-scale", self.folder / "utm.tif", folder / "nowhere.png")
        (folder / "nowhere.png.aux.xml").unlink(missing_ok=True)
        (folder / "nowhere.wld").unlink(missing_ok=True)
        for image, words in (("missing.tif", "missing.tif"), ("nowhere.png", "georeference|reference system"), (str(self.folder / "utm.tif"), "colours")):
            config = folder / "bad.json"
            config.write_text(json.dumps({"listen": "127.0.0.1:0", "cache_dir": "none", "datasets": [
                {"name": "bad", "sources": [str(DEM)], "imagery": {"image": image}}]}))
            done = subprocess.run([BINARY, "serve", "--config", config], capture_output=True, text=True, timeout=60)
            self.assertIn(done.returncode, (1, 2), image)
            self.assertRegex(done.stderr, words)
            self.assertIn("dataset bad", done.stderr)

    def test_documents_name_what_is_there(self):
        for layer, kind, suffix in (("hillshade", "raster", "png"), ("slope", "raster", "png"), ("contours", "vector", "mvt"), ("imagery", "raster", "webp")):
            data, headers = self.server.get(f"/photo/{layer}/tiles.json")
            self.assertEqual(headers["Cache-Control"], "no-cache")
            document = json.loads(data)
            self.assertEqual((document["tilejson"], document["type"]), ("3.0.0", kind))
            template = document["tiles"][0]
            self.assertTrue(template.startswith(f"{self.server.url}/photo/{layer}/"), template)
            self.assertIn("." + suffix + "?v=", template)
            west, south, east, north = document["bounds"]
            level, n = document["maxzoom"], 2 ** document["maxzoom"]
            column = int(((west + east) / 2 + 180) / 360 * n)
            row = int((1 - math.asinh(math.tan(math.radians((south + north) / 2))) / math.pi) / 2 * n)
            path = template.removeprefix(self.server.url).format(z=level, x=column, y=row)
            reply = self.server.get(path)[1]
            self.assertEqual(reply["Cache-Control"], "public, max-age=31536000, immutable")
            self.assertEqual(self.server.status(path.replace(f"/{level}/{column}/", f"/{level + 1}/{column * 2}/").replace(f"/{row}.", f"/{row * 2}."))[0], 404)
        document = json.loads(self.server.get("/photo/hillshade/tiles.json?azimuth=10&zfactor=2.5&size=512&format=webp")[0])
        self.assertIn(".webp?v=", document["tiles"][0])
        self.assertTrue(document["tiles"][0].endswith("&azimuth=10&zfactor=2.5&size=512"), document["tiles"])
        self.assertEqual(document["tileSize"], 512)
        self.assertEqual(json.loads(self.server.get("/photo/contours/tiles.json")[0])["vector_layers"][0]["fields"], {"ele": "Number", "index": "Boolean"})
        self.assertEqual(json.loads(self.server.get("/photo/imagery/tiles.json")[0])["attribution"], "A. Pilot")

    def test_errors_name_the_remedy(self):
        tile = f"{LEVEL}/{COLUMN}/{ROW}"
        for path, status, words in (
                (f"/hills/imagery/{tile}.jpg", 404, "the dataset has no imagery"), ("/hills/imagery/tiles.json", 404, "the dataset has no imagery"),
                (f"/hills/imagery/geodetic/{LEVEL}/1088/1244.webp", 404, "no imagery"),
                (f"/hills/hillshade/{tile}.png?azimuth=361", 400, "from 0 to 360"), (f"/hills/hillshade/{tile}.png?altitude=91", 400, "from 0 to 90"),
                (f"/hills/hillshade/{tile}.png?zfactor=0", 400, "from 0.01 to 100"), (f"/hills/hillshade/{tile}.png?zfactor=101", 400, "from 0.01 to 100"),
                (f"/hills/hillshade/{tile}.png?azimuth=1&azimuth=2", 400, "more than once"), (f"/hills/hillshade/{tile}.png?interval=5", 400, "known are size, azimuth, altitude, zfactor"),
                (f"/hills/slope/{tile}.png?style=red", 400, "colors or degrees"), (f"/hills/contours/{tile}.mvt?interval=0.01", 400, "0.1 to 10000"),
                (f"/hills/contours/{tile}.mvt?interval=1", 400, "at least 5 m at level 11"), (f"/hills/contours/{tile}.png", 404, "no such URL"),
                (f"/hills/hillshade/{tile}.jpg", 404, "no such URL"), ("/hills/hillshade/11/0/0.png", 404, "tiles.json"),
                ("/hills/contours/tiles.json?format=png", 400, "known are interval"), ("/photo/imagery/tiles.json?format=png", 400, "format"),
                ("/none/hillshade/tiles.json", 404, "no such dataset")):
            found, problem = self.server.status(path)
            self.assertEqual(found, status, path)
            self.assertIn(words, problem["detail"], path)


if __name__ == "__main__":
    unittest.main()
