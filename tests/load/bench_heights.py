#!/usr/bin/env python3
"""Heights at points beside Open Topo Data: the same raster, the same points, interleaved.

    bench_heights.py TERRACE DATA [--opentopodata DIR] [--rounds N] [--json FILE]

TERRACE is the binary, DATA the folder with the SRTM files of tests/support/test_data.h. DIR is a checkout of
github.com/ajnisbet/opentopodata beside the tree; it runs under gunicorn with one worker and memcached, on Debian's packages
gunicorn, memcached, python3-flask, python3-flask-caching, python3-rasterio, python3-pylibmc, python3-yaml, python3-pyproj,
python3-geographiclib and python3-polyline. One request at a time; both servers have one worker. It gets the first 1,000 of the 10,000
points, as it takes a millisecond a point. Points a second a core are points by the processor time of
the server's processes, the worker and the io thread together; the client's time does not count. Prints one line for each series
and the processor.
"""
import argparse
import atexit
import http.client
import json
import math
import os
import pathlib
import random
import re
import shutil
import signal
import statistics
import struct
import subprocess
import sys
import tempfile
import time

TICKS = os.sysconf("SC_CLK_TCK")
TILES = {"N20W156": "hana_kohala", "N20W157": "maui_se_haleakala", "N20W158": "maui_sw", "N21W157": "maui_ne_molokai",
         "N21W158": "maui_nw_molokai"}
POINTS, FEW = 10_000, 1_000


def processes_below(pid):
    found = [pid]
    for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
        for child in (task / "children").read_text().split():
            found += processes_below(int(child))
    return found


def seconds_of(pid):
    total = 0
    for process in processes_below(pid):
        fields = pathlib.Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        total += int(fields[11]) + int(fields[12])
    return total / TICKS


class Server:
    def __init__(self, name, command, port=None, **options):
        self.name = name
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL if port else subprocess.PIPE, start_new_session=True, text=True, **options)
        if port is None:
            port = int(re.search(r":(\d+)", self.process.stdout.readline()).group(1))
        self.port = port
        atexit.register(self.process.terminate)
        self.connection = http.client.HTTPConnection("127.0.0.1", port, timeout=120)

    def wait(self, target):
        for _ in range(300):
            try:
                return self.get(target)
            except OSError:
                self.connection.close()
                time.sleep(0.1)
        raise RuntimeError(f"{self.name} does not answer")

    def ask(self, method, target, body=None, kind=None):
        self.connection.request(method, target, body, {"Content-Type": kind} if kind else {})
        reply = self.connection.getresponse()
        data = reply.read()
        if reply.status != 200:
            raise RuntimeError(f"{self.name} {target[:80]}: {reply.status} {data[:300]}")
        return data

    def get(self, target):
        return self.ask("GET", target)

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait()


def start_terrace(binary, data, folder):
    srtm = sorted(str(data / f"srtm1_{tile}_{name}.tif") for tile, name in TILES.items())
    config = {"listen": "127.0.0.1:0", "worker_threads": 1, "io_threads": 1, "max_locations": 200_000, "cache_dir": str(folder / "cache"), "datasets": [
        {"name": "single", "sources": [str(data / "srtm1_N20W157_maui_se_haleakala.tif")]},
        {"name": "mosaic", "sources": [*srtm, str(data / "etopo5_global_10min.tif")]},
        {"name": "geoid", "sources": [str(data / "srtm1_N20W157_maui_se_haleakala.tif")], "vertical": "egm96"}]}
    (folder / "terrace.json").write_text(json.dumps(config))
    log = open(folder / "terrace.log", "w")
    server = Server("terrace", [binary, "serve", "--config", folder / "terrace.json"], stderr=log)
    server.wait("/readyz")
    return server


def start_opentopodata(checkout, data, folder):
    for name, tiles in (("single", ["N20W157"]), ("mosaic", TILES)):
        (folder / name).mkdir()
        for tile in tiles:
            os.symlink(data / f"srtm1_{tile}_{TILES[tile]}.tif", folder / name / f"{tile}.tif")
    (folder / "config.yaml").write_text(
        f"max_locations_per_request: {POINTS}\ndatasets:\n" +
        "".join(f"- name: {name}\n  path: {folder / name}/\n" for name in ("single", "mosaic")))
    memcached = subprocess.Popen(["memcached", "-u", "nobody", "-s", "/tmp/memcached.sock", "-a", "0777"])
    atexit.register(memcached.terminate)
    time.sleep(0.5)
    environment = {**os.environ, "CONFIG_PATH": str(folder / "config.yaml")}
    log = open(folder / "opentopodata.log", "w")
    server = Server("opentopodata", ["/usr/bin/python3", "/usr/bin/gunicorn", "--workers", "1", "--bind", "127.0.0.1:8599", "--keep-alive", "120",
                                     "--timeout", "300", "opentopodata.api:app"],
                    port=8599, cwd=checkout, env=environment, stderr=log)
    server.memcached = memcached
    server.wait("/health")
    return server


def json_body(points, **more):
    return json.dumps({"locations": "|".join(f"{lat:.7f},{lon:.7f}" for lat, lon in points), **more}).encode()


