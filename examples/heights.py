#!/usr/bin/env python3
"""Asks a terrace server for heights, then decodes the quantized-mesh tile at each place and reads the height off it.

    examples/heights.py [--server URL] [--dataset NAME] [LAT,LON ...]      needs numpy
"""
import argparse
import json
import sys
import urllib.error
import urllib.request

import numpy as np


def fetch(url):
    with urllib.request.urlopen(url, timeout=60) as reply:
        return reply.read(), reply.headers


def decode(tile):
    """Vertices as u, v and height, and triangles as rows of three indices. u and v are 0 to 1 from west and from south."""
    low, high = np.frombuffer(tile, "<f4", 2, 24)
    vertices = int(np.frombuffer(tile, "<u4", 1, 88)[0])
    deltas = np.frombuffer(tile, "<u2", 3 * vertices, 92).reshape(3, vertices).astype(np.int64)
    u, v, height = np.cumsum((deltas >> 1) ^ -(deltas & 1), axis=1) / 32767  # zigzag, each from the one before
    at = 92 + 6 * vertices
    index = "<u2"
    if vertices > 65536:
        index, at = "<u4", (at + 3) & ~3
    triangles = int(np.frombuffer(tile, "<u4", 1, at)[0])
    codes = np.frombuffer(tile, index, 3 * triangles, at + 4).astype(np.int64)
    is_new = codes == 0  # a code counts back from the next vertex that no triangle has had yet
    indices = np.cumsum(is_new) - is_new - codes
    return np.stack([u, v, low + height * (high - low)]), indices.reshape(-1, 3)


def height_at(vertices, triangles, u, v):
    """Of the triangle that holds the place, by its barycentric coordinates."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (vertices[:, corner] for corner in triangles.T)
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    b = ((u - ax) * (cy - ay) - (cx - ax) * (v - ay)) / area
    c = ((bx - ax) * (v - ay) - (u - ax) * (by - ay)) / area
    inside = np.argmax(np.min([1 - b - c, b, c], axis=0))
    return (az + b * (bz - az) + c * (cz - az))[inside]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--server", default="http://127.0.0.1:8080")
    parser.add_argument("--dataset", help="the first that the server has")
    parser.add_argument("places", nargs="*", metavar="LAT,LON", help="the middle of the dataset")
    arguments = parser.parse_args()

    datasets = {dataset["name"]: dataset for dataset in json.loads(fetch(f"{arguments.server}/datasets")[0])["datasets"]}
    name = arguments.dataset or next(iter(datasets))
    if name not in datasets:
        sys.exit(f"{arguments.server} has no dataset {name}; it has {', '.join(datasets)}")
    west, south, east, north = datasets[name]["bounds"]
    places = arguments.places or [f"{(south + north) / 2},{(west + east + 360 * (west > east)) / 2}"]

    reply, _ = fetch(f"{arguments.server}/{name}/heights?certify=deepest&locations={'|'.join(places)}")
    for result in json.loads(reply)["results"]:
        latitude, longitude = result["location"]["lat"], result["location"]["lng"]
        if result["elevation"] is None:
            print(f"{latitude}, {longitude}: outside {name}")
            continue
        level, column, row = map(int, result["tile"].split("/"))
        tile, headers = fetch(f"{arguments.server}/{name}/{result['tile']}.terrain")
        vertices, triangles = decode(tile)
        span = 180 / 2**level  # degrees; columns count from 180 W, rows from the South Pole
        drawn = height_at(vertices, triangles, (longitude + 180) / span - column, (latitude + 90) / span - row)
        print(f"{latitude}, {longitude}: {result['elevation']} m in {name}; tile {result['tile']} with {vertices.shape[1]} vertices and "
              f"{len(triangles)} triangles has {drawn:.2f} m, and is at most {headers['Terrain-Certified-Error']} m off anywhere")


if __name__ == "__main__":
    try:
        main()
    except urllib.error.HTTPError as error:
        sys.exit(f"{error.url}: {error.code} {error.read().decode()}")
    except urllib.error.URLError as error:
        sys.exit(f"no answer from the server: {error.reason}; is terrace serve running?")
