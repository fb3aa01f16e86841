#!/usr/bin/env python3
"""Decodes a quantized-mesh tile and draws it: plot_tile.py [http://127.0.0.1:8080/jacksboro [OUT.png [LEVEL [ERROR]]]]

Needs numpy and nothing else. plot_tile.ipynb has the same code as a Jupyter notebook; `tools/write_notebook.py` writes it from this file.
"""
# %% [markdown]
# # A terrain tile in numpy
#
# Requests one quantized-mesh tile of a terrace server, decodes it with numpy, compares its vertices with `/heights`, and draws its triangles.
# Start a server first: `make run`.

# %%
import json
import os
import pathlib
import struct
import sys
import urllib.request
import zlib

import numpy

is_script = sys.argv[0].endswith("plot_tile.py")
arguments = sys.argv[1:] if is_script else []
dataset, out, level, error = arguments + [os.environ.get("TERRACE_DATASET", "http://127.0.0.1:8080/jacksboro"), "tile.png", None, 20][len(arguments):]


def fetch(url, body=None, kind="application/json"):
    request = urllib.request.Request(url, body, {"Content-Type": kind} if body else {})
    with urllib.request.urlopen(request, timeout=60) as reply:
        return reply.read(), reply.headers


# %% [markdown]
# ## Which tile
#
# Tiles are EPSG:4326: two at level 0, rows from the south. A tile of level z is 180 / 2^z degrees wide. This is the one in the middle of the finest data.

# %%
server, name = dataset.rsplit("/", 1)
about = next((entry for entry in json.loads(fetch(f"{server}/datasets")[0])["datasets"] if entry["name"] == name), None)
if not about:
    sys.exit(f"{server} shows no dataset {name}: it is being prepared, needs a token, or has another name")
west, south, east, north = about.get("finest_bounds", about["bounds"])
level = int(level or min(10, about["max_level"]))
span = 180 / 2**level
east += 360 * (west > east)  # across the antimeridian west is above east, and columns begin again at 0
column, row = int(((west + east) / 2 + 180) / span) % (2 * 2**level), int(((south + north) / 2 + 90) / span)
tile, headers = fetch(f"{dataset}/{level}/{column}/{row}.terrain?error={error}")
print(f"tile {level}/{column}/{row}: {len(tile)} bytes, at most {headers['Terrain-Max-Error']} m off the samples of its level")


# %% [markdown]
# ## Decoding
#
# The header has 88 bytes; heights lie between its two floats at byte 24. Vertices follow as three arrays of zigzag-coded differences: u from the
# west, v from the south, and height, each from 0 to 32767. The index of a corner is coded as its distance back from the first vertex that no
# triangle has used yet: each code 0 uses that vertex.

# %%
def decode(tile):
    """Vertices as rows of u, v (0 to 1) and height in metres, and triangles as rows of three indices."""
    low, high = struct.unpack_from("<2f", tile, 24)
    count, = struct.unpack_from("<I", tile, 88)
    codes = numpy.frombuffer(tile, "<u2", 3 * count, 92).astype(int).reshape(3, count)
    vertices = numpy.cumsum((codes >> 1) ^ -(codes & 1), axis=1).T / 32767
    vertices[:, 2] = low + vertices[:, 2] * (high - low)
    at, number = (92 + 6 * count, "<u2") if count <= 65536 else ((92 + 6 * count + 3) & ~3, "<u4")
    triangles, = struct.unpack_from("<I", tile, at)
    codes = numpy.frombuffer(tile, number, 3 * triangles, at + 4).astype(int)
    unused = numpy.cumsum(codes == 0) - (codes == 0)  # before each code
    return vertices, (unused - codes).reshape(triangles, 3)


vertices, triangles = decode(tile)
longitudes, latitudes = -180 + (column + vertices[:, 0]) * span, -90 + (row + vertices[:, 1]) * span
print(f"{len(vertices)} vertices, {len(triangles)} triangles, {vertices[:, 2].min():.1f} to {vertices[:, 2].max():.1f} m")

# %% [markdown]
# ## Against the source
#
# POST sends points as numbers, and gets heights as numbers, NaN outside of the source. Tiles of shallow levels are made from averages, so their vertices
# differ from the full resolution; `Terrain-Certified-Error` bounds the difference.

# %%
points = numpy.column_stack((longitudes, latitudes)).astype("<f8")[:10_000]
source = numpy.frombuffer(fetch(f"{dataset}/heights", points.tobytes(), "application/octet-stream")[0], "<f4")
difference = numpy.abs(vertices[:len(points), 2] - source)
print(f"vertices are up to {numpy.nanmax(difference):.1f} m from the source, {numpy.nanmean(difference):.1f} m in the mean; "
      f"certified: {headers['Terrain-Certified-Error']} m")

# %% [markdown]
# ## Picture
#
# Each triangle is filled with a colour by its height, lit from the north-west by its slope, and framed.

# %%
def draw(vertices, triangles, metres_east, metres_north, side=720):
    """An image of side x side pixels, red, green and blue from 0 to 255. The tile is metres_east x metres_north."""
    image = numpy.zeros((side, side, 3))
    corners = vertices * (side, -side, 1) + (0, side, 0)  # x, y from the top, height
    low, high = vertices[:, 2].min(), vertices[:, 2].max()
    stops = numpy.linspace(low, high, 4)
    palette = numpy.array([(74, 124, 58), (140, 150, 90), (201, 183, 122), (244, 240, 234)])
    for a, b, c in corners[triangles]:
        east, north, up = numpy.cross((b - a) * (metres_east / side, -metres_north / side, 1), (c - a) * (metres_east / side, -metres_north / side, 1))
        light = max(0.35, (up - east + north) / numpy.linalg.norm((east, north, up)) / 1.2)
        colour = light * numpy.array([numpy.interp((a + b + c)[2] / 3, stops, channel) for channel in palette.T])
        x0, y0 = numpy.floor(numpy.minimum(numpy.minimum(a, b), c)[:2]).astype(int)
        x1, y1 = numpy.ceil(numpy.maximum(numpy.maximum(a, b), c)[:2]).astype(int)
        x, y = numpy.meshgrid(numpy.arange(x0, min(x1 + 1, side)) + 0.5, numpy.arange(y0, min(y1 + 1, side)) + 0.5)
        area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
        v = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / area
        w = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / area
        inside = numpy.minimum(numpy.minimum(v, w), 1 - v - w)
        part = image[y0:y0 + x.shape[0], x0:x0 + x.shape[1]]
        part[inside >= 0] = colour
        part[(inside >= 0) & (inside * abs(area) < 0.5 * max(x1 - x0, y1 - y0))] *= 0.8
    return numpy.clip(image, 0, 255).astype(numpy.uint8)


def png(image):
    """The bytes of a PNG file."""
    height, width, _ = image.shape
    rows = numpy.hstack((numpy.zeros((height, 1), numpy.uint8), image.reshape(height, -1))).tobytes()
    chunks = ((b"IHDR", struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks)


metres = span * 111_320
picture = png(draw(vertices, triangles, metres * numpy.cos(numpy.radians(latitudes.mean())), metres))
if is_script:
    pathlib.Path(out).write_bytes(picture)
else:
    import IPython.display

    IPython.display.display(IPython.display.Image(picture))
