#!/usr/bin/env python3
"""Prints the tile requests of many viewers of one dataset, one path a line.

    tests/load/walk.py URL/DATASET [--flight] [--views N] [--places N] [--seed S] [--query K=V]

A viewer looks at a place and refines from the root to the deepest level. It requests all four children of each tile on the
way, as CesiumJS and cesium-native do. Places are in the dataset's deepest tiles; the k-th most popular place has
a weight of 1 / k (Zipf), so some tiles are requested often and most hardly ever. The same seed gives the same
requests.

With --flight a viewer flies from one place to another, from high above down to the ground and up again. In every frame
it requests the missing tiles: those above the horizon whose error would be more than two pixels of the screen, children
after parents, as CesiumJS selects them. It keeps all tiles that it has.
"""
import argparse
import bisect
import json
import math
import random
import sys
import urllib.parse
import urllib.request

EXTENSIONS = "extensions=octvertexnormals"


class Layer:
    """The tiles that a layer.json lists, and their paths."""

    def __init__(self, base, query):
        with urllib.request.urlopen(base + "/layer.json", timeout=30) as reply:
            layer = json.load(reply)
        self.available = layer["available"]
        template = urllib.parse.urlsplit(urllib.parse.urljoin(base + "/", layer["tiles"][0]))
        parameters = "&".join(part for part in (template.query, query, EXTENSIONS) if part)
        self.template = urllib.parse.unquote(template.path).replace("{version}", layer.get("version", "")) + "?" + parameters

    def has(self, z, x, y):
        return z < len(self.available) and any(
            r["startX"] <= x <= r["endX"] and r["startY"] <= y <= r["endY"] for r in self.available[z])

    def path(self, z, x, y):
        return self.template.replace("{z}", str(z)).replace("{x}", str(x)).replace("{y}", str(y))

    def random_deepest(self, rng):
        """(z, x, y) of a random tile of the deepest level, with equal probability."""
        level = len(self.available) - 1
        ranges = self.available[level]
        sizes = [(r["endX"] - r["startX"] + 1) * (r["endY"] - r["startY"] + 1) for r in ranges]
        block = rng.choices(ranges, sizes)[0]
        return level, rng.randint(block["startX"], block["endX"]), rng.randint(block["startY"], block["endY"])


def view(layer, z, x, y):
    """The tiles on the way from the roots to (z, x, y), each level's four siblings together."""
    tiles = [(0, 0, 0), (0, 1, 0)]
    for level in range(1, z + 1):
        parent_x, parent_y = x >> (z - level + 1), y >> (z - level + 1)
        tiles += [(level, 2 * parent_x + dx, 2 * parent_y + dy) for dy in (0, 1) for dx in (0, 1)]
    return [tile for tile in tiles if layer.has(*tile)]


EARTH_M = 6_371_000
LEVEL_ZERO_ERROR_M = 77_067.34  # the error that clients assume for a root
PIXELS_FOR_ERROR = 1080 / (2 * math.tan(math.radians(60) / 2))  # of one metre at a distance of one metre, on a screen of 1080 lines
MOST_PIXELS = 2


def ground_distance(camera, z, x, y):
    """Metres along the ground to the nearest corner or side of the tile; 0 inside."""
    lon, lat, _ = camera
    width = 180 / 2 ** z
    west, south = -180 + x * width, -90 + y * width
    east_of = (lon - west) % 360  # 0 .. 360
    dlon = 0 if east_of <= width else min(east_of - width, 360 - east_of)
    dlat = max(south - lat, lat - south - width, 0)
    nearest_lat = min(max(lat, south), south + width)
    return EARTH_M * math.radians(math.hypot(dlat, dlon * math.cos(math.radians(nearest_lat))))


def seen(layer, camera):
    """The tiles that one frame needs, parents before children."""
    horizon = EARTH_M * math.acos(EARTH_M / (EARTH_M + camera[2]))
    tiles = [(0, 0, 0), (0, 1, 0)]
    for tile in tiles:
        z, x, y = tile
        ground = ground_distance(camera, *tile)
        if LEVEL_ZERO_ERROR_M / 2 ** z * PIXELS_FOR_ERROR / math.hypot(ground, camera[2]) <= MOST_PIXELS:
            continue
        children = [(z + 1, 2 * x + dx, 2 * y + dy) for dy in (0, 1) for dx in (0, 1)]
        tiles += [child for child in children if layer.has(*child) and ground_distance(camera, *child) <= horizon]
    return [tile for tile in tiles if layer.has(*tile)]


def flight(layer, start, end, frames=40, top_m=400_000, bottom_m=1_500):
    """The tiles that a moving camera requests, each once."""
    have = set()

    def middle(place):
        z, x, y = place
        return -180 + (x + 0.5) * 180 / 2 ** z, -90 + (y + 0.5) * 180 / 2 ** z

    (lon, lat), (to_lon, to_lat) = middle(start), middle(end)
    for frame in range(frames):
        way = frame / (frames - 1)
        descent = min(1, 2.5 * min(way, 1 - way))  # down, along, up
        camera = (lon + (to_lon - lon) * way, lat + (to_lat - lat) * way, top_m * (bottom_m / top_m) ** descent)
        for tile in seen(layer, camera):
            if tile not in have:
                have.add(tile)
                yield tile


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", help="http://HOST:PORT/DATASET")
    parser.add_argument("--flight", action="store_true")
    parser.add_argument("--views", type=int, help="default: 2000, or 50 flights")
    parser.add_argument("--places", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--query", default="", help="appended to every tile: error=2")
    arguments = parser.parse_args()

    layer = Layer(arguments.dataset.rstrip("/"), arguments.query)
    rng = random.Random(arguments.seed)
    places = [layer.random_deepest(rng) for _ in range(arguments.places)]
    reach, weights = 0.0, []
    for rank in range(1, len(places) + 1):
        reach += 1 / rank
        weights.append(reach)

    def some_place():
        return places[min(bisect.bisect(weights, rng.random() * reach), len(places) - 1)]

    for _ in range(arguments.views or (50 if arguments.flight else 2000)):
        for tile in flight(layer, some_place(), some_place()) if arguments.flight else view(layer, *some_place()):
            print(layer.path(*tile))


if __name__ == "__main__":
    try:
        main()
    except OSError as error:
        sys.exit(f"walk.py: {error}")
