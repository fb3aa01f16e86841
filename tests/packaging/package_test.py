#!/usr/bin/env python3
"""Builds the Debian package of a release build and looks into it: lintian, files, manual pages, completion, the unit.

    package_test.py BUILD      BUILD: the build folder
"""
import gzip
import json
import os
import pathlib
import re
import subprocess
import sys
import tarfile
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
        self.assertTrue((self.root / "usr/share/terrace/viewer/cesium/index.js").is_file(), "run tools/install_deps.sh and build again")
        unit = (self.root / "lib/systemd/system/terrace.service").read_text()
        for program in re.findall(r"^Exec(?:Start|Reload)=(/usr/\S+)", unit, re.MULTILINE):
            self.assertTrue((self.root / program.lstrip("/")).is_file(), program)
        self.assertIn("User=terrace", unit)
        self.assertIn("u terrace", (self.root / "usr/lib/sysusers.d/terrace.conf").read_text())

    def test_systemd_accepts_the_units_and_rates_them_well(self):
        folder = pathlib.Path(self.scratch.name) / "units"
        folder.mkdir()
        units = [folder / "terrace.service", folder / "terrace.socket"]
        for unit in units:
            text = (self.root / "lib/systemd/system" / unit.name).read_text()
            unit.write_text(text.replace("/usr/bin/terrace", str(self.terrace)))
        done = subprocess.run(["systemd-analyze", "verify", "--man=no", *units], text=True, capture_output=True)
        self.assertEqual((done.returncode, [line for line in done.stderr.splitlines() if str(folder) in line or "terrace" in line]), (0, []))
        # Exposure of at most 2.0 of 10; the threshold is in tenths.
        run("systemd-analyze", "security", "--offline=yes", "--threshold=20", units[0])

    def test_the_bill_of_materials_has_what_the_package_needs_and_contains(self):
        texts = []
        for name in ("a.json", "b.json"):
            run(ROOT / "tools/write_sbom.py", self.deb, self.root / name)
            texts.append((self.root / name).read_text())
        self.assertEqual(texts[0], texts[1])
        document = json.loads(texts[0])
        versions = {component["name"]: component["version"] for component in document["components"]}
        for clause in run("dpkg-deb", "-f", self.deb, "Depends").split(","):
            name = clause.split()[0]
            if name in versions:  # else an alternative of it is
                self.assertEqual(versions[name], run("dpkg-query", "-W", "-f", "${Version}", name))
        viewer = json.loads((ROOT / "server/viewer/package-lock.json").read_text())["packages"]
        self.assertEqual(versions["cesium"], viewer["node_modules/cesium"]["version"])
        for name in ("libgdal32", "libdraco7", "libproj25", "libc6", "boost", "nlohmann-json3-dev"):
            self.assertIn(name, versions)
        refs = [component["bom-ref"] for component in document["components"]] + [document["metadata"]["component"]["bom-ref"]]
        self.assertEqual(len(refs), len(set(refs)))
        named = {ref for entry in document["dependencies"] for ref in [entry["ref"], *entry["dependsOn"]]}
        self.assertEqual(named - set(refs), set())

    def test_all_files_have_the_time_of_the_commit(self):
        with subprocess.Popen(["dpkg-deb", "--fsys-tarfile", self.deb], stdout=subprocess.PIPE) as unpack:
            with tarfile.open(fileobj=unpack.stdout, mode="r|") as archive:
                times = {member.mtime for member in archive}
        commit = os.environ.get("SOURCE_DATE_EPOCH") or run("git", "-C", ROOT, "log", "-1", "--format=%ct")
        self.assertEqual(times, {int(commit)})

    def test_the_viewer_is_found_beside_the_program(self):
        printed = json.loads(run(self.terrace, "serve", self.root / "usr/share/terrace/samples/jacksboro.tif", "--print-config"))
        self.assertIs(printed["viewer"], True)
        self.assertTrue((self.root / "usr/share/terrace/viewer/index.html").is_file())


if __name__ == "__main__":
    BUILD = sys.argv.pop(1)
    unittest.main()
