"""terrace bake --format glb --form 3tz and folder, as a user runs it: tileset_forms_test.py BINARY.

What they hold is what `terrace serve` sends; a 3TZ file is read by Python's zipfile and by its index.
"""
import hashlib
import http.client
import json
import pathlib
import random
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import zipfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "e2e"))
from srtm import write_asc, write_hgt  # noqa: E402

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
INDEX = "@3dtilesIndex1@"


def index_of(data):
    """[(MD5, offset)] of a 3TZ file: what its last entry holds."""
    end = data.rindex(b"PK\x05\x06")
    entries, size, start = struct.unpack_from("<HII", data, end + 10)
    last = data.rindex(b"PK\x01\x02", start, start + size)
    assert data[last + 46:start + size] == INDEX.encode(), "the index is the last entry"
    method, = struct.unpack_from("<H", data, last + 10)
    assert method == 0, "the index is not compressed"
    stored, at = struct.unpack_from("<I", data, last + 20)[0], struct.unpack_from("<I", data, last + 42)[0]
    begin = at + 30 + len(INDEX)
    found = [struct.unpack_from("<16sQ", data, begin + 24 * i) for i in range(stored // 24)]
    assert len(found) == entries - 1
    return found


class TilesetForms(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.scratch = pathlib.Path(scratch.name)
        write_hgt(cls.scratch / "N46E007.hgt")
        cls.place = cls.bake("chunks")
        cls.folder = cls.bake("folder")
        cls.file = cls.bake("3tz")

    @classmethod
    def command(cls, form, out, *arguments):
        return [str(part) for part in (BINARY, "bake", cls.scratch / "N46E007.hgt", "--vertical", "ellipsoid", "--levels", "0-10", "--format",
                                       "glb", "--cache-dir", cls.scratch / "cache", "--form", form, "--out", out, *arguments)]

    @classmethod
    def bake(cls, form, *arguments, name=""):
        out = cls.scratch / (name or form)
        done = subprocess.run(cls.command(form, out, *arguments), capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        return out

    def files(self):
        return {path.relative_to(self.folder).as_posix(): path.read_bytes() for path in self.folder.rglob("*") if path.is_file()}

    def test_the_folder_is_what_the_server_sends(self):
        process = subprocess.Popen([BINARY, "serve", self.place, "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE,
                                   stderr=subprocess.DEVNULL, text=True)
        try:
            line = process.stdout.readline()
            connection = http.client.HTTPConnection("127.0.0.1", int(re.search(r"127\.0\.0\.1:(\d+)", line)[1]), timeout=60)
            connection.request("GET", "/datasets", headers={"Accept-Encoding": "identity"})
            name = json.loads(connection.getresponse().read())["datasets"][0]["name"]
            for path, data in self.files().items():
                connection.request("GET", f"/{name}/{path}", headers={"Accept-Encoding": "identity"})
                reply = connection.getresponse()
                self.assertEqual((reply.status, reply.read() == data), (200, True), path)
            connection.close()
        finally:
            process.kill()
            process.communicate()

    def test_an_area_without_the_deepest_levels_can_be_opened(self):
        coarse = self.scratch / "coarse.asc"
        write_asc(coarse, west=20, south=45, cell=0.05, side=60)
        command = [str(part) for part in (BINARY, "bake", self.scratch / "N46E007.hgt", coarse, "--vertical", "ellipsoid", "--format", "glb",
                                          "--cache-dir", self.scratch / "cache", "--bbox", "20.5,45.5,21.5,46.5")]
        done = subprocess.run([*command, "--form", "folder", "--out", self.scratch / "area"], capture_output=True, text=True, timeout=300)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue((self.scratch / "area" / "tileset.json").exists())

    def test_each_tile_below_the_roots_is_there(self):
        """Walks the tileset by its documents: every tile that a bit of a subtree names, and no other."""
        files, named = self.files(), {"tileset.json"}

        def subtree(uri, tiling, level, x, y):
            path = uri.split("?")[0].format(level=level, x=x, y=y)
            named.add(path)
            data = files[path]
            magic, version, size, _ = struct.unpack_from("<4sIQQ", data)
            self.assertEqual((magic, version), (b"subt", 1))
            head = json.loads(data[24:24 + size])

            def bits(of):
                if "constant" in of:
                    return lambda _: bool(of["constant"])
                view = head["bufferViews"][of["bitstream"]]
                return lambda i: data[24 + size + view["byteOffset"] + i // 8] >> i % 8 & 1
            tiles, children = bits(head["tileAvailability"]), bits(head["childSubtreeAvailability"])
            first = 0
            for down in range(tiling["subtreeLevels"] + 1):
                for morton in range(4 ** down):
                    dx = sum((morton >> 2 * i & 1) << i for i in range(down))
                    dy = sum((morton >> 2 * i + 1 & 1) << i for i in range(down))
                    at = (level + down, (x << down) + dx, (y << down) + dy)
                    if down == tiling["subtreeLevels"]:
                        if children(morton):
                            yield from subtree(uri, tiling, *at)
                    elif tiles(first + morton):
                        yield at
                first += 4 ** down

        def walk(tile):
            content = tile.get("content", {}).get("uri", "").split("?")[0]
            tiling = tile.get("implicitTiling")
            if tiling:
                for level, x, y in subtree(tiling["subtrees"]["uri"], tiling, 0, 0, 0):
                    named.add(content.format(level=level, x=x, y=y))
            elif content:
                named.add(content)
            for child in tile.get("children", []):
                walk(child)
        walk(json.loads(files["tileset.json"])["root"])
        self.assertGreater(len(named), 100)
        self.assertEqual(named, set(files))

    def test_3tz_holds_the_files_of_the_folder(self):
        wanted = self.files()
        with zipfile.ZipFile(self.file) as archive:
            self.assertIsNone(archive.testzip())
            self.assertEqual(archive.namelist()[-1], INDEX)
            self.assertEqual(set(archive.namelist()), set(wanted) | {INDEX})
            for path in set(wanted) - {"tileset.json"}:
                self.assertEqual(archive.read(path), wanted[path], path)
            # Readers of archives take a query for a part of the name.
            tileset = archive.read("tileset.json").decode()
        self.assertEqual(tileset, re.sub(r"\?v=\w+", "", wanted["tileset.json"].decode()))
        self.assertIn("?v=", wanted["tileset.json"].decode())

    def test_the_index_finds_each_file(self):
        data = self.file.read_bytes()
        index = index_of(data)
        self.assertEqual(index, sorted(index, key=lambda entry: struct.unpack("<QQ", entry[0])))
        offsets = dict(index)
        for path in self.files():
            at = offsets[hashlib.md5(path.encode()).digest()]
            self.assertEqual(data[at:at + 4], b"PK\x03\x04")
            self.assertEqual(data[at + 30:at + 30 + len(path)].decode(), path)

    def test_compressed_tiles_are_deflated_entries(self):
        plain, packed = (self.bake("3tz", "--glb-compression", "none", *flags, name=name)
                         for name, flags in (("plain.3tz", ("--no-gzip",)), ("packed.3tz", ())))
        with zipfile.ZipFile(plain) as one, zipfile.ZipFile(packed) as other:
            self.assertIsNone(other.testzip())
            self.assertEqual(one.namelist(), other.namelist())
            for path in one.namelist():
                if path.endswith(".glb"):
                    self.assertEqual(other.read(path), one.read(path))
                    self.assertEqual(other.getinfo(path).compress_type, zipfile.ZIP_DEFLATED)
        self.assertLess(packed.stat().st_size, plain.stat().st_size * 0.9)

    def test_killed_at_any_moment_it_goes_on_to_the_same_bytes(self):
        random.seed(28)
        begun = time.monotonic()
        self.bake("3tz", name="timed.3tz")
        whole = time.monotonic() - begun
        for form, reference in (("3tz", self.file), ("folder", self.folder)):
            out = self.scratch / f"killed-{form}"
            killed = 0
            for _ in range(12):
                process = subprocess.Popen(self.command(form, out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                try:
                    process.wait(random.uniform(0, 1.1 * whole))
                    break
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
                    killed += 1
            self.assertGreater(killed, 0)
            if not out.exists() or out.with_name(out.name + ".bake").exists():
                self.bake(form, name=out.name)
            if form == "3tz":
                self.assertEqual(out.read_bytes(), reference.read_bytes())
            else:
                self.assertEqual({path.relative_to(out).as_posix(): path.read_bytes() for path in out.rglob("*") if path.is_file()}, self.files())
            self.assertEqual([path.name for path in self.scratch.glob(f"killed-{form}*")], [out.name])

    def kill_after_rename(self, name):
        """A run that ended between the rename of its 3TZ file and the removal of its chunks, as far as can be: the note is written before."""
        out = self.scratch / name
        place = out.with_name(name + ".bake")
        # The run stops when it finds something at `out`: the note is there then, and the file is in the place.
        process = subprocess.Popen(self.command("3tz", out), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        while process.poll() is None and not place.exists():
            time.sleep(0.001)
        out.write_text("not from here")
        said = process.communicate()[1]
        self.assertEqual((process.returncode, "is there already" in said), (2, True), said)
        self.assertEqual((out.read_text(), (place / "manifest.json").exists()), ("not from here", True))
        out.unlink()
        (place / "export/3tz").rename(out)
        return out, place

    def test_killed_between_the_file_and_the_end_it_removes_its_chunks(self):
        out, place = self.kill_after_rename("ended.3tz")
        self.bake("3tz", name="ended.3tz")
        self.assertEqual(out.read_bytes(), self.file.read_bytes())
        self.assertFalse(place.exists())

    def test_chunks_of_which_the_file_was_not_made_stay(self):
        out, place = self.kill_after_rename("other.3tz")
        old = out.rename(out.with_name("moved.3tz"))
        shutil.copy(old, out)  # equal, but perhaps from somewhere else
        for flags, kept in (((), out), (("--no-gzip",), old)):
            if kept != out:
                old.replace(out)
            done = subprocess.run(self.command("3tz", out, *flags), capture_output=True, text=True)
            self.assertEqual((done.returncode, "is there already" in done.stderr), (2, True), done.stderr)
            self.assertTrue((place / "manifest.json").exists())
        self.bake("3tz", name="other.3tz")  # the file is back
        self.assertFalse(place.exists())

    def test_killed_while_it_writes_the_file_it_leaves_nothing_beside(self):
        out = self.scratch / "written.3tz"
        place = out.with_name("written.3tz.bake")
        process = subprocess.Popen(self.command("3tz", out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while process.poll() is None and not (place / "export").exists():
            time.sleep(0.001)
        process.kill()
        process.wait()
        self.assertEqual({path.name for path in self.scratch.glob("written*")} - {out.name}, {place.name} if place.exists() else set())
        if place.exists():
            self.bake("3tz", name=out.name)
        self.assertEqual(out.read_bytes(), self.file.read_bytes())
        self.assertEqual([path.name for path in self.scratch.glob("written*")], [out.name])

    def test_refusals(self):
        for form, flags, part in (("3tz", ("--format", "terrain"), "given more than once"),):
            self.assertIn(part, subprocess.run(self.command(form, "x", *flags), capture_output=True, text=True).stderr)
        command = self.command("3tz", self.scratch / "new")
        command[command.index("glb")] = "terrain"
        done = subprocess.run(command, capture_output=True, text=True)
        self.assertEqual((done.returncode, "give --format glb" in done.stderr), (2, True), done.stderr)
        for form in ("folder", "3tz", "single"):
            command = self.command(form, self.scratch / "new")
            command[command.index("glb")] = "terrain,glb"
            done = subprocess.run(command, capture_output=True, text=True)
            self.assertEqual((done.returncode, "has one format" in done.stderr), (2, True), done.stderr)
            self.assertFalse((self.scratch / "new.bake").exists(), "refused before any work")
        self.assertIn("is there already", subprocess.run(self.command("3tz", self.file), capture_output=True, text=True).stderr)


if __name__ == "__main__":
    unittest.main()
