#!/usr/bin/env python3
"""Compares the memory of a server over many rasters with the formula of docs/operations.md.

    tests/load/many_rasters.py BINARY [--dem FILE] [--rasters N] [--tiles N] [--cache-mb N]

Places one DEM of 1 degree (by default an SRTM cell of ../shared/data) N times on a grid of one-degree cells, as VRT files that take no space,
serves them as one dataset with small caches and two workers, and requests N random tiles of all levels, four at a time. Prints the peak
of the resident memory after the start, and after the tiles, beside the formula. Exit status 1: it is above the formula.
"""
import argparse
import concurrent.futures
import http.client
import json
import math
import os
import pathlib
import random
import re
import socket
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
WORKERS, MB = 2, 2**20


def place(dem, folder, count):
    side = math.ceil(math.sqrt(count))
    half = 1 / 7200  # SRTM cells have a node on each edge
    for k in range(count):
        west, south = -120 + k % side, -20 + k // side
        corners = [str(v) for v in (west - half, south + 1 + half, west + 1 + half, south - half)]
        subprocess.run(["gdal_translate", "-q", "-of", "VRT", "-a_ullr", *corners, dem, f"{folder}/cell{k}.vrt"], check=True)


def ask(port, url):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=600)
    connection.request("GET", url)
    reply = connection.getresponse()
    body = reply.read()
    connection.close()
    return reply.status, body


def start(binary, dem, folder, cache_mb):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    config = {"listen": f"127.0.0.1:{port}", "worker_threads": WORKERS, "cache_bytes": cache_mb * MB, "refinement_cache_bytes": cache_mb * MB,
              "gdal_cache_bytes": cache_mb * MB, "transfer_bytes": cache_mb * MB, "cache_dir": f"{folder}/cache", "cache_dir_bytes": 2**40,
              "allowed_drivers": ["VRT", "GTiff"], "data_roots": [folder, str(dem.parent)],
              "log_level": "error", "access_log": "off", "datasets": [{"name": "d", "sources": [f"{folder}/cells/*.vrt"]}]}
    pathlib.Path(folder, "config.json").write_text(json.dumps(config), encoding="utf-8")
    server = subprocess.Popen([binary, "serve", "--config", f"{folder}/config.json"], stdout=subprocess.DEVNULL)
    while True:
        try:
            if ask(port, "/readyz")[0] == 200:
                return server, port
        except OSError:
            pass
        if server.poll() is not None:
            raise SystemExit("many_rasters.py: the server does not start; run it by hand")
        time.sleep(0.5)


def peak_mb(server):
    return int(re.search(r"VmHWM:\s+(\d+)", pathlib.Path(f"/proc/{server.pid}/status").read_text(encoding="utf-8"))[1]) / 1024


def draw(port, count):
    available = json.loads(ask(port, "/d/layer.json")[1])["available"]
    levels = [(z, ranges) for z, ranges in enumerate(available) if ranges]
    chooser = random.Random(5)
    for _ in range(count):
        z, ranges = chooser.choice(levels)
        r = chooser.choice(ranges)
        x, y = chooser.randint(r["startX"], r["endX"]), chooser.randint(r["startY"], r["endY"])
        yield f"/d/{z}/{x}/{y}" + chooser.choice((".terrain", ".terrain", ".terrain?fraction=0.0625", ".glb"))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary")
    parser.add_argument("--dem", type=pathlib.Path, default=ROOT / "../shared/data/srtm1_N20W157_maui_se_haleakala.tif")
    parser.add_argument("--rasters", type=int, default=400)
    parser.add_argument("--tiles", type=int, default=3000)
    parser.add_argument("--cache-mb", type=int, default=32)
    arguments = parser.parse_args()
    dem = arguments.dem.resolve()
    with tempfile.TemporaryDirectory() as folder:
        os.mkdir(f"{folder}/cells")
        place(str(dem), f"{folder}/cells", arguments.rasters)
        first = start(arguments.binary, dem, folder, arguments.cache_mb)[0]
        first.kill()  # statistics are kept; the peak of reading them is another matter
        first.wait()
        server, port = start(arguments.binary, dem, folder, arguments.cache_mb)
        try:
            before = peak_mb(server)
            urls = list(draw(port, arguments.tiles))
            with concurrent.futures.ThreadPoolExecutor(4) as pool:
                statuses = [status for status, _ in pool.map(lambda url: ask(port, url), urls)]
            after = peak_mb(server)
        finally:
            server.terminate()
            server.wait()
    tables = min(arguments.rasters * 0.09, 256)
    formula = 4 * arguments.cache_mb + WORKERS * 20 + 100 + 64 + 32 + 8 + tables
    wrong = len(statuses) - statuses.count(200)
    print(f"{arguments.rasters} rasters, {arguments.tiles} tiles, {wrong} failed: {before:.0f} MB at the start, {after:.0f} MB in all; "
          f"formula {formula:.0f} MB, of which {tables:.0f} MB are tables")
    return 0 if after <= formula and wrong == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
