"""Reads PMTiles files: the tiles of an archive, without the product's own code."""
import gzip
import json
import pathlib
import struct


def _varints(data):
    at = 0
    while at < len(data):
        value = shift = 0
        while True:
            byte = data[at]
            at += 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                break
        yield value


def _directory(data):
    """(tile id, run, length, offset) of each entry."""
    numbers = _varints(gzip.decompress(data))
    count = next(numbers)
    ids, last = [], 0
    for _ in range(count):
        last += next(numbers)
        ids.append(last)
    runs = [next(numbers) for _ in range(count)]
    lengths = [next(numbers) for _ in range(count)]
    entries, end = [], 0
    for tile, run, length in zip(ids, runs, lengths):
        written = next(numbers)
        offset = end if written == 0 else written - 1
        end = offset + length
        entries.append((tile, run, length, offset))
    return entries


def _place(tile_id):
    """Zoom, column and row of a place on the Hilbert curves."""
    zoom, first = 0, 0
    while tile_id >= first + 4 ** zoom:
        first += 4 ** zoom
        zoom += 1
    at, x, y, side = tile_id - first, 0, 0, 1
    while side < 2 ** zoom:
        right, up = at // 2 & 1, (at ^ at // 2) & 1
        if not up:
            if right:
                x, y = side - 1 - x, side - 1 - y
            x, y = y, x
        x, y = x + side * right, y + side * up
        at //= 4
        side *= 2
    return zoom, x, y


def bounds_of(file):
    """West, south, east, north in degrees, as the header states them."""
    return [degrees / 1e7 for degrees in struct.unpack_from("<4i", pathlib.Path(file).read_bytes(), 102)]


def tiles_of(file):
    """{(zoom, x, y): bytes} of one file."""
    data = pathlib.Path(file).read_bytes()
    assert data[:8] == b"PMTiles\x03", file
    root_at, root_size, _, _, leaves_at, _, tiles_at, _ = struct.unpack_from("<8Q", data, 8)
    tiles = {}

    def read(directory):
        for tile, run, length, offset in _directory(directory):
            if run == 0:
                read(data[leaves_at + offset:leaves_at + offset + length])
            for i in range(run):
                tiles[_place(tile + i)] = data[tiles_at + offset:tiles_at + offset + length]

    read(data[root_at:root_at + root_size])
    return tiles


def archive(place, geodetic=True):
    """{(level, x, y): bytes} of an archive in chunks, y as in the URLs of its format."""
    place = pathlib.Path(place)
    manifest = json.loads((place / "manifest.json").read_text())
    tiles = {}
    for file in [place / "top.pmtiles", *sorted((place / "units").glob("*.pmtiles"))]:
        for (zoom, x, y), data in tiles_of(file).items():
            key = (zoom - 1, x, y) if geodetic else (zoom, x, y)
            assert key not in tiles, (file, key)
            tiles[key] = data
    return manifest, tiles
