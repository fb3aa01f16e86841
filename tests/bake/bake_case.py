"""What the tests of bakes share: sources, an archive to compare with, processes that end with their test."""
import filecmp
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "e2e"))
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
from srtm import write_hgt  # noqa: E402

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
IS_LONG = "--long" in sys.argv
sys.argv = [argument for argument in sys.argv if argument != "--long"]


def files_of(place):
    return sorted(path.relative_to(place).as_posix() for path in pathlib.Path(place).rglob("*") if path.is_file())


class BakeCase(unittest.TestCase):
    CELLS = ("N46E006", "N46E007", "N46E012", "N30E012")
    THREADS = 1  # of the bake of the reference

    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.scratch = pathlib.Path(scratch.name)
        cls.environment = {**os.environ, "XDG_CACHE_HOME": str(cls.scratch / "cache")}
        cls.environment.pop("TERRACE_QUEUE_PASSWORD", None)
        cls.config = cls.make_sources("dems")
        cls.reference = cls.scratch / "reference"
        begun = time.monotonic()
        done = subprocess.run([BINARY, "bake", "--config", cls.config, "--levels", "0-11", "--out", cls.reference, "--threads", str(cls.THREADS)],
                              env=cls.environment, text=True, stderr=subprocess.PIPE)
        assert done.returncode == 0, done.stderr
        cls.seconds = time.monotonic() - begun

    @classmethod
    def make_sources(cls, folder, phases=(0, 0, 0, 0)):
        (cls.scratch / folder).mkdir()
        for cell, phase in zip(cls.CELLS, phases):
            write_hgt(cls.scratch / folder / f"{cell}.hgt", phase)
        config = cls.scratch / folder / "terrace.json"
        # Without a stated floor, the lowest height of all sources is part of every unit.
        config.write_text(json.dumps({"datasets": [{"name": "cells", "sources": ["*.hgt"], "floor": 0, "vertical": "ellipsoid"}]}))
        return config

    @classmethod
    def command(cls, *arguments, config=None, levels="0-11"):
        return [str(part) for part in (BINARY, "bake", "--config", config or cls.config, "--levels", levels, *arguments)]

    @classmethod
    def run_bake(cls, *arguments, config=None, levels="0-11", **options):
        return subprocess.run(cls.command(*arguments, config=config, levels=levels), env=cls.environment, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=300, **options)

    def units(self, done):
        """{unit: outcome} of the lines of --json."""
        lines = [json.loads(line) for line in done.stdout.splitlines()]
        return {line["unit"]: line["outcome"] for line in lines if "unit" in line}

    def begin(self, command, environment=None, **options):
        process = subprocess.Popen(command, env={**self.environment, **(environment or {})}, text=True, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, **options)

        def end():
            if process.poll() is None:
                process.kill()
            process.communicate()
        self.addCleanup(end)
        return process

    def place(self, name="out"):
        place = self.scratch / f"{self.id().rpartition('.')[2]}-{name}"
        self.addCleanup(shutil.rmtree, place, ignore_errors=True)
        return place

    def expect_equal(self, place, reference=None):
        reference = reference or self.reference
        names = files_of(reference)
        self.assertEqual(files_of(place), names)
        _, different, unreadable = filecmp.cmpfiles(reference, place, names, shallow=False)
        self.assertEqual((different, unreadable), ([], []))
