#!/usr/bin/env python3
"""Compares the fields that `terrace info --json` prints with the table of docs/info.md.

    info_json_test.py TERRACE
"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
SAMPLES = [str(ROOT / "config/samples" / name) for name in ("jacksboro.tif", "etopo5.tif")]
EDIT = {"type": "FeatureCollection", "features": [{
    "type": "Feature", "properties": {"terrain": {"op": "flatten", "height": 400, "blend_m": 100}},
    "geometry": {"type": "Polygon", "coordinates": [[[-84.3, 36.3], [-84.29, 36.3], [-84.29, 36.31], [-84.3, 36.3]]]}}]}


def fields(value, prefix=""):
    """Paths of the values that are no objects; of a list of objects those of its objects, with []."""
    if isinstance(value, dict) and value:
        return {path for key, inner in value.items() for path in fields(inner, f"{prefix}.{key}" if prefix else key)}
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return {path for inner in value for path in fields(inner, prefix + "[]")}
    return {prefix}


def documented(kind):
    rows = re.findall(r"^\| (`[^|]+) \| (both|one raster|mosaic) \|", (ROOT / "docs/info.md").read_text(), re.MULTILINE)
    return {name for names, of in rows if of in ("both", kind) for name in re.findall(r"`([^`]+)`", names)}


class InfoJson(unittest.TestCase):
    def printed(self, *arguments):
        with tempfile.TemporaryDirectory() as folder:
            edits = pathlib.Path(folder, "edits.geojson")
            edits.write_text(json.dumps(EDIT))
            done = subprocess.run([TERRACE, "info", *arguments, "--json", "--edits", str(edits)], text=True, capture_output=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        described = json.loads(done.stdout)
        self.assertEqual(len(described), 1)
        return fields(described[0])

    def test_fields_of_a_raster_are_those_of_the_table(self):
        self.assertEqual(self.printed(SAMPLES[0]), documented("one raster"))

    def test_fields_of_a_mosaic_are_those_of_the_table(self):
        self.assertEqual(self.printed("--mosaic", *SAMPLES), documented("mosaic"))


if __name__ == "__main__":
    TERRACE = sys.argv.pop(1)
    unittest.main()
