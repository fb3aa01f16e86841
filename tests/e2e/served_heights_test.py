"""Heights as drawn, of the real binary: served_heights_test.py BINARY SOURCE_DIR.

Decodes tiles by itself, quantized-mesh and GLB, and intersects the plumb line through each point with the flat triangles. What
/heights?surface=served says must be within a millimetre of that. TERRACE_LONG_TESTS=1 checks 10,000 points on each dataset.
"""
import json
import math
import os
import pathlib
import random
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

from srtm import write_hgt

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()
DATA = pathlib.Path(os.environ.get("TERRACE_TEST_DATA", SOURCE_DIR / "../shared/data")).resolve()
POINTS = 10_000 if os.environ.get("TERRACE_LONG_TESTS") == "1" else 200
# Name, sources, options, box of the points, level, requested error.
DATASETS = [
    ("alps", ["srtm3_N46E008_swiss_alps.tif"], {}, (8.2, 46.2, 8.5, 46.5), 11, 20),  # with voids
    ("tujunga", ["bigtujunga_30m_utm11.tif"], {}, (-118.3, 34.25, -118.2, 34.35), 12, 3),
    ("slovenia", ["lidar_slovenia_1m_nodata.tif"], {}, None, 16, 0.3),
    ("maui", ["srtm1_N20W157_maui_se_haleakala.tif", "etopo5_global_10min.tif"], {"vertical": "egm96"},
     (-156.5, 20.6, -156.2, 20.8), 12, 10),
    ("earth", ["etopo5_global_10min.tif"], {"floor": 0}, (-180, -89, 180, 89), 1, 500),
]
# Edits of the sample: a cliff, a runway with deeper levels, a hole.
EDITED = ("edited", [str(SOURCE_DIR / "config/samples/jacksboro.tif")], {"edits": ["edits.geojson"]}, (-84.2508, 36.2993, -84.2472, 36.3012), 17, 0.3)


def ring(west, south, east, north):
    return [[[west, south], [east, south], [east, north], [west, north], [west, south]]]


def edits():
    boxes = {"offset": (-84.2498, 36.2999, -84.2480, 36.3006), "precision": (-84.2506, 36.2994, -84.2474, 36.3011),
             "hole": (-84.2500, 36.2996, -84.2494, 36.3002)}
    terrain = {"offset": {"metres": 30, "blend_m": 20}, "precision": {"error_m": 0.3, "blend_m": 40}, "hole": {}}
    return {"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": {"terrain": {"op": op, **terrain[op]}}, "geometry": {"type": "Polygon", "coordinates": ring(*box)}}
        for op, box in boxes.items()]}


A, F = 6378137.0, 1 / 298.257223563
E2 = F * (2 - F)


def ecef(longitude, latitude, height):
    lon, lat = math.radians(longitude), math.radians(latitude)
    n = A / math.sqrt(1 - E2 * math.sin(lat) ** 2)
    return ((n + height) * math.cos(lat) * math.cos(lon), (n + height) * math.cos(lat) * math.sin(lon),
            (n * (1 - E2) + height) * math.sin(lat))


def up_at(longitude, latitude):
    lon, lat = math.radians(longitude), math.radians(latitude)
    return (math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat))


def sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def decode_terrain(data, z, x, y):
    """Vertices in ECEF and triangles of a quantized-mesh tile."""
    least, most = struct.unpack_from("<2f", data, 24)
    at = 88
    count, = struct.unpack_from("<I", data, at)
    at += 4
    axes = []
    for _ in range(3):
        value, values = 0, []
        for code in struct.unpack_from(f"<{count}H", data, at):
            value += (code >> 1) ^ -(code & 1)
            values.append(value)
        axes.append(values)
        at += 2 * count
    wide = count > 65536
    at += -at % (4 if wide else 2)
    triangles, = struct.unpack_from("<I", data, at)
    codes = struct.unpack_from(f"<{3 * triangles}{'I' if wide else 'H'}", data, at + 4)
    highest, indices = 0, []
    for code in codes:
        indices.append(highest - code)
        highest += code == 0
    side = 180 / 2 ** z
    positions = [ecef(-180 + (x + u / 32767) * side, -90 + (y + v / 32767) * side, least + h / 32767 * (most - least))
                 for u, v, h in zip(*axes)]
    return positions, [tuple(indices[i:i + 3]) for i in range(0, len(indices), 3)]


