"""Grids and lines of sight, of the real binary: grid_sight_test.py BINARY SOURCE_DIR.

Reads height maps back by its own readers and compares them with /heights at the same points.
"""
import json
import math
import pathlib
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import unittest
import urllib.error
import urllib.request
import zlib

from srtm import write_hgt

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()
BOX = "bbox=7.2,46.2,7.4,46.35&width=127&height=95"
NUMBERS = "application/octet-stream"


def read_png16(data):
    """Width, height and values of a grey PNG of 16 bits."""
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    at, packed, head = 8, b"", None
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        if kind == b"IHDR":
            head = struct.unpack_from(">IIBB", data, at + 8)
        if kind == b"IDAT":
            packed += data[at + 8:at + 8 + size]
        at += size + 12
    width, height, depth, colour = head
    assert (depth, colour) == (16, 0), head
    raw, stride = zlib.decompress(packed), 2 * width
    rows, above = [], bytearray(stride)
    for y in range(height):
        kind, row = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        for i in range(stride):
            left, up, corner = (row[i - 2], above[i], above[i - 2]) if i > 1 else (0, above[i], 0)
            guess = left + up - corner
            paeth = min((left, up, corner), key=lambda value: abs(guess - value))
            row[i] = (row[i] + (0, left, up, (left + up) // 2, paeth)[kind]) & 255
        rows.append(row)
        above = row
    return width, height, [value for row in rows for value in struct.unpack(f">{width}H", row)]


def read_tiff(data):
    """Tags of an uncompressed-order little-endian TIFF's first directory."""
    assert data[:4] == b"II*\0"
    at, = struct.unpack_from("<I", data, 4)
    count, = struct.unpack_from("<H", data, at)
    tags = {}
    for i in range(count):
        tag, kind, values = struct.unpack_from("<HHI", data, at + 2 + 12 * i)
        letter = {2: "s", 3: "H", 4: "I", 12: "d"}.get(kind)
        if letter is None:
            continue
        size = struct.calcsize("<" + letter) * values
        place = at + 2 + 12 * i + 8 if size <= 4 else struct.unpack_from("<I", data, at + 2 + 12 * i + 8)[0]
        tags[tag] = struct.unpack_from(f"<{values}{letter}", data, place)
    return tags


def tiff_heights(data):
    tags = read_tiff(data)
    width, height = tags[256][0], tags[257][0]
    assert tags[258][0] == 32 and tags[339][0] == 3 and tags[317][0] == 3, "floats with the predictor of floats"
    side_x, side_y = tags[322][0], tags[323][0]
    across = -(-width // side_x)
    heights = [[0.0] * width for _ in range(height)]
    for number, (start, size) in enumerate(zip(tags[324], tags[325])):
        raw = zlib.decompress(data[start:start + size])
        for y in range(side_y):
            row = bytearray(raw[y * side_x * 4:(y + 1) * side_x * 4])
            for i in range(1, len(row)):
                row[i] = (row[i] + row[i - 1]) & 255
            top, left = number // across * side_y + y, number % across * side_x
            if top >= height:
                break
            planes = [row[k * side_x:(k + 1) * side_x] for k in range(4)]
            for x in range(min(side_x, width - left)):
                heights[top][left + x], = struct.unpack(">f", bytes(plane[x] for plane in planes))
    return tags, [value for row in heights for value in row]


class GridsAndSight(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        write_hgt(cls.folder / "N46E007.hgt")
        with open(cls.folder / "log", "w") as log:
            cls.process = subprocess.Popen([BINARY, "serve", cls.folder / "N46E007.hgt", "--listen", "127.0.0.1:0",
                                            "--cache-dir", cls.folder / "cache"],
                                           stdout=subprocess.PIPE, stderr=log, text=True)
        cls.addClassCleanup(cls.stop)
        cls.base = re.search(r"http://127\.0\.0\.1:\d+", cls.process.stdout.readline()).group(0) + "/N46E007"

    @classmethod
    def stop(cls):
        cls.process.send_signal(signal.SIGTERM)
        cls.process.wait(timeout=60)
        cls.process.stdout.close()

    def get(self, target, body=None, kind=NUMBERS):
        request = urllib.request.Request(self.base + target, body, {"Content-Type": kind} if body else {})
        with urllib.request.urlopen(request, timeout=60) as reply:
            return reply.read(), reply.headers

    def refused(self, target, body=None, kind=NUMBERS):
        with self.assertRaises(urllib.error.HTTPError) as raised:
            self.get(target, body, kind)
        with raised.exception as error:
            self.assertEqual(error.code, 400, target)
            return json.loads(error.read())["detail"]

    def heights(self, points, query=""):
        body = b"".join(struct.pack("<2d", *point) for point in points)
        columns = 4 if "normals=1" in query else 1
        data, _ = self.get("/heights" + query, body)
        return list(struct.iter_unpack(f"<{columns}f", data))

    def test_numbers_are_those_of_json(self):
        points = [(7.2 + i / 997, 46.2 + i / 1009) for i in range(300)] + [(0, 0)]
        texts = "|".join(f"{lat!r},{lon!r}" for lon, lat in points)
        results = json.loads(self.get("/heights", json.dumps({"locations": texts}).encode(), "application/json")[0])["results"]
        for (height,), result in zip(self.heights(points), results, strict=True):
            elevation = result["elevation"]  # as many digits as tell the 32-bit float from its neighbours
            self.assertEqual(None if math.isnan(height) else height,
                             elevation and struct.unpack("<f", struct.pack("<f", elevation))[0])

    def test_normals_are_those_of_the_heights_around(self):
        lon, lat, step = 7.3111, 46.2777, 1 / 1200 / 4
        height, east, north, up = self.heights([(lon, lat)], "?normals=1")[0]
        (west_of,), (east_of,), (south_of,), (north_of,) = self.heights(
            [(lon - step, lat), (lon + step, lat), (lon, lat - step), (lon, lat + step)])
        a, b = 111_320 * math.cos(math.radians(lat)), 111_160
        self.assertAlmostEqual(math.hypot(east, north, up), 1, 5)
        self.assertAlmostEqual(-east / up, (east_of - west_of) / (2 * step * a), delta=0.5)
        self.assertAlmostEqual(-north / up, (north_of - south_of) / (2 * step * b), delta=0.5)

    def test_grids_read_back(self):
        raw, headers = self.get(f"/grid?{BOX}")
        floats = struct.unpack(f"<{127 * 95}f", raw)
        points = [(7.2 + 0.2 * x / 126, 46.35 - 0.15 * y / 94) for y in range(95) for x in range(127)]
        expected = [height for first in range(0, len(points), 10_000)
                    for height, in self.heights(points[first:first + 10_000])]
        self.assertLess(max(abs(a - b) for a, b in zip(floats, expected)), 2e-3)
        self.assertIn("width=127, height=95, crs=\"EPSG:4326\"", headers["Terrain-Grid"])

        integers, headers = self.get(f"/grid?{BOX}&format=r16")
        offset, scale = (float(re.search(rf"{name}=([-0-9.e]+)", headers["Terrain-Grid"]).group(1)) for name in ("offset", "scale"))
        values = struct.unpack(f"<{127 * 95}H", integers)
        self.assertEqual((min(values), max(values)), (0, 65535))
        worst = max(abs(offset + scale * value - height) for value, height in zip(values, floats))
        self.assertLessEqual(worst, scale / 2 * 1.001)
        print(f"R16: step {scale:.5f} m, worst {worst / scale:.3f} steps")
        self.assertEqual(read_png16(self.get(f"/grid?{BOX}&format=png16")[0]), (127, 95, list(values)))

        tags, heights = tiff_heights(self.get(f"/grid?{BOX}&format=geotiff")[0])
        self.assertEqual(heights, list(floats))
        self.assertAlmostEqual(tags[33550][0], 0.2 / 126, 12)
        self.assertAlmostEqual(tags[33922][3], 7.2 - 0.1 / 126, 9, "pixels are centred on the nodes")
        self.assertIn(4326, tags[34735])

        described = json.loads(self.get(f"/grid?{BOX}&format=json&range=0,512")[0])
        self.assertAlmostEqual(described["unreal"]["scale_z"], 100, 1)  # the scale of 512 m
        fixed, _ = self.get(f"/grid?{BOX}&format=r16&range=0,512")
        for value, height in zip(struct.unpack(f"<{127 * 95}H", fixed), floats):
            self.assertLessEqual(abs(512 / 65535 * value - min(max(height, 0), 512)), 512 / 65535 / 2 * 1.001)

    def test_grids_in_metres(self):
        raw, headers = self.get("/grid?crs=EPSG:32632&bbox=370000,5120000,371000,5121000&spacing=50")
        self.assertIn("width=21, height=21", headers["Terrain-Grid"])
        floats = struct.unpack("<441f", raw)
        self.assertFalse(any(math.isnan(height) for height in floats))
        served, _ = self.get("/grid?crs=EPSG:32632&bbox=370000,5120000,371000,5121000&spacing=50&surface=served&level=13&error=1")
        self.assertLess(max(abs(a - b) for a, b in zip(floats, struct.unpack("<441f", served))), 40)

    def test_grids_refuse(self):
        for query, says in (
                ("bbox=7,46,8,47&width=0&height=10", "at least 2 nodes"),
                ("bbox=7,46,8,47&width=1000000000&height=1000000000", "more than max_mesh_samples"),
                ("bbox=7,46,8,47&spacing=1e-9", "more than max_mesh_samples"),
                ("bbox=7,46,8,47&width=9&height=9&crs=EPSG:99999", "PROJ knows no EPSG:99999"),
                ("bbox=7,46,8,47&width=9&height=9&crs=EPSG:5773", "is no system of two axes"),
                ("bbox=5e8,0,6e8,1e6&width=9&height=9&crs=EPSG:32632", "no place on Earth"),
                ("bbox=7,47,8,46&width=9&height=9", "bbox is empty"),
                ("bbox=7,46,8,97&width=9&height=9", "latitudes")):
            self.assertIn(says, self.refused("/grid?" + query))

    def test_the_default_admits_the_sizes_of_game_engines(self):
        for side in (1009, 1025):  # Unreal's and Unity's
            self.assertEqual(len(self.get(f"/grid?bbox=7.2,46.2,7.4,46.35&width={side}&height={side}&format=r16")[0]), 2 * side * side)
        self.assertIn("1025 x 1026 nodes, more than max_mesh_samples of this server (1050625)",
                      self.refused("/grid?bbox=7.2,46.2,7.4,46.35&width=1025&height=1026"))

    def test_grids_beside_the_data(self):
        beside = "/grid?bbox=20,10,21,11&width=3&height=2"
        self.assertTrue(all(math.isnan(height) for height in struct.unpack("<6f", self.get(beside)[0])))
        self.assertTrue(all(math.isnan(height) for height in tiff_heights(self.get(beside + "&format=geotiff")[0])[1]))
        for form in ("r16", "png16", "json"):
            refused = self.refused(f"{beside}&format={form}")
            self.assertIn("no node of the grid has a height", refused)
            self.assertRegex(refused, r"in units of the crs, EPSG:4326: degree; the data is in 6\.999\d*,45\.999\d*,8\.000\d*,47\.000\d*: ")
        self.assertEqual(json.loads(self.get(beside + "&format=json&range=0,512")[0])["voids"], 6)
        # Replies name a box as a request does.
        across = "/grid?bbox=170,-20,-170,-10&width=5&height=3&range=0,512&format="
        body = self.get(across + "json")[0]
        self.assertEqual((json.loads(body)["bbox"], json.loads(body)["spacing"]), ([170, -20, -170, -10], [5, 5]))
        self.assertIn("east=-170,", self.get(across + "r16")[1]["Terrain-Grid"])
        # Degrees in a reference system of metres: the box of the message is one that can be asked for.
        degrees = "/grid?crs=EPSG:32632&width=3&height=3&format=r16&bbox="
        refused = self.refused(degrees + "7.2,46.2,7.4,46.3")
        box = re.search(r"in units of the crs, EPSG:32632: metre; the data is in ([-0-9.,]+): ", refused)[1]
        self.assertEqual(len(self.get(degrees + box)[0]), 18)
        # One of a row of landscapes with a common range may be beside the data.
        self.assertEqual(self.get(beside + "&format=r16&range=0,512")[0], bytes(12))

    def test_bodies_refuse(self):
        point = struct.pack("<2d", 7.3, 46.2)
        for body, says in ((point[:-1], "no multiple of 16"), (point * 10_001, "more than 10000 points"),
                           (struct.pack("<2d", math.nan, 46), "longitude"), (struct.pack("<2d", 7, math.inf), "latitude")):
            self.assertIn(says, self.refused("/heights", body))
        self.assertIn("no multiple of 48", self.refused("/sight", point))

    def test_sight_in_all_forms(self):
        ends = (46.25, 7.25, 5, 46.3, 7.35, 5)
        one = json.loads(self.get("/sight?heights=ground&from={},{},{}&to={},{},{}".format(*ends))[0])["results"][0]
        self.assertFalse(one["visible"])  # over hills of 400 m
        self.assertLess(one["clearance"], 0)
        many = {"rays": "|".join([",".join(map(str, ends))] * 2), "heights": "ground"}
        results = json.loads(self.get("/sight", json.dumps(many).encode(), "application/json")[0])["results"]
        self.assertEqual(results, [one, one])
        lat, lon, height, lat2, lon2, height2 = ends
        data, _ = self.get("/sight?heights=ground", struct.pack("<6d", lon, lat, height, lon2, lat2, height2))
        clearance, blocked = struct.unpack("<2f", data)
        self.assertAlmostEqual(clearance, one["clearance"], 2)
        self.assertAlmostEqual(blocked, one["blocked"]["distance"], 1)
        # Where it is blocked, the ray is on the ground.
        ground, = self.heights([(one["blocked"]["lng"], one["blocked"]["lat"])])[0]
        self.assertAlmostEqual(ground, one["blocked"]["height"], delta=0.05)
        # Over the meshes that clients draw, against heights of the same meshes.
        drawn = "surface=served&level=13&error=5"
        served = json.loads(self.get("/sight?heights=ground&{}&from={},{},{}&to={},{},{}".format(drawn, *ends))[0])["results"][0]
        for place, on_ray in ((served["lowest"], served["clearance"]), (served["blocked"], 0)):
            ground, = self.heights([(place["lng"], place["lat"])], "?" + drawn)[0]
            self.assertAlmostEqual(place["height"] - ground, on_ray, delta=0.05)

    def test_served_sight_is_that_of_a_march(self):
        drawn = "surface=served&level=12&error=10"
        compared = 0
        for i in range(12):
            lat, lon, turn = 46.2 + 0.01 * i, 7.3, 0.7 * i
            ends = (lat, lon, 1250, lat + 0.02 * math.cos(turn), lon + 0.02 * math.sin(turn), 1170)
            answer = json.loads(self.get("/sight?{}&from={},{},{}&to={},{},{}".format(drawn, *ends))[0])["results"][0]
            steps = 1000
            points = [(lon + (ends[4] - lon) * k / steps, lat + (ends[3] - lat) * k / steps) for k in range(steps + 1)]
            length = answer["length"]
            lowest = min(1250 - 80 * k / steps - (length ** 2 * (k / steps) * (1 - k / steps)) / (2 * 6.38e6) - ground
                         for k, (ground,) in enumerate(self.heights(points, "?" + drawn)))
            self.assertAlmostEqual(answer["clearance"], lowest, delta=0.5)
            self.assertEqual(answer["visible"], answer["clearance"] >= -1e-3)
            compared += answer["visible"]
        self.assertTrue(0 < compared < 12, compared)

    def test_odd_rays_get_answers(self):
        def look(query):
            return json.loads(self.get("/sight?" + query)[0])["results"][0]
        self.assertEqual(look("from=46.3,7.3,9000&to=46.3,7.3,9000")["remark"], "the ray has no length")
        self.assertEqual(look("from=46.3,7.3,-5000&to=46.3,7.3,9000")["remark"], "the ray begins below the surface")
        beside = look("from=10,7.3,10&to=10,7.4,10")
        self.assertIsNone(beside["clearance"])
        self.assertIn("no height along", beside["remark"])
        self.assertIn("the most is 3000 km", self.refused("/sight?from=46.3,7.3,10&to=-46.3,-172.7,10"))


if __name__ == "__main__":
    unittest.main(verbosity=2)
