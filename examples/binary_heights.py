#!/usr/bin/env python3
"""Heights and normals of many points as numbers: binary_heights.py http://127.0.0.1:8080/jacksboro LON,LAT [LON,LAT...]"""
import struct
import sys
import urllib.request


def heights_and_normals(dataset, points):
    """Height, east, north and up of each (longitude, latitude); NaN where there is no height."""
    body = b"".join(struct.pack("<2d", *point) for point in points)
    request = urllib.request.Request(dataset + "/heights?normals=1", body, {"Content-Type": "application/octet-stream"})
    with urllib.request.urlopen(request) as reply:
        return list(struct.iter_unpack("<4f", reply.read()))


if __name__ == "__main__":
    wanted = [tuple(map(float, text.split(","))) for text in sys.argv[2:]]
    for (longitude, latitude), (height, *normal) in zip(wanted, heights_and_normals(sys.argv[1], wanted)):
        print(longitude, latitude, f"{height:.3f} m", normal)