def decode_glb(data):
    """The same of a GLB without compression; its skirts come with it, as vertical triangles."""
    length, = struct.unpack_from("<I", data, 12)
    document = json.loads(data[20:20 + length])
    binary = data[28 + length:]
    node = document["nodes"][document["scenes"][0]["nodes"][0]]
    primitive = document["meshes"][node["mesh"]]["primitives"][0]

    def values(index):
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        letter = {5121: "B", 5123: "H", 5125: "I", 5126: "f"}[accessor["componentType"]]
        parts = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        stride = view.get("byteStride", struct.calcsize(f"<{parts}{letter}"))
        return [struct.unpack_from(f"<{parts}{letter}", binary, start + i * stride) for i in range(accessor["count"])]

    matrix = node.get("matrix", [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
    if "translation" in node:
        matrix[12:15] = node["translation"]

    def placed(p):
        glb = [sum(matrix[4 * k + row] * p[k] for k in range(3)) + matrix[12 + row] for row in range(3)]
        return glb[0], -glb[2], glb[1]  # y is up in glTF

    positions = [placed(p) for p in values(primitive["attributes"]["POSITION"])]
    indices = [i for i, in values(primitive["indices"])]
    return positions, [tuple(indices[i:i + 3]) for i in range(0, len(indices), 3)]


class Mesh:
    """Triangles in buckets of their boxes of directions, and the plumb line's meeting with them."""
    SIDE = 48

    def __init__(self, positions, triangles, box):
        self.positions, self.box = positions, box
        self.buckets = {}
        places = [self.place(p) for p in positions]
        # The edges of flat triangles are no straight lines in degrees.
        grown = 1 if box[2] - box[0] > 1 else 0
        for triangle in triangles:
            us, vs = [places[i][0] for i in triangle], [places[i][1] for i in triangle]
            for row in range(int(min(vs)) - grown, int(max(vs)) + 1 + grown):
                for column in range(int(min(us)) - grown, int(max(us)) + 1 + grown):
                    self.buckets.setdefault((column, row), []).append(triangle)
        self.triangles = triangles

    def place_of(self, longitude, latitude):
        west, south, east, north = self.box
        return ((longitude - west) / (east - west) * self.SIDE, (latitude - south) / (north - south) * self.SIDE)

    def place(self, p):
        longitude = math.degrees(math.atan2(p[1], p[0]))
        west, _, east, _ = self.box
        if longitude < west - 90:
            longitude += 360
        if longitude > east + 90:
            longitude -= 360
        # Geodetic latitude, by iteration.
        flat = math.hypot(p[0], p[1])
        latitude = math.atan2(p[2], flat * (1 - E2))
        for _ in range(4):
            n = A / math.sqrt(1 - E2 * math.sin(latitude) ** 2)
            latitude = math.atan2(p[2] + E2 * n * math.sin(latitude), flat)
        return self.place_of(longitude, math.degrees(latitude))

    def heights_at(self, longitude, latitude):
        """All heights at which the plumb line meets triangles that are seen from above."""
        u, v = self.place_of(longitude, latitude)
        found = self._meet(self.buckets.get((int(u), int(v)), []), longitude, latitude)
        return found or self._meet(self.triangles, longitude, latitude)

    def _meet(self, triangles, longitude, latitude):
        start, up = ecef(longitude, latitude, 0), up_at(longitude, latitude)
        heights = []
        for i, j, k in triangles:
            a = self.positions[i]
            ab, ac = sub(self.positions[j], a), sub(self.positions[k], a)
            normal = cross(ab, ac)
            facing = dot(normal, up)
            if facing <= 1e-3 * math.sqrt(dot(normal, normal)):  # a skirt
                continue
            across = cross(up, ac)
            determinant = dot(ab, across)
            from_a = sub(start, a)
            b = dot(from_a, across) / determinant
            turned = cross(from_a, ab)
            c = dot(up, turned) / determinant
            if min(b, c, 1 - b - c) >= -1e-7:
                heights.append(dot(ac, turned) / determinant)
        return heights


class Served(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        write_hgt(cls.folder / "N46E007.hgt")
        (cls.folder / "edits.geojson").write_text(json.dumps(edits()))
        cls.datasets = [("hills", None, {}, (7.1, 46.1, 7.4, 46.4), 11, 20), EDITED]
        if DATA.is_dir():
            cls.datasets += DATASETS
        else:
            print(f"SKIPPED in part: no elevation data in {DATA} (TERRACE_TEST_DATA)")
        config = {"listen": "127.0.0.1:0", "max_locations": 20000, "cache_dir": str(cls.folder / "cache"), "datasets": [
            {"name": name, "sources": [str(DATA / s) for s in sources] if sources else [str(cls.folder / "N46E007.hgt")],
             **options} for name, sources, options, *_ in cls.datasets]}
        (cls.folder / "terrace.json").write_text(json.dumps(config))
        with open(cls.folder / "log", "w") as log:
            cls.process = subprocess.Popen([BINARY, "serve", "--config", cls.folder / "terrace.json"],
                                           stdout=subprocess.PIPE, stderr=log, text=True)
        cls.addClassCleanup(cls.stop)
        match = re.search(r"http://127\.0\.0\.1:\d+", cls.process.stdout.readline())
        if not match:
            raise RuntimeError((cls.folder / "log").read_text())
        cls.base = match.group(0)

    @classmethod
    def stop(cls):
        cls.process.send_signal(signal.SIGTERM)
        cls.process.wait(timeout=60)
        cls.process.stdout.close()

    def get(self, target, body=None, kind="application/json"):
        request = urllib.request.Request(self.base + target, data=body, headers={"Content-Type": kind} if body else {})
        with urllib.request.urlopen(request, timeout=120) as reply:
            return reply.read()

    def refused(self, target, body=None, kind="application/octet-stream"):
        with self.assertRaises(urllib.error.HTTPError) as raised:
            self.get(target, body, kind)
        with raised.exception as error:
            return error.code, json.loads(error.read())["detail"]

    def box_of(self, name, box):
        if box:
            return box
        found = next(d for d in json.loads(self.get("/datasets"))["datasets"] if d["name"] == name)
        return found["bounds"]

    def check(self, mesh_format):
        for name, _, _, box, level, error in self.datasets:
            with self.subTest(dataset=name, format=mesh_format):
                west, south, east, north = self.box_of(name, box)
                rng = random.Random(name)
                points = [(rng.uniform(south, north), rng.uniform(west, east)) for _ in range(POINTS)]
                query = f"surface=served&level={level}&error={error}&format={mesh_format}&normals=1"
                query += "&compression=none" if mesh_format == "glb" else ""
                body = json.dumps({"locations": "|".join(f"{lat!r},{lon!r}" for lat, lon in points)}).encode()
                results = json.loads(self.get(f"/{name}/heights?{query}", body))["results"]
                meshes, worst, beside, in_holes = {}, 0, 0, 0
                for (latitude, longitude), result in zip(points, results):
                    tile = result["tile"]
                    if tile not in meshes:
                        z, x, y = map(int, tile.split("/"))
                        self.assertLessEqual(z, level)
                        side = 180 / 2 ** z
                        tile_box = (-180 + x * side, -90 + y * side, -180 + (x + 1) * side, -90 + (y + 1) * side)
                        more = "&compression=none" if mesh_format == "glb" else ""
                        data = self.get(f"/{name}/{tile}.{mesh_format}?error={error}{more}")
                        decoded = decode_glb(data) if mesh_format == "glb" else decode_terrain(data, z, x, y)
                        meshes[tile] = Mesh(*decoded, tile_box)
                    heights = meshes[tile].heights_at(longitude, latitude)
                    if result["elevation"] is None:
                        self.assertEqual(heights, [], (latitude, longitude))
                        in_holes += 1
                        continue
                    if not heights:
                        beside += 1
                        continue
                    difference = min(abs(h - result["elevation"]) for h in heights)
                    # Heights are 32-bit floats: half a unit at 8 km is 0.25 mm.
                    worst = max(worst, difference)
                    self.assertAlmostEqual(math.hypot(*result["normal"]), 1, places=5)
                print(f"{name} {mesh_format}: {len(points)} points in {len(meshes)} tiles, worst {1000 * worst:.3f} mm, "
                      f"{beside} beside all triangles, {in_holes} in holes, deepest level {max(int(tile.split('/')[0]) for tile in meshes)}")
                self.assertLess(worst, 1e-3)
                self.assertLess(beside, POINTS / 100)
                self.assertEqual(in_holes > POINTS / 100, name == "edited")

    def test_terrain(self):
        self.check("terrain")

    def test_glb(self):
        self.check("glb")

    def test_levels_and_errors(self):
        self.assertEqual(self.refused("/hills/heights?surface=served&level=20&locations=46.2,7.2", kind=None)[0], 400)
        self.assertIn("levels from 0 to", self.refused("/hills/heights?surface=served&level=20&locations=46.2,7.2")[1])
        # The level of an error is the first with a default error that small.
        reply = json.loads(self.get("/hills/heights?surface=served&error=40&locations=46.2,7.2"))["results"][0]
        self.assertEqual(reply["tile"].split("/")[0], "10")
        spread = "|".join(f"{46 + i / 101},{7 + j / 101}" for i in range(1, 100, 7) for j in range(1, 100, 7))
        self.assertIn("more than 64 tiles", self.refused(
            "/hills/heights?surface=served&level=13", json.dumps({"locations": spread}).encode(), "application/json")[1])


if __name__ == "__main__":
    unittest.main(verbosity=2)
