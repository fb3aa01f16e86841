#!/usr/bin/env python3
"""Draws the pictures of docs/error-bound.md: meshes of one DEM at 20, 5 and 1 m, their errors at every sample, a compact
mesh beside a plain one, and the errors that the server states by level.

  tools/draw_bound.py build/release/server/cli/terrace --out docs/images

Needs gdal_translate; otherwise only Python. Prints the numbers of the page's tables.
"""
import argparse
import array
import json
import math
import pathlib
import re
import struct
import subprocess
import tempfile
import urllib.request
import zlib

ROOT = pathlib.Path(__file__).resolve().parent.parent
DEM = ROOT / "config/samples/jacksboro.tif"
ERRORS_M = (20, 5, 1)
WINDOW = (190, 180, 46)  # column, row and side of the part that is drawn, samples
SCALE = 7  # pixels per sample
GAP = 8
EDGE = (214, 74, 40)


def read_heights(folder):
    """(width, height, heights by row)"""
    raw = folder / "dem.bin"
    subprocess.run(["gdal_translate", "-q", "-of", "ENVI", "-ot", "Float32", str(DEM), str(raw)], check=True)
    header = raw.with_suffix(".hdr").read_text()
    width, height = (int(re.search(rf"{name}\s*=\s*(\d+)", header)[1]) for name in ("samples", "lines"))
    values = array.array("f", raw.read_bytes())
    return width, height, values


def make_mesh(binary, folder, error, *options):
    """(vertices as (column, row, metres), triangles as indices, statistics of the command)"""
    out = folder / "mesh.obj"
    done = subprocess.run([binary, "mesh", str(DEM), "--out", str(out), "--max-error", str(error), "--coordinates", "pixel", "--json", *options],
                          check=True, stdout=subprocess.PIPE, encoding="utf-8")
    vertices, triangles = [], []
    for line in out.read_text().splitlines():
        kind, *rest = line.split()
        if kind == "v":
            vertices.append(tuple(float(value) for value in rest[:3]))
        elif kind == "f":
            triangles.append(tuple(int(value.split("/")[0]) - 1 for value in rest))
    return vertices, triangles, json.loads(done.stdout)


def errors_of(vertices, triangles, width, height, heights):
    """Metres of the mesh above each sample, by row."""
    found = array.array("d", [math.nan]) * (width * height)
    for a, b, c in triangles:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = vertices[a], vertices[b], vertices[c]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0:
            continue
        for y in range(math.ceil(min(ay, by, cy)), math.floor(max(ay, by, cy)) + 1):
            for x in range(math.ceil(min(ax, bx, cx)), math.floor(max(ax, bx, cx)) + 1):
                v = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
                w = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
                if v >= -1e-9 and w >= -1e-9 and v + w <= 1 + 1e-9:
                    found[y * width + x] = az + v * (bz - az) + w * (cz - az) - heights[y * width + x]
    return found


def write_png(path, width, height, pixels):
    """`pixels`: rows of (r, g, b) of at most 256 colours."""
    palette = sorted(set(pixels))
    if len(palette) > 256:
        raise ValueError(f"{path}: {len(palette)} colours")
    index = {colour: i for i, colour in enumerate(palette)}
    rows = b"".join(b"\0" + bytes(index[colour] for colour in pixels[y * width:(y + 1) * width]) for y in range(height))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0))
                     + chunk(b"PLTE", bytes(value for colour in palette for value in colour))
                     + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


