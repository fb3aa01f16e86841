"""Synthetic elevation models, for tests that need a separate raster."""
import array
import math
import os
import pathlib
import sys
import time

SIDE = 1201


def write_hgt(path, phase=0.0, base=1000):
    """Writes a square degree of hills in one file whose time is an hour ago; another phase or base gives other hills."""
    rows = [[math.sin(i / 37 + phase) for i in range(SIDE)], [math.cos(i / 53 + phase) for i in range(SIDE)]]
    heights = array.array("h", (int(base + 400 * rows[0][x] * rows[1][y] + 30 * rows[0][(x * 7 + y * 3) % SIDE])
                                for y in range(SIDE) for x in range(SIDE)))
    if sys.byteorder == "little":
        heights.byteswap()
    path.write_bytes(heights.tobytes())
    an_hour_ago = time.time() - 3600
    os.utime(path, (an_hour_ago, an_hour_ago))


def write_asc(path, west, south, cell, side):
    """Writes an Esri ASCII grid of `side` x `side` samples in WGS 84, and its .prj file."""
    rows = "\n".join(" ".join(str(100 + column * row % 40) for column in range(side)) for row in range(side))
    path.write_text(f"ncols {side}\nnrows {side}\nxllcorner {west}\nyllcorner {south}\ncellsize {cell}\n{rows}\n")
    path.with_suffix(".prj").write_text('GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],'
                                        'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]]')


if __name__ == "__main__":
    write_hgt(pathlib.Path(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]))
