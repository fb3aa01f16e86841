#!/usr/bin/env python3
"""What is seen from a place: view_map.py http://127.0.0.1:8080/jacksboro OUT.png LAT,LON [EYE_METRES [RADIUS_DEGREES [SIDE]]]

Sends one ray from the eye to each pixel of a map around it, some thousands in a request, and draws what is visible over a hill shade.
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


def main(dataset, out, place, eye="2", radius="0.15", side="301"):
    latitude, longitude = map(float, place.split(","))
    radius, side = float(radius), int(side)
    wide = radius / math.cos(math.radians(latitude))
    box = (longitude - wide, latitude - radius, longitude + wide, latitude + radius)
    with urllib.request.urlopen(f"{dataset}/grid?bbox={','.join(map(str, box))}&width={side}&height={side}") as reply:
        ground = numpy.frombuffer(reply.read(), "<f4").reshape(side, side)
    xs, ys = numpy.linspace(box[0], box[2], side), numpy.linspace(box[3], box[1], side)
    visible = numpy.zeros(side * side, bool)
    rays = [struct.pack("<6d", longitude, latitude, float(eye), x, y, 0.5) for y in ys for x in xs]
    for first in range(0, len(rays), 10_000):
        answers = post(f"{dataset}/sight?heights=ground&refraction=0.13", b"".join(rays[first:first + 10_000]))
        visible[first:first + 10_000] = numpy.isnan(answers[1::2])
    visible = visible.reshape(side, side)
    shade = matplotlib.colors.LightSource(315, 40).hillshade(ground, vert_exag=1, dx=2 * radius * 111_000 / side,
                                                              dy=2 * radius * 111_000 / side)
    figure, axes = pyplot.subplots(figsize=(8, 8))
    axes.imshow(shade, cmap="gray", extent=(box[0], box[2], box[1], box[3]), aspect=wide / radius)
    colour = numpy.zeros((side, side, 4))
    colour[visible] = (1, 0.35, 0, 0.55)
    axes.imshow(colour, extent=(box[0], box[2], box[1], box[3]), aspect=wide / radius)
    axes.plot(longitude, latitude, "c^", markersize=9)
    axes.set_title(f"{100 * visible.mean():.1f} % of the map are seen from {eye} m above the ground at the triangle")
    figure.tight_layout()
    figure.savefig(out, dpi=80)


if __name__ == "__main__":
    main(*sys.argv[1:])
