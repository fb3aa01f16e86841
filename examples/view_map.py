#!/usr/bin/env python3
"""What is seen from a place: view_map.py http://127.0.0.1:8080/jacksboro OUT.png LAT,LON [EYE_METRES [RADIUS_DEGREES [SIDE]]]

Sends one ray from the eye to each pixel of a map around it, some thousands in a request, and draws what is visible over a hill shade.
Pixels without a height, as beside the data, are unknown and not drawn.
"""
import math
import struct
import sys
import urllib.request

import matplotlib

matplotlib.use("Agg")
import numpy
from matplotlib import pyplot


def post(url, body):
    request = urllib.request.Request(url, body, {"Content-Type": "application/octet-stream"})
    with urllib.request.urlopen(request) as reply:
        return numpy.frombuffer(reply.read(), "<f4")


def wrapped(longitude):
    """The longitude from -180 to 180: a map across the antimeridian reaches beyond."""
    return (longitude + 180) % 360 - 180


def main(dataset, out, place, eye="2", radius="0.15", side="301"):
    latitude, longitude = map(float, place.split(","))
    radius, side = float(radius), int(side)
    wide = radius / math.cos(math.radians(latitude))
    box = (longitude - wide, latitude - radius, longitude + wide, latitude + radius)
    west, south, east, north = wrapped(box[0]), box[1], wrapped(box[2]), box[3]
    with urllib.request.urlopen(f"{dataset}/grid?bbox={west},{south},{east},{north}&width={side}&height={side}") as reply:
        ground = numpy.frombuffer(reply.read(), "<f4").reshape(side, side)
    xs, ys = wrapped(numpy.linspace(box[0], box[2], side)), numpy.linspace(box[3], box[1], side)
    foot, = post(f"{dataset}/heights", struct.pack("<2d", longitude, latitude))
    if numpy.isnan(foot):
        sys.exit(f"{place}: the dataset has no height there")
    visible, unknown = numpy.zeros((side, side), bool), numpy.isnan(ground)
    pixels = numpy.argwhere(~unknown)
    for first in range(0, len(pixels), 10_000):
        batch = pixels[first:first + 10_000]
        rays = [(longitude, latitude, foot + float(eye), xs[column], ys[row], ground[row, column] + 0.5) for row, column in batch]
        answers = post(f"{dataset}/sight?refraction=0.13", b"".join(struct.pack("<6d", *ray) for ray in rays))
        clearance, blocked = answers[::2], answers[1::2]
        visible[tuple(batch.T)] = ~numpy.isnan(clearance) & numpy.isnan(blocked)
        unknown[tuple(batch.T)] = numpy.isnan(clearance)
    print(f"{visible.sum()} pixels are seen, {(~visible & ~unknown).sum()} hidden, {unknown.sum()} unknown")
    relief = numpy.nan_to_num(ground, nan=numpy.nanmin(ground))
    shade = matplotlib.colors.LightSource(315, 40).hillshade(relief, vert_exag=1, dx=2 * radius * 111_000 / side,
                                                              dy=2 * radius * 111_000 / side)
    figure, axes = pyplot.subplots(figsize=(8, 8))
    axes.imshow(shade, cmap="gray", extent=(box[0], box[2], box[1], box[3]), aspect=wide / radius)
    colour = numpy.zeros((side, side, 4))
    colour[visible] = (1, 0.35, 0, 0.55)
    axes.imshow(colour, extent=(box[0], box[2], box[1], box[3]), aspect=wide / radius)
    axes.plot(longitude, latitude, "c^", markersize=9)
    axes.set_title(f"{100 * visible.sum() / (~unknown).sum():.1f} % of the pixels with a height are seen from {eye} m above the ground at the triangle")
    figure.tight_layout()
    figure.savefig(out, dpi=80)


if __name__ == "__main__":
    main(*sys.argv[1:])
