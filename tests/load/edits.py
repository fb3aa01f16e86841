#!/usr/bin/env python3
"""What edits cost: a runway in a 10 m model, 100,000 features, a change under load.

    tests/load/edits.py TERRACE DATA [--parts runway,many,change] [--rounds N] [--tiles N]

DATA is the folder with srtm1_N20W157_maui_se_haleakala.tif.
runway: a runway of 3 km x 60 m with `slope`, in the model resampled to 10 m: tiles that meet it without precision, with 0.1 m on the runway, and
        whole at 0.1 m (`error=0.1`): vertices, bytes, milliseconds of the server's processor time, the least of N rounds in turns.
many:   100,000 polygons beside the tiles: seconds of processor time and memory of the start, and instructions of cold tiles that none of them touches
        (callgrind), against the same server without them.
change: the height of a corner of the runway changes while clients request all tiles around it: replies that are neither those of the old file nor
        those of the new one, and tiles that are built again, against tiles whose bytes changed.
"""
import argparse
import concurrent.futures
import gzip
import hashlib
import http.client
import json
import math
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import cold_instructions  # noqa: E402

MODEL = "srtm1_N20W157_maui_se_haleakala.tif"
LON, LAT = -156.235, 20.775  # the middle of the runway, on the slope of Haleakala
EAST, NORTH = 104_100, 110_700  # metres a degree
TURN, LENGTH, WIDTH = math.radians(60), 3000, 60


def place(along, across):
    """Degrees of metres along the runway and across it."""
    east = along * math.sin(TURN) + across * math.cos(TURN)
    north = along * math.cos(TURN) - across * math.sin(TURN)
    return LON + east / EAST, LAT + north / NORTH


def feature(terrain, ring):
    return {"type": "Feature", "properties": {"terrain": terrain}, "geometry": {"type": "Polygon", "coordinates": [ring + ring[:1]]}}


def runway(precision=None):
    corners = [place(x * LENGTH / 2, y * WIDTH / 2) for x, y in ((-1, -1), (-1, 1), (1, 1), (1, -1))]
    heights = [2050, 2050, 1775, 1775]
    found = [feature({"op": "slope", "blend_m": 120}, [[*corner, h] for corner, h in zip(corners, heights)])]
    if precision:
        found.append(feature({"op": "precision", "error_m": precision, "blend_m": 200}, [list(corner) for corner in corners]))
    return {"type": "FeatureCollection", "features": found}


class Server:
    def __init__(self, binary, folder, datasets, **options):
        path = folder / "terrace.json"
        path.write_text(json.dumps({"listen": "127.0.0.1:0", "io_threads": 1, "cache_dir": str(folder / "cache"), "log_level": "error",
                                    "datasets": datasets, **options}))
        self.process = subprocess.Popen([binary, "serve", "--config", path], stdout=subprocess.PIPE, text=True)
        self.address = re.search(r"[\d.]+:\d+", self.process.stdout.readline())[0]
        self.local = threading.local()

    def get(self, target):
        if not hasattr(self.local, "connection"):
            self.local.connection = http.client.HTTPConnection(self.address, timeout=600)
        self.local.connection.request("GET", target)
        reply = self.local.connection.getresponse()
        return reply.status, reply.read(), dict(reply.getheaders())

    def tile(self, target):
        status, body, headers = self.get(target)
        if status != 200:
            raise RuntimeError(f"{target}: {status} {body[:200]}")
        return body, headers

    def layer(self, name):
        while True:
            status, body, _ = self.get(f"/{name}/layer.json")
            if status == 200:
                return json.loads(body)
            time.sleep(0.1)

    def used(self):
        """Processor seconds, and the largest and present memory in MB."""
        fields = pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        most, now = (int(re.search(rf"{key}:\s+(\d+)", status)[1]) / 1024 for key in ("VmHWM", "VmRSS"))
        return (int(fields[11]) + int(fields[12])) / 100, most, now

    def milliseconds(self):
        """Processor time of all threads."""
        return time.clock_gettime_ns(~self.process.pid << 3 | 2) / 1e6  # clock_getcpuclockid(3)

    def stop(self):
        self.process.terminate()
        self.process.stdout.close()
        self.process.wait()