def binary_body(points):
    return b"".join(struct.pack("<2d", lon, lat) for lat, lon in points)


def points_in(box, rng, count=POINTS):
    west, south, east, north = box
    return [(rng.uniform(south, north), rng.uniform(west, east)) for _ in range(count)]


# Name, dataset, box: 256 samples are 0.0711 degrees.
PLACES = [("one warm block", "single", (-156.2844, 20.6423, -156.2140, 20.7127)), ("one raster", "single", (-156.99, 20.01, -156.01, 20.99)),
          ("mosaic", "mosaic", (-157.99, 20.01, -156.01, 20.99))]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("terrace", type=pathlib.Path)
    parser.add_argument("data", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("--opentopodata", type=pathlib.Path)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--singles", type=int, default=2000)
    parser.add_argument("--json", type=pathlib.Path)
    arguments = parser.parse_args()
    folder = pathlib.Path(tempfile.mkdtemp())
    servers = [start_terrace(arguments.terrace.resolve(), arguments.data, folder)]
    if arguments.opentopodata:
        servers.append(start_opentopodata(arguments.opentopodata, arguments.data, folder))
    rng = random.Random(11)
    series = {}

    def measure(server, label, count, requests):
        before = seconds_of(server.process.pid)
        begun = time.perf_counter()
        for method, target, body, kind in requests:
            server.ask(method, target, body, kind)
        wall = time.perf_counter() - begun
        used = seconds_of(server.process.pid) - before
        series.setdefault((label, server.name), []).append((count / max(used, 1 / TICKS), count / wall))

    def repeats(server, binary):
        return 1 if server.name == "opentopodata" else (400 if binary else 40)

    for place, dataset, box in PLACES:
        points = points_in(box, rng)
        text, numbers = json_body(points[:FEW], interpolation="bilinear"), binary_body(points)
        own_text = json_body(points)
        for round_number in range(arguments.rounds + 1):
            for server in servers:
                own = server.name == "terrace"
                path = f"/{dataset}/heights" if own else f"/v1/{dataset}"
                times = repeats(server, False)
                measure(server, f"{place}, JSON", (POINTS if own else FEW) * times,
                        [("POST", path, own_text if own else text, "application/json")] * times)
                if own:
                    times = repeats(server, True)
                    measure(server, f"{place}, binary", POINTS * times,
                            [("POST", path, numbers, "application/octet-stream")] * times)
                    if dataset == "single":
                        measure(server, f"{place}, egm96, binary", POINTS * 20,
                                [("POST", "/geoid/heights", numbers, "application/octet-stream")] * 20)
            if round_number == 0:
                series.clear() if place == PLACES[0][0] else [series[k].clear() for k in series if k[0].startswith(place)]
    # Rays of 10 km between points of Maui's ground, in all directions.
    for label, eye, datasets in (("10 km rays 2 m above ground", 2, ("single", "geoid", "mosaic")),
                                 ("10 km rays 300 m above ground", 300, ("single",))):
        rays = b""
        for lat, lon in points_in((-156.42, 20.68, -156.12, 20.82), rng):
            turn = rng.uniform(0, 2 * math.pi)
            rays += struct.pack("<6d", lon, lat, eye, lon + 0.0961 * math.sin(turn), lat + 0.0903 * math.cos(turn), eye)
        for dataset in datasets:
            for round_number in range(arguments.rounds + 1):
                if round_number == 1:
                    series.pop((f"{label}, {dataset}", "terrace"))
                measure(servers[0], f"{label}, {dataset}", POINTS * 5,
                        [("POST", f"/{dataset}/sight?heights=ground", rays, "application/octet-stream")] * 5)
    latencies = {server.name: [] for server in servers}
    for i, (lat, lon) in enumerate(points_in(PLACES[1][2], rng, arguments.singles)):
        for server in servers:
            own = server.name == "terrace"
            target = f"/single/heights?locations={lat:.6f},{lon:.6f}" if own else f"/v1/single?locations={lat:.6f},{lon:.6f}"
            begun = time.perf_counter()
            server.get(target)
            if i >= 100:
                latencies[server.name].append(time.perf_counter() - begun)
    processor = next(line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name"))
    print(processor)
    result = {"processor": processor, "points_per_second": {}, "one_point_ms": {}}
    for (label, name), values in series.items():
        a_core, wall = (statistics.median(v[k] for v in values) for k in (0, 1))
        result["points_per_second"][f"{name}: {label}"] = {"a_core": a_core, "by_the_clock": wall}
        print(f"{name:13} {label:32} {a_core:12,.0f} a second a core, {wall:12,.0f} by the clock")
    for name, values in latencies.items():
        values.sort()
        p50, p99 = (1000 * values[int(len(values) * share)] for share in (0.5, 0.99))
        result["one_point_ms"][name] = {"p50": p50, "p99": p99}
        print(f"{name:13} one point: p50 {p50:.3f} ms, p99 {p99:.3f} ms")
    if arguments.json:
        arguments.json.write_text(json.dumps(result, indent=1))
    for server in servers:
        server.stop()
        if hasattr(server, "memcached"):
            server.memcached.terminate()
            server.memcached.wait()
    shutil.rmtree(folder)


if __name__ == "__main__":
    sys.exit(main())
