#!/usr/bin/env python3
"""Flies one way with terrace fly and with cesium-native, one after the other, against one server, and compares the tiles that both request.

    beside_native.py TERRACE HOST DATA [--ways maui,dive,jacksboro] [--formats terrain,3dtiles] [--seconds S] [--limit PERCENT]

TERRACE is the binary, HOST a headless host program of cesium-native, called as `HOST URL flight|dive --cam LON,LAT,H,HEADING,PITCH --seconds
S --speed M/S --from H --to H --urls FILE`; DATA the folder with the SRTM files around Maui and ETOPO5. Prints the distinct tiles of each, those that both
requested, and the share in one alone; exit status 1 if it is above the limit (5 %).
"""
import argparse
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile
import urllib.request

SOURCE_DIR = pathlib.Path(__file__).resolve().parents[2]
# Dataset, scenario, camera, metres a second, seconds.
WAYS = {"maui": ("maui", "flight", (-156.45, 20.72, 4500, 60, -20), 400, 40),
        "dive": ("maui", "dive", (-156.25, 20.72, 0, 0, -89.9), 0, 40),
        "jacksboro": ("jacksboro", "flight", (-84.25, 36.2, 1500, 0, -20), 200, 40)}
HIGH, LOW = 1e7, 3500
TILE = re.compile(r"\.(terrain|glb)(\?|$)")


def places(scenario, camera, speed, seconds, steps=10):
    """The host's course, as lines of --path."""
    lon, lat, height, heading, pitch = camera
    for i in range(int(seconds * steps) + 1):
        k, turn = i / (seconds * steps), math.radians(heading)
        if scenario == "dive":
            yield i / steps, lon, lat, HIGH * (LOW / HIGH) ** k, heading, -89.9 + 69.9 * k ** 4
        else:
            way = speed * i / steps
            yield (i / steps, lon + math.degrees(way * math.sin(turn) / (6371000 * math.cos(math.radians(lat)))),
                   lat + math.degrees(way * math.cos(turn) / 6371000), height, heading, pitch)


def tiles_of(text):
    found = set()
    for line in text.splitlines():
        path = re.sub(r"^.*?(https?://[^/]+)?(/\S+)$", r"\2", line)
        if TILE.search(path):
            found.add(path.split("?")[0])
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("terrace", type=pathlib.Path)
    parser.add_argument("host", type=pathlib.Path)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("--ways", default=",".join(WAYS))
    parser.add_argument("--formats", default="terrain,3dtiles")
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--limit", type=float, default=5)
    arguments = parser.parse_args()
    terrace, data = arguments.terrace.resolve(), arguments.data.resolve()
    worst = 0
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        srtm = sorted(str(path) for path in data.glob("srtm1_N2*W15*.tif"))
        (folder / "terrace.json").write_text(json.dumps({"listen": "127.0.0.1:0", "cache_dir": str(folder / "cache"), "datasets": [
            {"name": "maui", "sources": [{"path": path, "nodata": 0} for path in srtm] + [str(data / "etopo5_global_10min.tif")]},
            {"name": "jacksboro", "sources": [str(SOURCE_DIR / "config/samples/jacksboro.tif")]}]}))
        server = subprocess.Popen([terrace, "serve", "--config", folder / "terrace.json", "--log-level", "error"], stdout=subprocess.PIPE, text=True)
        try:
            base = re.search(r"http://[\d.:]+", server.stdout.readline())[0]
            urllib.request.urlopen(base + "/maui/layer.json", timeout=600).read()
            for way in arguments.ways.split(","):
                dataset, scenario, camera, speed, seconds = WAYS[way]
                seconds = arguments.seconds or seconds
                (folder / "way.csv").write_text("".join(",".join(f"{v:.12g}" for v in place) + "\n" for place in places(scenario, camera, speed, seconds)))
                for form in arguments.formats.split(","):
                    document = "layer.json" if form == "terrain" else "tileset.json"
                    subprocess.run([terrace, "fly", f"{base}/{dataset}", "--path", folder / "way.csv", "--format", form, "--duration", str(seconds),
                                    "--json", "--urls", folder / "ours"], check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
                    text = subprocess.run([arguments.host.resolve(), f"{base}/{dataset}/{document}", scenario, "--cam", ",".join(map(str, camera)), "--seconds",
                                           str(seconds), "--speed", str(speed), "--from", str(HIGH), "--to", str(LOW), "--urls", folder / "theirs",
                                           "--check", "0", "--bounds", "-158,20,-155,22"],
                                          check=True, capture_output=True, text=True).stdout
                    ours, theirs = tiles_of((folder / "ours").read_text()), tiles_of((folder / "theirs").read_text())
                    both = ours & theirs
                    alone = 100 * (len(ours | theirs) - len(both)) / max(len(ours | theirs), 1)
                    worst = max(worst, alone)
                    holes = re.findall(r"with holes after first load (\d+)", text)
                    print(f"{way} {form}: terrace fly {len(ours)}, cesium-native {len(theirs)}, both {len(both)}, in one alone {alone:.1f} %; "
                          f"frames with holes of cesium-native {max(map(int, holes), default=-1)}", flush=True)
        finally:
            server.terminate()
            server.stdout.close()
            server.wait(60)
    return 1 if worst > arguments.limit or worst != worst else 0


if __name__ == "__main__":
    sys.exit(main())
