#!/usr/bin/env python3
"""Draws a coloured mesh as Gouraud triangles and prints its distance from the image of which it was made.

  terrace mesh photo.ppm --image --out photo.ply --points 4000 --coordinates pixel
  tools/draw_mesh.py photo.ppm drawn.ppm --mesh photo.ply           the triangles
  tools/draw_mesh.py photo.ppm drawn.ppm --mesh photo.ply --edges   their edges
  tools/draw_mesh.py photo.ppm drawn.ppm --uniform 64               64 x 64 samples, evenly spread, for comparison

Images are binary PPM (P6, 255 levels); gdal_translate -of PNM makes them, and gdal_translate -of PNG converts them. Needs
only Python.
"""
import argparse
import math
import pathlib
import re
import struct


def read_ppm(path):
    data = pathlib.Path(path).read_bytes()
    head = re.match(rb"P6\s(?:#.*\n)*(\d+)\s+(\d+)\s+255\s", data)
    if not head:
        raise SystemExit(f"{path}: not a binary PPM with 255 levels; convert it with gdal_translate -of PNM")
    return int(head[1]), int(head[2]), data[head.end():]


def read_ply(path):
    """Reads the PLY of terrace: positions as doubles with three bytes of colour, then triangles."""
    data = pathlib.Path(path).read_bytes()
    header, body = data.split(b"end_header\n", 1)
    if b"property uchar red" not in header:
        raise SystemExit(f"{path}: has no vertex colours")
    counts = {kind: int(count) for kind, count in re.findall(rb"element (\w+) (\d+)", header)}
    split = 27 * counts[b"vertex"]
    vertices = [(round(x), round(y), color) for x, y, _, *color in struct.iter_unpack("<3d3B", body[:split])]
    return vertices, [t[1:] for t in struct.iter_unpack("<B3i", body[split:])]


def uniform(width, height, pixels, n):
    def position(i, length):
        return round(i * (length - 1) / (n - 1))

    vertices = []
    for j in range(n):
        for i in range(n):
            x, y = position(i, width), position(j, height)
            at = 3 * (y * width + x)
            vertices.append((x, y, list(pixels[at:at + 3])))
    triangles = []
    for j in range(n - 1):
        for i in range(n - 1):
            a = j * n + i
            triangles += [(a, a + 1, a + n + 1), (a, a + n + 1, a + n)]
    return vertices, triangles


def fill(out, width, corners):
    (ax, ay, a), (bx, by, b), (cx, cy, c) = corners
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    for y in range(min(ay, by, cy), max(ay, by, cy) + 1):
        for x in range(min(ax, bx, cx), max(ax, bx, cx) + 1):
            of_b = (x - ax) * (cy - ay) - (y - ay) * (cx - ax)
            of_c = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            if min(of_b * area, of_c * area, (area - of_b - of_c) * area) < 0:
                continue
            at = 3 * (y * width + x)
            for i in range(3):
                out[at + i] = round(a[i] + (of_b * (b[i] - a[i]) + of_c * (c[i] - a[i])) / area)


def line(out, width, start, end):
    steps = max(abs(end[0] - start[0]), abs(end[1] - start[1]), 1)
    for k in range(steps + 1):
        x = round(start[0] + (end[0] - start[0]) * k / steps)
        y = round(start[1] + (end[1] - start[1]) * k / steps)
        out[3 * (y * width + x):3 * (y * width + x) + 3] = b"\x20\x20\x20"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("image", help="the original")
    parser.add_argument("out", help="the PPM to write")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--mesh", metavar="PLY", help="a mesh of the original in pixel coordinates")
    source.add_argument("--uniform", metavar="N", type=int, help="N x N samples of the original instead")
    parser.add_argument("--against", metavar="PPM", help="measure against this image instead of the original")
    parser.add_argument("--edges", action="store_true", help="edges on white instead of filled triangles")
    arguments = parser.parse_args()

    width, height, pixels = read_ppm(arguments.image)
    vertices, triangles = (read_ply(arguments.mesh) if arguments.mesh
                           else uniform(width, height, pixels, arguments.uniform))
    out = bytearray(b"\xff" * len(pixels))
    for triangle in triangles:
        corners = [vertices[i] for i in triangle]
        if arguments.edges:
            for i in range(3):
                line(out, width, corners[i - 1], corners[i])
        else:
            fill(out, width, corners)
    pathlib.Path(arguments.out).write_bytes(b"P6\n%d %d\n255\n" % (width, height) + bytes(out))
    if not arguments.edges:
        truth = read_ppm(arguments.against)[2] if arguments.against else pixels
        squares = sum((p - q) ** 2 for p, q in zip(out, truth))
        print(f"{len(vertices)} vertices, RMS {math.sqrt(squares / len(pixels)) / 255:.4f} of the range of colours")


if __name__ == "__main__":
    main()