class Strip:
    """Pictures of the window side by side."""

    def __init__(self, count):
        self.side = WINDOW[2] * SCALE
        self.width, self.height = count * self.side + (count - 1) * GAP, self.side
        self.pixels = [(255, 255, 255)] * (self.width * self.height)

    def fill(self, place, colour_of):
        """`colour_of(column, row)`: of a sample."""
        for y in range(self.side):
            for x in range(self.side):
                self.pixels[y * self.width + place * (self.side + GAP) + x] = colour_of(WINDOW[0] + x // SCALE, WINDOW[1] + y // SCALE)

    def draw_edges(self, place, vertices, triangles):
        for a, b in sorted({tuple(sorted(edge)) for a, b, c in triangles for edge in ((a, b), (b, c), (c, a))}):
            (x0, y0), (x1, y1) = (((vertices[i][0] - WINDOW[0] + 0.5) * SCALE, (vertices[i][1] - WINDOW[1] + 0.5) * SCALE) for i in (a, b))
            steps = max(1, math.ceil(max(abs(x1 - x0), abs(y1 - y0))))
            for i in range(steps + 1):
                x, y = int(x0 + (x1 - x0) * i / steps), int(y0 + (y1 - y0) * i / steps)
                if 0 <= x < self.side and 0 <= y < self.side:
                    self.pixels[y * self.width + place * (self.side + GAP) + x] = EDGE

    def write(self, path):
        write_png(path, self.width, self.height, self.pixels)
        print(f"{path.name}: {path.stat().st_size} bytes")


def shade_of(width, heights):
    def colour(x, y):
        east = (heights[y * width + x + 1] - heights[y * width + x - 1]) / 150
        south = (heights[(y + 1) * width + x] - heights[(y - 1) * width + x]) / 180
        light = (0.7 - 0.6 * (-east - south)) / math.sqrt(1 + east * east + south * south)
        return (min(255, max(90, 16 * round((110 + 150 * light) / 16))),) * 3
    return colour


def colour_of_error(share):
    """-1 blue, 0 white, 1 red; black: beyond the bound."""
    if math.isnan(share) or abs(share) > 1 + 1e-6:
        return (0, 0, 0)
    rest = 1 - round(abs(share) * 20) / 20
    end = (178, 24, 43) if share > 0 else (33, 102, 172)
    return tuple(round(value + (255 - value) * rest) for value in end)


def served_errors(binary):
    """By level, of the tile in the middle: (level, its level error, Terrain-Max-Error, Terrain-Certified-Error)."""
    server = subprocess.Popen([binary, "serve", str(DEM), "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, encoding="utf-8")
    try:
        url = re.search(r"(http://[\d.:]+)", server.stdout.readline())[1]
        with urllib.request.urlopen(f"{url}/datasets") as reply:
            dataset = json.load(reply)["datasets"][0]
        west, south, east, north = dataset["bounds"]
        rows = []
        for level in range(6, dataset["max_level"] + 1):
            side = 180 / 2 ** level
            x, y = int(((west + east) / 2 + 180) / side), int(((south + north) / 2 + 90) / side)
            with urllib.request.urlopen(f"{url}/{dataset['name']}/{level}/{x}/{y}.terrain") as reply:
                rows.append((level, 77067 / 2 ** level / 2, *(float(reply.headers[f"Terrain-{name}-Error"].split()[0]) for name in ("Max", "Certified"))))
        return rows
    finally:
        server.terminate()
        server.wait()


def draw_levels(path, rows):
    width, height, left, bottom = 720, 300, 60, 40
    low, high = -1, 3  # powers of ten

    def up(value):
        share = (math.log10(max(value, 10 ** low)) - low) / (high - low)
        return height - bottom - share * (height - bottom - 20)
    text = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12">',
            f'<rect width="{width}" height="{height}" fill="#fff"/>']
    for power in range(low, high + 1):
        at = up(10 ** power)
        text.append(f'<path d="M{left} {at:.1f}H{width - 10}" stroke="#ddd"/><text x="{left - 6}" y="{at + 4:.1f}" text-anchor="end">{10 ** power:g} m</text>')
    step = (width - left - 20) / len(rows)
    names = (("default error of the level", "#c8ccd2"), ("Terrain-Max-Error", "#e0a23c"), ("Terrain-Certified-Error", "#3f78b5"))
    for i, (level, *values) in enumerate(rows):
        for k, value in enumerate(values):
            x = left + 8 + i * step + k * (step - 12) / 3
            text.append(f'<rect x="{x:.1f}" y="{up(value):.1f}" width="{(step - 12) / 3 - 1:.1f}" height="{height - bottom - up(value):.1f}" fill="{names[k][1]}"/>')
        text.append(f'<text x="{left + (i + 0.5) * step:.1f}" y="{height - bottom + 16}" text-anchor="middle">level {level}</text>')
    for k, (name, colour) in enumerate(names):
        text.append(f'<rect x="{left + 10 + 190 * k}" y="{height - 16}" width="10" height="10" fill="{colour}"/><text x="{left + 25 + 190 * k}" y="{height - 7}">{name}</text>')
    path.write_text("\n".join(text) + "\n</svg>\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "docs/images")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        width, height, heights = read_heights(folder)
        shade = shade_of(width, heights)
        meshes, errors, compact = Strip(len(ERRORS_M)), Strip(len(ERRORS_M)), Strip(2)

        def largest(vertices, triangles):
            found = errors_of(vertices, triangles, width, height, heights)
            return found, max(abs(value) for value in found)
        for place, error in enumerate(ERRORS_M):
            vertices, triangles, _ = make_mesh(arguments.binary, folder, error)
            found, worst = largest(vertices, triangles)
            within_half = sum(abs(value) <= error / 2 for value in found) / len(found)
            print(f"{error} m: {len(vertices)} vertices of {width * height} samples, largest error {worst:.3f} m, {100 * within_half:.1f} % within half")
            meshes.fill(place, shade)
            meshes.draw_edges(place, vertices, triangles)
            errors.fill(place, lambda x, y, of=found, bound=error: colour_of_error(of[y * width + x] / bound))
        for place, options in enumerate(((), ("--compact",))):
            vertices, triangles, _ = make_mesh(arguments.binary, folder, 5, *options)
            print(f"5 m {' '.join(options) or 'plain'}: {len(vertices)} vertices, largest error {largest(vertices, triangles)[1]:.3f} m")
            compact.fill(place, shade)
            compact.draw_edges(place, vertices, triangles)
        meshes.write(arguments.out / "bound-meshes.png")
        errors.write(arguments.out / "bound-errors.png")
        compact.write(arguments.out / "bound-compact.png")
    rows = served_errors(arguments.binary)
    for level, *values in rows:
        print(f"level {level}: default {values[0]:.1f} m, maximum {values[1]:g} m, certified {values[2]:g} m")
    draw_levels(arguments.out / "bound-levels.svg", rows)


if __name__ == "__main__":
    main()
