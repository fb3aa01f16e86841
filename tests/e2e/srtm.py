"""A synthetic elevation model in SRTM's format, for tests that need a separate raster."""
import array
import math
import os
import sys
import time

SIDE = 1201


def write_hgt(path, phase=0.0):
    """Writes a square degree of hills in one file whose time is an hour ago; another phase gives other hills."""
    rows = [[math.sin(i / 37 + phase) for i in range(SIDE)], [math.cos(i / 53 + phase) for i in range(SIDE)]]
    heights = array.array("h", (int(1000 + 400 * rows[0][x] * rows[1][y] + 30 * rows[0][(x * 7 + y * 3) % SIDE])
                                for y in range(SIDE) for x in range(SIDE)))
    if sys.byteorder == "little":
        heights.byteswap()
    path.write_bytes(heights.tobytes())
    an_hour_ago = time.time() - 3600
    os.utime(path, (an_hour_ago, an_hour_ago))