def tiles_on_runway(level):
    side = 180 / 2**level
    return sorted({(int((lon + 180) / side), int((lat + 90) / side))
                   for i in range(1501) for j in range(-6, 7)
                   for lon, lat in [place(LENGTH * (i / 1500 - 0.5), WIDTH / 2 * j / 6)]})


def vertices(body):
    data = gzip.decompress(body) if body[:2] == b"\x1f\x8b" else body
    return struct.unpack_from("<I", data, 88)[0], len(data)


def measure_runway(binary, data, folder, rounds):
    fine = folder / "fine.tif"
    side = 8000
    subprocess.run(["gdalwarp", "-q", "-r", "bilinear", "-t_srs", "EPSG:32604", "-tr", "10", "10", "-te_srs", "EPSG:4326", "-te", str(LON - side / EAST),
                    str(LAT - side / NORTH), str(LON + side / EAST), str(LAT + side / NORTH), data / MODEL, fine], check=True)
    (folder / "slope.geojson").write_text(json.dumps(runway()))
    (folder / "precise.geojson").write_text(json.dumps(runway(precision=0.1)))
    server = Server(binary, folder, [{"name": name, "sources": [str(fine)], "edits": [str(folder / f"{name}.geojson")]} for name in ("slope", "precise")],
                    worker_threads=1, cache_bytes=0, refinement_cache_bytes=0)
    levels = len(server.layer("slope")["available"])
    print("| level | tiles | vertices: no precision, precision, whole tiles | bytes | ms |\n|---|---|---|---|---|")
    for level in range(13, len(server.layer("precise")["available"])):
        tiles = tiles_on_runway(level)
        # Without precision there are no tiles on the levels that it adds.
        series = ([("slope", "")] if level < levels else []) + [("precise", ""), ("slope" if level < levels else "precise", "?error=0.1")]
        rows, least = [], [math.inf] * len(series)
        for i in range(rounds):
            for k, (name, query) in enumerate(series):
                before = server.milliseconds()
                replies = [server.tile(f"/{name}/{level}/{x}/{y}.terrain{query}") for x, y in tiles]
                least[k] = min(least[k], server.milliseconds() - before)
                if i == 0:
                    counted = [vertices(body) for body, _ in replies]
                    rows.append((sum(v for v, _ in counted), sum(b for _, b in counted)))
        missing = "-, " if len(series) == 2 else ""
        print(f"| {level} | {len(tiles)} | {missing}{', '.join(f'{v:,}' for v, _ in rows)} | {missing}{', '.join(f'{b:,}' for _, b in rows)} | "
              f"{missing}{', '.join(f'{ms:.1f}' for ms in least)} |", flush=True)
    server.stop()


def measure_many(binary, data, folder, tiles):
    # 316 x 317 rectangles of 60 x 60 m in the north-west of the model.
    box = [(-156.99 + 0.0012 * i, 20.62 + 0.0011 * j) for i in range(316) for j in range(317)][:100_000]
    features = [feature({"op": "flatten", "height": 100 + k % 50, "blend_m": 5},
                        [[x, y], [x + 0.0006, y], [x + 0.0006, y + 0.00055], [x, y + 0.00055]]) for k, (x, y) in enumerate(box)]
    many = folder / "many.geojson"
    many.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    print(f"{len(features)} polygons, {many.stat().st_size / 1e6:.0f} MB")
    plain_dataset = {"name": "srtm1_N20W157_maui_se_haleakala", "sources": [str(data / MODEL)]}
    for _ in range(2):  # the first start fills the cache folder
        for name, edits in (("without", []), ("with", [str(many)])):
            server = Server(binary, folder, [{**plain_dataset, "edits": edits}])
            server.layer(plain_dataset["name"])
            seconds, most, now = server.used()
            print(f"start {name}: {seconds:.2f} s of processor time, {now:.0f} MB, {most:.0f} MB at most", flush=True)
            server.stop()
    side = 180 / 2**13
    drawn = [(13, int((-156.30 + 0.021 * i + 180) / side), int((20.66 + 0.021 * j + 90) / side)) for i in range(12) for j in range(6)]
    drawn = list(dict.fromkeys(drawn))[:tiles]
    dem = data / MODEL
    first = None
    for command in (str(binary), f"{binary} --edits {many}"):
        cost, _ = cold_instructions.instructions(command, dem, ".terrain", len(drawn), drawn, is_warm=False)
        first = first or cost
        print(f"cold tiles {'with' if '--edits' in command else 'without'}: {cost:,.0f} instructions a tile, {cost / first:.4f}, "
              f"{len(drawn) - cold_instructions.WARM_UP} tiles", flush=True)


