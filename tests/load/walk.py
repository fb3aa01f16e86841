#!/usr/bin/env python3
"""Prints the tile requests of many viewers of one dataset, one path a line.

    tests/load/walk.py URL/DATASET [--views N] [--places N] [--seed S] [--query K=V]

A viewer looks at a place and refines from the root to the deepest level. It requests all four children of each tile on the
way, as CesiumJS and cesium-native do. Places are in the dataset's deepest tiles; the k-th most popular place has
a weight of 1 / k (Zipf), so some tiles are requested often and most hardly ever. The same seed gives the same
requests.

Viewers that fly are better had from the client itself: `terrace fly URL --circle ... --urls FILE` writes the same kind of list.
"""
import argparse
import bisect
import json
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


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", help="http://HOST:PORT/DATASET")
    parser.add_argument("--views", type=int, default=2000)
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

    for _ in range(arguments.views):
        for tile in view(layer, *some_place()):
            print(layer.path(*tile))


if __name__ == "__main__":
    try:
        main()
    except OSError as error:
        sys.exit(f"walk.py: {error}")
