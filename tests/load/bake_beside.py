#!/usr/bin/env python3
"""Bakes beside another program, in turns: processor time and bytes a tile, and the error of both against the samples.

    tests/load/bake_beside.py --peer 'ctb-tile -o {folder} -f Mesh -N -s {last} -e {first} -c 2 -q {sources}' BINARY SOURCE...

SOURCE: rasters in degrees, which together are one dataset, without voids (`gdalwarp -dstnodata none -wo INIT_DEST=0`). The peer
writes {folder}/{z}/{x}/{y}.terrain, quantized-mesh with gzip or without; its {sources} is a VRT of several. terrace bakes at its
default error and at each --fraction, from level 0 on, because clients need the levels above; a round is one bake of each.

The error is that of each sample above sea level to the triangle over it, decoded from the files, in up to --tiles tiles of a level
that both have. Samples within two cells of the coarsest lattice (1/32 of a tile) of the raster's rim do not count. Needs numpy and gdal-bin.
"""
import argparse
import gzip
import json
import os
import pathlib
import random
import resource
import statistics
import struct
import subprocess
import sys
import tempfile
import time

import numpy

from bench_serve import processor


class Raster:
    """Samples of one raster as an array, rows from the north, and where its pixels are."""

    def __init__(self, path, folder):
        info = json.loads(subprocess.run(["gdalinfo", "-json", path], check=True, stdout=subprocess.PIPE).stdout)
        self.columns, self.rows = info["size"]
        self.west, self.step, _, self.north, _, minus = info["geoTransform"]
        assert abs(self.step + minus) < 1e-9, "pixels are squares in degrees"
        flat = pathlib.Path(folder) / "samples"
        subprocess.run(["gdal_translate", "-q", "-of", "ENVI", "-ot", "Float32", path, flat], check=True)
        self.heights = numpy.fromfile(flat, numpy.float32).reshape(self.rows, self.columns)

    def errors(self, vertices, triangles, west, south, span):
        """Of the samples in a tile of `span` degrees; `vertices`: u, v, height."""
        x = (west + vertices[:, 0] * span - self.west) / self.step - 0.5  # in samples
        y = (self.north - south - vertices[:, 1] * span) / self.step - 0.5
        rim = 2 * span / 32 / self.step
        seen = {}
        for a, b, c in triangles:
            left, right = max(min(x[a], x[b], x[c]), rim), min(max(x[a], x[b], x[c]), self.columns - 1 - rim)
            top, bottom = max(min(y[a], y[b], y[c]), rim), min(max(y[a], y[b], y[c]), self.rows - 1 - rim)
            columns, rows = numpy.arange(int(numpy.ceil(left)), int(right) + 1), numpy.arange(int(numpy.ceil(top)), int(bottom) + 1)
            area = (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a])
            if not columns.size or not rows.size or area == 0:
                continue
            p, q = numpy.meshgrid(columns, rows)
            of_b = ((p - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (q - y[a])) / area
            of_c = ((x[b] - x[a]) * (q - y[a]) - (p - x[a]) * (y[b] - y[a])) / area
            inside = (of_b >= 0) & (of_c >= 0) & (of_b + of_c <= 1)
            heights = vertices[a, 2] + of_b * (vertices[b, 2] - vertices[a, 2]) + of_c * (vertices[c, 2] - vertices[a, 2])
            samples = self.heights[rows[0]:rows[-1] + 1, columns[0]:columns[-1] + 1]
            inside &= samples > 0
            for row, column, error in zip(q[inside], p[inside], (heights - samples)[inside]):
                seen[row, column] = error  # once, if it lies on an edge
        return list(seen.values())


def decode(tile):
    """quantized-mesh 1.0: vertices as rows of u, v (0 to 1) and height in metres, and triangles."""
    low, high = struct.unpack_from("<2f", tile, 24)
    count, = struct.unpack_from("<I", tile, 88)
    coded = numpy.frombuffer(tile, "<u2", 3 * count, 92).astype(int).reshape(3, count)
    u, v, height = numpy.cumsum(coded >> 1 ^ -(coded & 1), axis=1) / 32767
    width, at = (4, (92 + 6 * count + 3) // 4 * 4) if count > 65536 else (2, 92 + 6 * count)
    triangles, = struct.unpack_from("<I", tile, at)
    codes = numpy.frombuffer(tile, f"<u{width}", 3 * triangles, at + 4).astype(int)
    new = codes == 0
    indices = numpy.cumsum(new) - new - codes
    return numpy.stack([u, v, low + height * (high - low)], axis=1), indices.reshape(-1, 3)


def seconds_of(command, **options):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun = time.monotonic()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **options)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime, after.ru_stime - before.ru_stime, time.monotonic() - begun


def tiles_in(folder, first):
    found = {}
    for path in pathlib.Path(folder).rglob("*.terrain"):
        z, x, y = (int(part) for part in (*path.parts[-3:-1], path.stem))
        if z >= first:
            found[z, x, y] = path
    return found


def read(path):
    data = path.read_bytes()
    return gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary", metavar="BINARY")
    parser.add_argument("sources", nargs="+", metavar="SOURCE")
    parser.add_argument("--peer", required=True, metavar="COMMAND")
    parser.add_argument("--levels", default="8-13", metavar="A-B")
    parser.add_argument("--fraction", action="append", default=[], help="also bake with this fraction of each level's error")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--tiles", type=int, default=60, help="of a level, whose errors are measured")
    arguments = parser.parse_args()
    first, last = arguments.levels.split("-")
    sources = [str(pathlib.Path(source).resolve()) for source in arguments.sources]
    with tempfile.TemporaryDirectory() as scratch:
        os.environ["XDG_CACHE_HOME"] = f"{scratch}/cache"
        peer_source = sources[0]
        if len(sources) > 1:
            peer_source = f"{scratch}/all.vrt"
            subprocess.run(["gdalbuildvrt", "-q", peer_source, *sources], check=True)
        bakes = {"peer": None, "default": [], **{f"fraction {f}": ["--fraction", f] for f in arguments.fraction}}
        times = {name: [] for name in bakes}
        for turn in range(arguments.rounds):
            for name, options in bakes.items():
                folder = f"{scratch}/{name}/{turn}"
                subprocess.run(["rm", "-rf", f"{scratch}/cache"], check=True)
                if options is None:
                    os.makedirs(folder)
                    command = arguments.peer.format(folder=f"'{folder}'", first=first, last=last, sources=f"'{peer_source}'")
                    times[name].append(seconds_of(command, shell=True))
                else:
                    os.makedirs(f"{scratch}/{name}", exist_ok=True)
                    command = [arguments.binary, "bake", "--out", folder, "--levels", f"0-{last}", "--threads", "2", *options, *sources]
                    times[name].append(seconds_of(command))
        print(f"{processor()}, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}; levels {arguments.levels}\n")
        print("| bake | tiles | user and system ms a tile: least / median | user ms a tile: least | wall ms a tile: least / median | peer / it |\n|---|---|---|---|---|---|")
        found, least = {}, 0.0  # least: the peer's, which is the first
        for name, options in bakes.items():
            folder, begin = f"{scratch}/{name}/0", 0
            if options is not None:  # the same tiles as files; their time does not count
                folder = f"{scratch}/{name}/folder"
                seconds_of([arguments.binary, "bake", "--form", "folder", "--out", folder, "--levels", f"0-{last}", *options, *sources])
            else:
                begin = int(first)
            found[name] = tiles_in(folder, begin)
            count = len(found[name])
            both, user, wall = ([1000 * part(t) / count for t in times[name]] for part in (lambda t: t[0] + t[1], lambda t: t[0], lambda t: t[2]))
            least = min(both) if options is None else least
            print(f"| {name} | {count:,} | {min(both):.2f} / {statistics.median(both):.2f} | {min(user):.2f} | {min(wall):.2f} / {statistics.median(wall):.2f} | {least / min(both):.2f} |", flush=True)
        if len(sources) > 1:
            return 0
        raster = Raster(sources[0], scratch)
        print("\n| level | " + " | ".join(f"{name}: RMS, largest error in m, kB" for name in bakes) + " |\n|---|" + "---|" * len(bakes))
        for level in range(int(first), int(last) + 1):
            keys = sorted(key for key in found["peer"] if key[0] == level and all(key in of for of in found.values()))
            random.Random(1).shuffle(keys)
            row = []
            for of in found.values():
                errors, size, span = [], 0, 180 / 2**level
                for z, x, y in keys[:arguments.tiles]:
                    size += of[z, x, y].stat().st_size
                    errors += raster.errors(*decode(read(of[z, x, y])), x * span - 180, y * span - 90, span)
                errors = numpy.array(errors or [0.0])
                row.append(f"{numpy.sqrt(numpy.mean(errors**2)):.1f}, {numpy.abs(errors).max():.0f}, {size / 1000:.0f}")
            print(f"| {level} | " + " | ".join(row) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
