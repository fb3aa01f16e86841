#!/usr/bin/env python3
"""Installs the development files of a build, and builds examples/embed with find_package(terrace) outside of the tree.

    install_test.py BUILD EMBED      EMBED: the example as the tree builds it
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD, EMBED = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **options)
    assert done.returncode == 0, f"{command}: {done.stdout}"
    return done.stdout


class Install(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.scratch.name)
        # Through DESTDIR, then elsewhere: a package is built like this, and no file may contain a path of the build.
        run("cmake", "--install", BUILD, "--prefix", "/usr", "--component", "development",
            env={**os.environ, "DESTDIR": str(cls.folder / "staged")})
        cls.prefix = cls.folder / "moved"
        (cls.folder / "staged/usr").rename(cls.prefix)

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def configure(self, version, program=None):
        source = self.folder / f"embed-{version}-{'main' if program is None else 'other'}"
        source.mkdir()
        text = (ROOT / "examples/embed/CMakeLists.txt").read_text()
        (source / "CMakeLists.txt").write_text(re.sub(r"find_package\(terrace [\d.]+", f"find_package(terrace {version}", text))
        (source / "main.cc").write_text(program or (ROOT / "examples/embed/main.cc").read_text())
        return source, subprocess.run(["cmake", "-S", source, "-B", source / "build", f"-DCMAKE_PREFIX_PATH={self.prefix}"],
                                      text=True, capture_output=True)

    def test_a_program_outside_of_the_tree_makes_the_same_tile(self):
        version = re.search(r"project\(terrace VERSION (\d+\.\d+)", (ROOT / "CMakeLists.txt").read_text())[1]
        self.assertIn(f"find_package(terrace {version} ", (ROOT / "examples/embed/CMakeLists.txt").read_text())
        source, configured = self.configure(version)
        self.assertEqual(configured.returncode, 0, configured.stdout + configured.stderr)
        run("cmake", "--build", source / "build")
        tiles = []
        for program in (source / "build/embed", EMBED):
            tiles.append(self.folder / f"{len(tiles)}.terrain")
            run(program, ROOT / "config/samples/jacksboro.tif", 11, 1089, 1437, 20, tiles[-1])
        self.assertGreater(tiles[0].stat().st_size, 1000)
        self.assertEqual(tiles[0].read_bytes(), tiles[1].read_bytes())

    def test_the_program_of_the_page_prints_heights(self):
        program = re.search(r"```cpp\n(.*?)```", (ROOT / "docs/embedding.md").read_text(), re.DOTALL)[1]
        version = re.search(r"project\(terrace VERSION (\d+\.\d+)", (ROOT / "CMakeLists.txt").read_text())[1]
        source, configured = self.configure(version, program)
        self.assertEqual(configured.returncode, 0, configured.stdout + configured.stderr)
        run("cmake", "--build", source / "build")
        printed = subprocess.run([source / "build/embed", ROOT / "config/samples/jacksboro.tif"], capture_output=True, text=True, check=True)
        self.assertEqual(printed.stdout.splitlines()[-2:], ["375.00", "nan"])  # after a warning: the datum is not stated

    def test_the_headers_that_the_page_names_are_installed(self):
        named = re.findall(r"`([a-z/_]+\.h)`", (ROOT / "docs/embedding.md").read_text().split("\n| header |")[1])
        self.assertGreaterEqual(len(named), 6)
        for header in named:
            self.assertTrue((self.prefix / "include/terrace" / header).is_file(), header)

    def test_another_minor_version_is_refused(self):
        _, configured = self.configure("1.99")
        self.assertNotEqual(configured.returncode, 0)
        self.assertIn("compatible with requested version", configured.stderr)

    def test_no_file_names_a_folder_of_the_build(self):
        texts = [path for path in self.prefix.rglob("*") if path.suffix in (".cmake", ".h")]
        self.assertGreater(len(texts), 30)
        for path in texts:
            self.assertNotIn(str(ROOT), path.read_text(), path)
        self.assertEqual([path for path in self.prefix.rglob("*") if path.name.endswith("-inl.h")], [])

    def test_a_package_of_the_server_has_no_development_files(self):
        out = self.folder / "server"
        run("cmake", "--install", BUILD, "--prefix", out)
        self.assertTrue((out / "bin/terrace").is_file())
        self.assertEqual(list(out.rglob("*.a")) + list(out.rglob("*.h")) + list(out.rglob("*.cmake")), [])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
