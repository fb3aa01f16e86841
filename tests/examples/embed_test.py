"""The example program for embedders makes the same tile as the server, and reports errors in its arguments.

    embed_test.py EMBED TERRACE SOURCE_DIR
"""
import atexit
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import urllib.request

EMBED, TERRACE, ROOT = sys.argv[1:4]
DEM = pathlib.Path(ROOT, "config/samples/jacksboro.tif")


OUT = pathlib.Path(tempfile.mkdtemp(), "tile.terrain")
atexit.register(shutil.rmtree, OUT.parent)


def run(*arguments):
    return subprocess.run([EMBED, *map(str, arguments)], capture_output=True, timeout=60, text=True)


class Embed(unittest.TestCase):
    def test_its_tile_is_that_of_the_server(self):
        made = run(DEM, 11, 1089, 1437, 20, OUT)
        self.assertEqual(made.returncode, 0, made.stderr)
        self.assertRegex(made.stdout, r"\d+ triangles, error [\d.]+ m")
        server = subprocess.Popen([TERRACE, "serve", DEM, "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE,
                                  stderr=subprocess.DEVNULL, text=True)
        try:
            url = re.search(r"http://[^/\s]+", server.stdout.readline())[0]
            with urllib.request.urlopen(f"{url}/jacksboro/11/1089/1437.terrain?error=20", timeout=30) as reply:
                self.assertEqual(reply.read(), OUT.read_bytes())
        finally:
            server.terminate()
            server.communicate(timeout=30)

    def test_says_what_is_wrong(self):
        self.assertEqual(run().returncode, 2)
        for arguments, word in (((DEM, 11, 0, 0, 20, OUT), "no such tile"), (("none.tif", 0, 0, 0, 20, OUT), "none.tif")):
            made = run(*arguments)
            self.assertEqual(made.returncode, 1)
            self.assertIn(word, made.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
