#!/usr/bin/env python3
"""Builds the Debian package of a release build and looks into it: lintian, files, manual pages, completion, the unit.

    package_test.py BUILD      BUILD: the build folder
"""
import gzip
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]


def run(*command, **options):
    return subprocess.run([str(part) for part in command], check=True, text=True, stdout=subprocess.PIPE, **options).stdout


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        folder = pathlib.Path(cls.scratch.name)
        cls.deb = pathlib.Path(run(ROOT / "packaging/build_deb.sh", BUILD, folder / "out").split()[-1])
        cls.root = folder / "root"
        run("dpkg", "-x", cls.deb, cls.root)
        cls.terrace = cls.root / "usr/bin/terrace"
        cls.commands = re.findall(r"^  ([a-z]+) ", run(cls.terrace, "--help").split("Commands:")[1].split("\n\n")[0], re.MULTILINE)

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def test_lintian_has_no_complaint(self):
        done = subprocess.run(["lintian", "--allow-root", "--fail-on", "error,warning", str(self.deb)], text=True, capture_output=True)
        self.assertEqual((done.returncode, done.stdout), (0, ""), done.stderr)

    def test_each_command_has_a_page_with_each_of_its_options(self):
        self.assertIn("serve", self.commands)
        for command in self.commands:
            with gzip.open(self.root / f"usr/share/man/man1/terrace-{command}.1.gz", "rt") as file:
                page = file.read().replace("\\-", "-")
            options = set(re.findall(r"^ +(?:-\w,)?(--[a-z-]+)", run(self.terrace, command, "--help"), re.MULTILINE))
            self.assertGreater(len(options), 2)
            self.assertEqual([option for option in options if option not in page], [], command)

    def complete(self, *words):
        script = ('source "$0"; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _terrace; printf "%s\\n" "${COMPREPLY[@]}"')
        completion = self.root / "usr/share/bash-completion/completions/terrace"
        return run("bash", "-c", script, completion, self.terrace, *words).split()

    def test_bash_completes_commands_options_and_values(self):
        self.assertEqual(self.complete(""), self.commands)
        self.assertEqual(self.complete("se"), ["serve"])
        self.assertIn("--format", self.complete("bake", "--fo"))
        self.assertIn("single", self.complete("bake", "--form", ""))

    def test_the_configuration_and_the_unit_name_files_of_the_package(self):
        configuration = json.loads((self.root / "etc/terrace/terrace.json").read_text())
        for dataset in configuration["datasets"]:
            for source in dataset["sources"]:
                self.assertTrue((self.root / source.lstrip("/")).is_file(), source)
        unit = (self.root / "lib/systemd/system/terrace.service").read_text()
        for program in re.findall(r"^Exec(?:Start|Reload)=(/usr/\S+)", unit, re.MULTILINE):
            self.assertTrue((self.root / program.lstrip("/")).is_file(), program)
        self.assertIn("User=terrace", unit)
        self.assertIn("u terrace", (self.root / "usr/lib/sysusers.d/terrace.conf").read_text())

    def test_the_viewer_is_found_beside_the_program(self):
        printed = json.loads(run(self.terrace, "serve", self.root / "usr/share/terrace/samples/jacksboro.tif", "--print-config"))
        self.assertIs(printed["viewer"], True)
        self.assertTrue((self.root / "usr/share/terrace/viewer/index.html").is_file())


if __name__ == "__main__":
    BUILD = sys.argv.pop(1)
    unittest.main()
