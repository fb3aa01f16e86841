#!/usr/bin/env python3
"""Counts the instructions of a cold tile with valgrind, for one or more binaries. The count does not depend on other load.

    tests/load/cold_instructions.py [--warm] DEM SUFFIX TILES BINARY [BINARY...]     SUFFIX: .terrain or .glb

--warm: of a tile whose refinement is in memory, because it was requested at an eighth of its default error before.

Each binary serves the DEM with one worker and no caches, and gets requests for the same random tiles of its six deepest levels,
with a fixed seed. Prints instructions a tile and the ratio to the first binary. A BINARY may have options of `terrace serve` after
its name: "build/release/server/cli/terrace --edits runway.geojson".
"""
import http.client
import json
import pathlib
import random
import re
import shlex
import socket
import subprocess
import sys
import tempfile
import time

WARM_UP = 3  # tiles before the count begins


def start(binary, dem, profile, is_warm):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    program, *options = shlex.split(str(binary))
    process = subprocess.Popen(
        ["valgrind", "--tool=callgrind", f"--callgrind-out-file={profile}", "--instr-atstart=no", program, "serve", str(dem), *options,
         "--listen", f"127.0.0.1:{port}", "--io-threads", "1", "--worker-threads", "1", "--cache-bytes", "0",
         *([] if is_warm else ["--refinement-cache-bytes", "0"]), "--cache-dir", f"{profile}.cache",
         "--request-deadline-s", "3600", "--log-level", "warn", "--access-log", "off"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return process, port


def ask(port, url):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=600)
    connection.request("GET", url)
    reply = connection.getresponse()
    body = reply.read()
    if reply.status != 200:
        raise RuntimeError(f"{url}: {reply.status}")
    return body


def layer_of(process, port, name):
    while process.poll() is None:
        try:
            return json.loads(ask(port, f"/{name}/layer.json"))
        except (OSError, RuntimeError):
            time.sleep(0.2)
    raise SystemExit("cold_instructions.py: the server does not start; run it by hand, or install valgrind")


def draw(layer, count):
    random.seed(3)
    levels = list(enumerate(layer["available"]))[-6:]
    tiles = sorted({(level, random.randint(r["startX"], r["endX"]), random.randint(r["startY"], r["endY"]))
                    for level, ranges in levels for r in ranges for _ in range(6)})
    random.shuffle(tiles)
    return tiles[:count]


def control(process, *arguments):
    subprocess.run(["callgrind_control", *arguments, str(process.pid)], check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL)


def instructions(binary, dem, suffix, count, tiles, is_warm):
    with tempfile.TemporaryDirectory() as folder:
        process, port = start(binary, dem, f"{folder}/profile", is_warm)
        try:
            layer = layer_of(process, port, dem.stem)
            tiles = tiles or draw(layer, count)
            urls = [f"/{dem.stem}/{z}/{x}/{y}{suffix}" for z, x, y in tiles]
            for z, x, y in tiles if is_warm else []:
                ask(port, f"/{dem.stem}/{z}/{x}/{y}.terrain?fraction=0.125")
            for url in urls[:WARM_UP]:
                ask(port, url)
            control(process, "-i", "on")
            for url in urls[WARM_UP:]:
                ask(port, url)
            control(process, "-i", "off")
            control(process, "-d")
        finally:
            process.terminate()
            process.wait()
        totals = [int(found[1]) for file in pathlib.Path(folder).iterdir()
                  if file.is_file() and (found := re.search(r"^totals: (\d+)", file.read_text(errors="replace"), re.M))]
    return max(totals) / (len(tiles) - WARM_UP), tiles


def main():
    is_warm = sys.argv[1:2] == ["--warm"]
    arguments = sys.argv[2:] if is_warm else sys.argv[1:]
    if len(arguments) < 4:
        raise SystemExit(__doc__)
    dem, suffix, count = pathlib.Path(arguments[0]), arguments[1], int(arguments[2])
    first, tiles = None, None
    for binary in arguments[3:]:
        cost, tiles = instructions(binary, dem, suffix, count, tiles, is_warm)
        first = first or cost
        print(f"{binary}: {cost:,.0f} instructions a tile, {cost / first:.3f} of the first, {len(tiles) - WARM_UP} tiles", flush=True)


if __name__ == "__main__":
    main()
