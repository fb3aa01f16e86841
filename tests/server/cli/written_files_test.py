"""Files that terrace mesh and terrace info write: written_files_test.py BINARY SOURCE_DIR."""
import json
import os
import pathlib
import resource
import signal
import subprocess
import sys
import tempfile
import unittest

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SAMPLE = pathlib.Path(sys.argv.pop(1)).resolve() / "config/samples/jacksboro.tif"
POLYGON = [[[-84.3, 36.3], [-84.2, 36.3], [-84.2, 36.4], [-84.3, 36.3]]]
EDIT = {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": POLYGON}, "properties": {"terrain": {"op": "flatten", "height": 400}}}


def run(*arguments, **options):
    return subprocess.run([str(BINARY), *map(str, arguments)], capture_output=True, text=True, timeout=60, **options)


class WrittenFiles(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def test_a_picture_replaces_nothing_that_is_read(self):
        dem, edits, picture = self.folder / "dem.tif", self.folder / "edits.geojson", self.folder / "a.png"
        dem.write_bytes(SAMPLE.read_bytes())
        edits.write_text(json.dumps({"type": "FeatureCollection", "features": [EDIT]}))
        for read in (dem, edits):
            before = read.read_bytes()
            result = run("info", dem, "--edits", edits, "--draw", read)
            self.assertEqual((result.returncode, result.stderr), (2, f"terrace: --draw: {read} is a file that is read; give the picture another name\n"))
            self.assertEqual(read.read_bytes(), before)
        missing = run("info", dem, "--edits", edits, "--draw", self.folder / "no/a.png")
        self.assertEqual(missing.returncode, 1)
        self.assertIn("no/a.png: No such file or directory", missing.stderr)
        self.assertEqual(run("info", dem, "--edits", edits, "--draw", picture).returncode, 0)
        self.assertTrue(picture.read_bytes().startswith(b"\x89PNG"))

    def test_a_picture_needs_edits_and_one_dataset(self):
        edits, picture = self.folder / "edits.geojson", self.folder / "a.png"
        for arguments, said in ((("info", SAMPLE, "--draw", picture), "name them with --edits FILE"),
                                (("info", SAMPLE, SAMPLE, "--edits", edits, "--draw", picture), "is for one dataset")):
            refused = run(*arguments)
            self.assertEqual((refused.returncode, refused.stdout), (2, ""))
            self.assertIn(said, refused.stderr)
        edits.write_text(json.dumps({"type": "FeatureCollection", "features": [EDIT | {"properties": {}}]}))
        plain = run("info", SAMPLE, "--edits", edits, "--draw", picture)
        self.assertEqual(plain.returncode, 1)
        self.assertIn('no feature has "terrain"', plain.stderr)
        baked = run("bake", SAMPLE, "--edits", edits, "--out", self.folder / "baked", "--levels", "0-2")
        self.assertIn(f'its edits change nothing: no feature of {edits} has "terrain"', baked.stderr)
        self.assertFalse(picture.exists())

    def test_a_full_disk_is_told_with_the_file(self):
        out = self.folder / "a.obj"
        limit = 1000  # as a full disk: a write beyond it fails
        full = run("mesh", SAMPLE, "--out", out, "--max-error", 5,
                   preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
        self.assertEqual((full.returncode, full.stderr), (1, f"terrace: {out}: writing the mesh failed; is the disk full?\n"))
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_nothing_is_left_when_the_reader_of_messages_has_gone(self):
        reader, writer = os.pipe()
        os.close(reader)
        done = subprocess.run([BINARY, "mesh", SAMPLE, "--out", self.folder / "a.glb", "--max-error", "5"],
                              stdout=writer, stderr=writer, timeout=60)
        os.close(writer)
        self.assertEqual(done.returncode, -signal.SIGPIPE)
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_edits_of_a_server_are_regular_files(self):
        pipe = self.folder / "edits.geojson"
        os.mkfifo(pipe)
        for edits in (pipe, self.folder):
            done = run("serve", SAMPLE, "--edits", edits, "--check-config")
            self.assertEqual((done.returncode, done.stderr), (1, f"terrace: dataset jacksboro: edits: {edits}: not a regular file; name a GeoJSON file\n"))

    def test_a_secret_in_a_wrong_prefix_is_not_quoted(self):
        done = run("serve", SAMPLE, "--allowed-prefixes", "/vsicurl/https://h.example/d?sig=SECRET", "--check-config")
        self.assertEqual(done.returncode, 2)
        self.assertIn("allowed_prefixes: entry 1", done.stderr)
        self.assertNotIn("SECRET", done.stderr)

    def test_a_pipe_is_not_replaced(self):
        pipe, link = self.folder / "pipe", self.folder / "a.obj"
        os.mkfifo(pipe)
        link.symlink_to(pipe)
        result = run("mesh", SAMPLE, "--out", link, "--points", 4)
        self.assertEqual((result.returncode, result.stderr), (1, f"terrace: {link} is a device or a pipe; name a file\n"))
        self.assertTrue(pipe.is_fifo())

    def test_a_cache_folder_that_cannot_be_created_is_told_with_that_reason(self):
        dangling = self.folder / "link"
        dangling.symlink_to("nowhere")
        result = run("info", "--cache-dir", dangling, SAMPLE)
        self.assertEqual(result.returncode, 0)
        self.assertIn(f"cache_dir {dangling}: cannot be written: File exists", result.stderr)


if __name__ == "__main__":
    unittest.main()
