"""Reads a tile of an archive: read_archive.py PLACE LEVEL X Y > tile. PLACE is a folder with a manifest.json."""
import gzip, itertools, json, pathlib, struct, sys

def varints(data):
    value = shift = 0
    for byte in data:
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            yield value
            value = shift = 0

def directory(compressed):  # (first tile, tiles, length, offset) of each entry; tiles 0: a leaf directory
    number = varints(gzip.decompress(compressed))
    count, end, offsets = next(number), 0, []
    ids = list(itertools.accumulate(next(number) for _ in range(count)))
    runs, lengths = [next(number) for _ in range(count)], [next(number) for _ in range(count)]
    for length, written in zip(lengths, number):
        offsets.append(written - 1 if written else end)
        end = offsets[-1] + length
    return list(zip(ids, runs, lengths, offsets))

def tile_id(zoom, x, y):
    at = (4 ** zoom - 1) // 3
    for side in (2 ** bit for bit in reversed(range(zoom))):
        right, lower = int(x & side > 0), int(y & side > 0)
        at += side * side * (3 * right ^ lower)
        x, y = x % side, y % side
        if not lower:
            x, y = (side - 1 - y, side - 1 - x) if right else (y, x)
    return at

def find(path, wanted):
    with open(path, "rb") as file:
        def read(offset, length):
            return file.seek(offset) and file.read(length)
        root, root_length, _, _, leaves, _, data, _ = struct.unpack("<8Q", read(8, 64))
        entries, base = directory(read(root, root_length)), leaves
        while (entry := max((e for e in entries if e[0] <= wanted), default=None)) and entry[1] == 0:
            entries = directory(read(base + entry[3], entry[2]))
        if entry and wanted < entry[0] + entry[1]:
            return read(data + entry[3], entry[2])

if __name__ == "__main__":
    place, (level, x, y) = pathlib.Path(sys.argv[1]), map(int, sys.argv[2:5])
    manifest = json.loads((place / "manifest.json").read_text())
    unit = "top.pmtiles" if level < 7 else f"units/7-{x >> level - 7}-{y >> level - 7}.pmtiles"
    tile = find(place / unit, tile_id(level + (manifest["tiles"]["format"] != "png"), x, y))
    if tile is None:
        sys.exit("the archive has no such tile")
    sys.stdout.buffer.write(gzip.decompress(tile) if manifest["tiles"]["coding"] == "gzip" else tile)
