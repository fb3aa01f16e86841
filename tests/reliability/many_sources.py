#!/usr/bin/env python3
"""Writes a folder of elevation rasters like those of a global product: one a degree, each sparse.

    tests/reliability/many_sources.py FOLDER [--count N] [--cells FILE] [--pixels N]

Cells are named by their south-western corners (N46E008). Without a file of cells they go around the Earth from 85 degrees south on.
Pixels are longer towards the poles, as in Copernicus, so not all cells are on one grid.
"""
import argparse
import math
import pathlib
import struct
import zlib

TILE = 128  # samples along a side of a storage block
VOID = -32767


def cells(count):
    for latitude in range(-85, 85):
        for longitude in range(-180, 180):
            if count == 0:
                return
            count -= 1
            yield latitude, longitude


def name(latitude, longitude):
    return f"{'S' if latitude < 0 else 'N'}{abs(latitude):02}{'W' if longitude < 0 else 'E'}{abs(longitude):03}"


def corner(text):
    return (-1 if text[0] == "S" else 1) * int(text[1:3]), (-1 if text[3] == "W" else 1) * int(text[4:7])


def columns(latitude, pixels):
    """Columns of a cell, by the latitude of its edge nearer to the equator."""
    edge = latitude if latitude >= 0 else -latitude - 1
    shares = {50: 1, 60: 2 / 3, 70: 1 / 2, 80: 1 / 3, 85: 1 / 5, 90: 1 / 10}
    return round(pixels * next(share for end, share in shares.items() if edge < end))


def block():
    """Compressed heights of one storage block, the same in every raster."""
    rows = (struct.pack(f"<{TILE}h", *(round(900 + 300 * math.sin(x / 17) * math.cos(y / 23) + (x * 7 + y * 13) % 5) for x in range(TILE)))
            for y in range(TILE))
    return zlib.compress(b"".join(rows))


def raster(latitude, longitude, pixels, heights):
    """A GeoTIFF that stores one block, at its north-western corner."""
    width, height = columns(latitude, pixels), pixels
    across, down = math.ceil(width / TILE), math.ceil(height / TILE)
    offsets, counts = [0] * (across * down), [0] * (across * down)
    keys = (1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326)
    x, y = 1 / width, 1 / height
    tags = [  # number, type, values; values longer than four bytes are stored elsewhere, with their offset here
        (256, "H", (width,)), (257, "H", (height,)), (258, "H", (16,)), (259, "H", (8,)), (262, "H", (1,)), (277, "H", (1,)),
        (322, "H", (TILE,)), (323, "H", (TILE,)), (324, "I", offsets), (325, "I", counts), (339, "H", (2,)),
        (33550, "d", (x, y, 0)), (33922, "d", (0, 0, 0, longitude, latitude + 1, 0)), (34735, "H", keys),
        (42113, "s", f"{VOID}\0".encode()),
    ]
    types = {"H": 3, "I": 4, "d": 12, "s": 2}
    where = 8 + 2 + 12 * len(tags) + 4
    sizes = [len(values) * struct.calcsize("<" + kind if kind != "s" else "<B") for _, kind, values in tags]
    places = []
    for size in sizes:
        places.append(where)
        where += size + size % 2 if size > 4 else 0
    offsets[0], counts[0] = where, len(heights)
    directory, data = struct.pack("<H", len(tags)), b""
    for (number, kind, values), size, place in zip(tags, sizes, places):
        packed = values if kind == "s" else struct.pack(f"<{len(values)}{kind}", *values)
        directory += struct.pack("<HHI", number, types[kind], len(values))
        directory += struct.pack("<I", place) if size > 4 else packed.ljust(4, b"\0")
        data += packed + b"\0" * (size % 2) if size > 4 else b""
    return b"II*\0" + struct.pack("<I", 8) + directory + struct.pack("<I", 0) + data + heights


def write(folder, wanted, pixels=3600):
    """Returns the number of rasters."""
    heights = block()
    folder.mkdir(parents=True, exist_ok=True)
    count = 0
    for latitude, longitude in wanted:
        (folder / f"{name(latitude, longitude)}.tif").write_bytes(raster(latitude, longitude, pixels, heights))
        count += 1
    return count


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--count", type=int, default=24_649)
    parser.add_argument("--cells", type=pathlib.Path)
    parser.add_argument("--pixels", type=int, default=3600, help="rows of a raster")
    arguments = parser.parse_args()
    wanted = [corner(line) for line in arguments.cells.read_text().split()] if arguments.cells else cells(arguments.count)
    print(f"{write(arguments.folder, wanted, arguments.pixels)} rasters")


if __name__ == "__main__":
    main()