def measure_change(binary, data, folder):
    edits = folder / "change.geojson"
    edits.write_text(json.dumps(runway(precision=0.5)))
    after = runway(precision=0.5)
    after["features"][0]["geometry"]["coordinates"][0][1][2] += 25
    dataset = {"name": "maui", "sources": [str(data / MODEL)], "edits": [str(edits)]}
    server = Server(binary, folder, [dataset])
    layer = server.layer("maui")
    old_version = layer["version"]
    urls = []
    for level in range(8, len(layer["available"])):
        side = 180 / 2**level
        x0, y0 = int((LON + 180) / side), int((LAT + 90) / side)
        reach = 10
        urls += [f"/maui/{level}/{x}/{y}.terrain" for x in range(x0 - reach, x0 + reach + 1) for y in range(y0 - reach, y0 + reach + 1)
                 if any(a["startX"] <= x <= a["endX"] and a["startY"] <= y <= a["endY"] for a in layer["available"][level])]
    def fetch(url):
        body, headers = server.tile(url)
        return hashlib.sha256(body).digest(), headers["Server-Timing"].split(",")[0].split("desc=")[1].strip(), headers.get("ETag")
    with concurrent.futures.ThreadPoolExecutor(8) as clients:
        old = dict(zip(urls, clients.map(fetch, urls)))
        seen, stop = [], threading.Event()
        def load(offset):
            mine = urls[offset::4]
            while not stop.is_set():
                for url in mine:
                    seen.append((url, *fetch(url)))
        jobs = [clients.submit(load, k) for k in range(4)]
        time.sleep(1)
        temporary = edits.with_suffix(".new")
        temporary.write_text(json.dumps(after))
        temporary.rename(edits)
        while server.layer("maui")["version"] == old_version:
            time.sleep(0.05)
        seen += [(url, *found) for url, found in zip(urls, clients.map(fetch, urls))]
        stop.set()
        for job in jobs:
            job.result()
    server.stop()
    fresh = Server(binary, folder, [dataset])
    fresh.layer("maui")
    new = {url: hashlib.sha256(fresh.tile(url)[0]).digest() for url in urls}
    fresh.stop()
    changed = {url for url in urls if new[url] != old[url][0]}
    neither = sum(1 for url, body, *_ in seen if body not in (old[url][0], new[url]))
    built = {url for url, _, cache, _ in seen if cache in ("miss", "join")}
    print(f"{len(urls)} cached tiles of levels 8 to {len(layer['available']) - 1}; {len(seen)} replies under load; other bytes after the change: {len(changed)}; "
          f"built again: {len(built)}, of them with the same bytes {len(built - changed)}; changed but not seen built: {len(changed - built)}; "
          f"replies that are neither of the old nor of the new file: {neither}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("terrace", type=pathlib.Path)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("--parts", default="runway,many,change")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--tiles", type=int, default=63)
    arguments = parser.parse_args()
    binary, data = arguments.terrace.resolve(), arguments.data.resolve()
    for part in arguments.parts.split(","):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            if part == "runway":
                measure_runway(binary, data, folder, arguments.rounds)
            elif part == "many":
                measure_many(binary, data, folder, arguments.tiles)
            else:
                measure_change(binary, data, folder)


if __name__ == "__main__":
    sys.exit(main())
