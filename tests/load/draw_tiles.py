#!/usr/bin/env python3
"""Prints random tiles of a served dataset, one path a line, the same ones every time, for terrace_cold_tiles and once.py.

    tests/load/draw_tiles.py http://HOST:PORT/DATASET COUNT SHALLOWEST_LEVEL --box=WEST,SOUTH,EAST,NORTH
"""
import argparse
import json
import random
import sys
import urllib.parse
import urllib.request


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset")
    parser.add_argument("count", type=int)
    parser.add_argument("shallowest", type=int)
    parser.add_argument("--box", required=True)
    arguments = parser.parse_args()
    west, south, east, north = map(float, arguments.box.split(","))
    with urllib.request.urlopen(f"{arguments.dataset.rstrip('/')}/layer.json") as reply:
        layer = json.load(reply)
    name = urllib.parse.urlsplit(arguments.dataset).path.strip("/")
    random.seed(5)
    drawn = {}  # in order, without duplicates
    for _ in range(50 * arguments.count):
        level = random.randint(arguments.shallowest, layer["maxzoom"])
        side = 180 / 2**level
        x, y = int((random.uniform(west, east) + 180) / side), int((random.uniform(south, north) + 90) / side)
        if any(a["startX"] <= x <= a["endX"] and a["startY"] <= y <= a["endY"] for a in layer["available"][level]):
            drawn[f"/{name}/{level}/{x}/{y}.terrain"] = None
        if len(drawn) == arguments.count:
            break
    else:
        sys.exit(f"draw_tiles.py: only {len(drawn)} tiles found in this box")
    print("\n".join(drawn))


if __name__ == "__main__":
    main()
