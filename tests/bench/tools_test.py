#!/usr/bin/env python3
"""Tests of tools/fill_tables.py and tools/plot_paper.py: their output, and the input that they reject."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree

TOOLS = pathlib.Path(__file__).resolve().parents[2] / "tools"
CONTEXT = {"cpu": "A CPU", "cores": 2, "load": 0.3, "compiler": "GNU 1", "flags": "-O2", "commit": "abc",
           "date": "2026-01-02T03:04:05Z"}
PAGE = """# Page

<!-- context -->
old
<!-- end -->

<!-- table T1 -->
old
<!-- end -->
kept
<!-- table T2 -->
measured before
<!-- end -->
"""


def run(tool, *arguments):
    return subprocess.run([sys.executable, TOOLS / tool, *arguments], capture_output=True, text=True, check=False)


class ToolsTest(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = pathlib.Path(scratch.name)
        self.results = self.folder / "results.json"
        self.page = self.folder / "page.md"
        self.page.write_text(PAGE, encoding="utf-8")

    def fill(self, *ids):
        tables = [{"id": name, "markdown": f"| table of {name} |\n"} for name in ids]
        self.results.write_text(json.dumps({"context": CONTEXT, "tables": tables}), encoding="utf-8")
        return run("fill_tables.py", self.results, self.page)

    def test_tables_take_their_places_and_the_rest_stays(self):
        self.assertEqual(self.fill("T1").returncode, 0)
        page = self.page.read_text(encoding="utf-8")
        self.assertNotIn("old", page)
        self.assertIn("<!-- table T1 -->\n\n| table of T1 |\n\n<!-- end -->\nkept\n", page)
        self.assertIn("A CPU, 2 cores, load 0.3; GNU 1, `-O2`; commit abc, 2026-01-02.", page)
        self.assertIn("measured before", page)

    def test_filling_again_changes_nothing(self):
        self.fill("T1", "T2")
        once = self.page.read_text(encoding="utf-8")
        self.fill("T1", "T2")
        self.assertEqual(self.page.read_text(encoding="utf-8"), once)

    def test_a_table_without_a_place_is_an_error(self):
        filled = self.fill("T1", "T9")
        self.assertNotEqual(filled.returncode, 0)
        self.assertIn("T9", filled.stderr)

    def test_figures_become_svg(self):
        series = [{"name": "ours & theirs", "points": [[100, 40], [1000, 4], [5000, 0.5]], "reference": False},
                  {"name": "marks", "points": [[100, 50]], "reference": True}]
        figure = {"id": "curve", "title": "A < B", "x": "vertices", "y": "RMS", "series": series}
        self.results.write_text(json.dumps({"figures": [figure]}), encoding="utf-8")
        self.assertEqual(run("plot_paper.py", self.results, self.folder / "plots").returncode, 0)
        root = ElementTree.parse(self.folder / "plots" / "curve.svg").getroot()
        name = "{http://www.w3.org/2000/svg}"
        self.assertEqual(len(root.findall(f"{name}polyline")), 1)
        self.assertEqual(len(root.findall(f"{name}circle")), 5)  # three points, one mark, and its legend
        places = [tuple(map(float, place.split(","))) for place in root.find(f"{name}polyline").get("points").split()]
        self.assertEqual(places, sorted(places))  # x grows with the number of vertices, y with a decreasing error
        self.assertIn("A < B", [element.text for element in root.iter(f"{name}text")])


if __name__ == "__main__":
    unittest.main()
