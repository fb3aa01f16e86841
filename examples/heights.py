#!/usr/bin/env python3
"""Requests heights from a terrace server, then decodes the quantized-mesh tile at each point and interpolates its height there.

    examples/heights.py [--server URL] [--dataset NAME] [LAT,LON ...]
"""
import argparse
import json
import struct
import sys
import urllib.error
import urllib.request
from itertools import accumulate


def fetch(url):
    with urllib.request.urlopen(url, timeout=60) as reply:
        return reply.read(), reply.headers


def decode(tile):
    """Vertices as (u, v, height), u and v from 0 in the south-west to 1, and triangles as three indices each."""
    low, high = struct.unpack_from("<2f", tile, 24)
    count, = struct.unpack_from("<I", tile, 88)
    codes = struct.unpack_from(f"<{3 * count}H", tile, 92)

    def numbers(first):  # zigzag-coded differences from the number before
        return (value / 32767 for value in accumulate((code >> 1) ^ -(code & 1) for code in codes[first:first + count]))

    vertices = [(u, v, low + h * (high - low)) for u, v, h in zip(numbers(0), numbers(count), numbers(2 * count))]
    at, letter = 92 + 6 * count, "H"
    if count > 65536:
        at, letter = (at + 3) & ~3, "I"
    triangles, = struct.unpack_from("<I", tile, at)
    indices, unused = [], 0  # a code is the distance back from the first vertex that no triangle has used yet
    for code in struct.unpack_from(f"<{3 * triangles}{letter}", tile, at + 4):
        indices.append(unused - code)
        unused += code == 0
    return vertices, list(zip(indices[::3], indices[1::3], indices[2::3]))


def height_at(vertices, triangles, u, v):
    """The height in the triangle that contains (u, v), by its barycentric coordinates."""
    for triangle in triangles:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (vertices[index] for index in triangle)
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        b = ((u - ax) * (cy - ay) - (cx - ax) * (v - ay)) / area
        c = ((bx - ax) * (v - ay) - (u - ax) * (by - ay)) / area
        if min(b, c, 1 - b - c) >= -1e-12:
            return az + b * (bz - az) + c * (cz - az)
    raise ValueError("no triangle holds the place")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--server", default="http://127.0.0.1:8080")
    parser.add_argument("--dataset", help="the first that the server has")
    parser.add_argument("places", nargs="*", metavar="LAT,LON", help="the middle of the dataset; -- precedes a place that begins with a minus")
    arguments = parser.parse_args()

    datasets = {dataset["name"]: dataset for dataset in json.loads(fetch(f"{arguments.server}/datasets")[0])["datasets"]}
    if not datasets:
        sys.exit(f"{arguments.server} shows no dataset: all are being prepared, or need a token")
    name = arguments.dataset or next(iter(datasets))
    if name not in datasets:
        sys.exit(f"{arguments.server} has no dataset {name}; it has {', '.join(datasets)}")
    west, south, east, north = datasets[name]["bounds"]
    middle = (west + east + 360 * (west > east)) / 2  # across the antimeridian west is above east
    places = [place.replace(" ", "") for place in arguments.places] or [f"{(south + north) / 2:.6f},{middle - 360 * (middle > 180):.6f}"]

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
        u = (longitude + 180) / span % (2 * 2**level) - column  # 180 E is 180 W, in column 0
        drawn = height_at(vertices, triangles, u, (latitude + 90) / span - row)
        print(f"{latitude}, {longitude}: {result['elevation']} m in {name}; tile {result['tile']} with {len(vertices)} vertices and "
              f"{len(triangles)} triangles has {drawn:.2f} m, and is at most {headers['Terrain-Certified-Error']} m off anywhere")


if __name__ == "__main__":
    try:
        main()
    except urllib.error.HTTPError as error:
        sys.exit(f"{error.url}: {error.code} {error.read().decode()}")
    except urllib.error.URLError as error:
        sys.exit(f"no answer from the server: {error.reason}; is terrace serve running?")
