#!/usr/bin/env python3
"""Compares the replies of two builds of the server byte by byte: tiles, heights, stated and certified errors.

    tests/load/same_bytes.py OLD NEW [--config FILE] [--tiles N]

Both serve the datasets of FILE (by default many of ../shared/data: mosaics, geoids, feathers, voids, projections, poles) without caches of
tiles. They get the same random requests for `.terrain` (with normals and metadata, and with finer errors), `.glb`, `.png` and `/heights`,
--tiles of each level and dataset. Prints the number of replies and the first ones that differ. Exit status 1: some differ. ETags of heights
count the build, and error pages the version, so they are not compared.
"""
import argparse
import concurrent.futures
import hashlib
import http.client
import json
import math
import pathlib
import random
import socket
import subprocess
import sys
import tempfile
import time

DATA = pathlib.Path(__file__).resolve().parents[2] / "../shared/data"
MAUI = [f"srtm1_{name}.tif" for name in ("N20W157_maui_se_haleakala", "N20W158_maui_sw", "N21W157_maui_ne_molokai", "N21W158_maui_nw_molokai")]
BASE = "etopo5_global_10min.tif"
DATASETS = {
    "geoid": (MAUI[:1], {"vertical": "egm96"}), "single": (MAUI[:1], {}), "mosaic": ([*MAUI, BASE], {}),
    "feather": ([*MAUI, BASE], {"vertical": "egm96", "feather": 400}), "andes": (["srtm3_S33W071_andes.tif"], {"vertical": "egm96"}),
    "alps": (["srtm3_N46E008_swiss_alps.tif"], {}), "utm": (["bigtujunga_30m_utm11.tif"], {"vertical": "egm96"}),
    "antimeridian": (["srtm1_N51E179_antimeridian_w.tif", "srtm1_N51W180_antimeridian_e.tif"], {"vertical": "egm96"}),
    "lidar": (["lidar_greenriver_1m.tif"], {}), "pole": (["pole_antarctica_bedmap_5km.tif"], {"vertical": "egm96"}),
    "earth": ([BASE], {"floor": 0, "water": {"sea_level": 0}, "vertical": "egm96"}),
    "voids": (["srtm1_N48W125_cape_flattery_half_void.tif", BASE], {}), "mercator": (["webmercator_sf_float32.tif"], {}),
    "coarse": (["azores_topobathy_1min_float32.tif", "etopo1_global_1deg_float32.tif"], {"feather": 20000}),
    "holes": (["lidar_slovenia_1m_nodata.tif"], {"vertical": "egm96"}), "custom": (["greenland_80N_100m_custom_tm.tif"], {}),
}


def default_config():
    datasets = [{"name": name, "sources": [str((DATA / file).resolve()) for file in files], **options} for name, (files, options) in DATASETS.items()]
    datasets.append({"name": "sea", "sources": [*({"path": str((DATA / file).resolve()), "nodata": 0} for file in MAUI), str((DATA / BASE).resolve())]})
    return {"datasets": datasets}


class Server:
    def __init__(self, binary, config, cache, names):
        self.names = names
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]
        self.process = subprocess.Popen([binary, "serve", "--config", config, "--listen", f"127.0.0.1:{self.port}", "--worker-threads", "2",
                                         "--cache-bytes", "0", "--cache-dir", cache, "--log-level", "error", "--access-log", "off"],
                                        stdout=subprocess.DEVNULL)
        while not self.is_ready():
            if self.process.poll() is not None:
                raise SystemExit(f"same_bytes.py: {binary} does not start; run it by hand on {config}")
            time.sleep(0.2)

    def is_ready(self):
        try:
            # Also of datasets that are prepared after the start.
            return self.get("/readyz")[0] == 200 and all(self.get(f"/{name}/layer.json")[0] == 200 for name in self.names)
        except OSError:
            return False

    def get(self, url):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=600)
        connection.request("GET", url)
        reply = connection.getresponse()
        body = reply.read()
        connection.close()
        return reply.status, body, {name.lower(): value for name, value in reply.getheaders()}

    def digest(self, url):
        status, body, headers = self.get(url)
        if status != 200:
            return str(status)
        kept = sorted(name for name in headers if name.startswith("terrain-") or (name == "etag" and "/heights" not in url))
        return f"{hashlib.sha256(body).hexdigest()} {[(name, headers[name]) for name in kept]}"

    def stop(self):
        self.process.terminate()
        self.process.wait()


def mercator_key(chooser, bounds, zoom):
    longitude, latitude = chooser.uniform(bounds[0], bounds[2]), max(-85, min(85, chooser.uniform(bounds[1], bounds[3])))
    x = int((longitude + 180) / 360 * 2**zoom)
    y = int((1 - math.asinh(math.tan(math.radians(latitude))) / math.pi) / 2 * 2**zoom)
    return x % 2**zoom, max(0, min(y, 2**zoom - 1))


def requests_of(server, name, tiles, chooser):
    for level, ranges in enumerate(json.loads(server.get(f"/{name}/layer.json")[1])["available"]):
        keys = [(chooser.randint(r["startX"], r["endX"]), chooser.randint(r["startY"], r["endY"])) for r in ranges for _ in range(tiles)]
        chooser.shuffle(keys)
        for x, y in keys[:tiles]:
            kind = chooser.choice((".terrain?extensions=octvertexnormals-metadata", ".terrain?fraction=0.03125", ".glb"))
            yield f"/{name}/{level}/{x}/{y}{kind}"
    status, body, _ = server.get(f"/{name}/tiles.json")
    if status != 200:
        return
    document = json.loads(body)
    bounds = document["bounds"]
    for zoom in range(document.get("minzoom", 0), document["maxzoom"] + 1):
        for _ in range(max(1, tiles // 4)):
            x, y = mercator_key(chooser, bounds, zoom)
            yield f"/{name}/{zoom}/{x}/{y}.png"
    points = "|".join(f"{chooser.uniform(max(bounds[1], -89), min(bounds[3], 89)):.6f},{chooser.uniform(bounds[0], bounds[2]):.6f}" for _ in range(40))
    yield f"/{name}/heights?locations={points}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old")
    parser.add_argument("new")
    parser.add_argument("--config", type=pathlib.Path)
    parser.add_argument("--tiles", type=int, default=8)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        config = json.loads(arguments.config.read_text(encoding="utf-8")) if arguments.config else default_config()
        path = str(arguments.config or f"{folder}/config.json")
        if not arguments.config:
            pathlib.Path(path).write_text(json.dumps(config), encoding="utf-8")
        names = [dataset["name"] for dataset in config["datasets"]]
        servers = [Server(binary, path, f"{folder}/cache", names) for binary in (arguments.old, arguments.new)]
        try:
            chooser = random.Random(11)
            urls = [url for dataset in config["datasets"] for url in requests_of(servers[0], dataset["name"], arguments.tiles, chooser)]
            with concurrent.futures.ThreadPoolExecutor(4) as pool:
                old, new = (list(pool.map(server.digest, urls)) for server in servers)
        finally:
            for server in servers:
                server.stop()
    differing = [url for url, a, b in zip(urls, old, new) if a != b]
    found = sum(not digest.isdigit() for digest in old)
    print(f"{len(urls)} replies of {len(config['datasets'])} datasets, {found} with status 200, {len(differing)} differ")
    for url in differing[:10]:
        print(f"  {url[:120]}")
    return 1 if differing or not found else 0


if __name__ == "__main__":
    sys.exit(main())
