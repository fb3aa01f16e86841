#!/usr/bin/env python3
"""Checks what compilers do not: machine paths, package hosts and leftovers in all text files of the tree, and crowded folders.

    tools/check_tree.py               check; exit status 1 and one line for each finding
    tools/check_tree.py --self-test   check the checker
"""
import collections
import os
import pathlib
import re
import subprocess
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
# Inputs of fuzz targets, whose bytes must not change.
CORPUS = re.compile(r"tests/fuzz/corpus/\w+/")
SKIPPED_FOLDERS = {".git", ".deps", "build", "node_modules", "data"}

# Split, so that this file does not match itself.
HOSTS = "|".join(("registry" r"\.npmjs", "registry" r"\.yarnpkg", "deb" r"\.debian\.org", "snapshot" r"\.debian", "security" r"\.debian\.org",
                  "pypi" r"\.org", "files" r"\.pythonhosted", "deb" r"\.nodesource", "crates" r"\.io", "proxy" r"\.golang"))
RULES = [
    (re.compile(HOSTS), "names a package registry: the machine's own configuration knows where packages come from"),
    (re.compile(r"(?<![\w.$}])/(?:work|root|home|Users)/[\w.]"), "names a path of one machine"),
    (re.compile(r"^(?:<{7} |>{7} |={7}$)"), "is a conflict marker"),
    (re.compile(r"\b(?:TO" r"DO|FIX" r"ME|X" r"XX)\b"), "is a note to oneself: do it, or open an issue"),
    (re.compile(r"[ \t]+$"), "ends in blanks"),
]
# Words of this project for which the field has other words, in code and documents: (pattern, the field's word).
RULES += [(re.compile(pattern), f"is a word of our own: the field says {word}") for pattern, word in (
    (r"\b[Ss]hee" r"ts?\b|\bShee" r"t[A-Z]|[a-z]Shee" r"ts?\b", "raster grid"),
    (r"\b(?:Raster|Chunk)Sur" r"vey|\bsur" r"vey (?:rec" r"ord|table)|Sur" r"vey(?:Pages|Assembler)", "raster statistics"),
    (r"\bVoid(?:Find" r"ings|Mar" r"ks)", "detected nodata"),
    (r"\b\w*(?:Cell|Geoid|Smooth|Source)Ga" r"p\b|\bsource_ga" r"p", "error bound"),
    (r"\bwis" r"h(?:es|ed)?\b", "requested error, request parameter"),
    (r"\bk(?:Mo" r"st|Lea" r"st|Few" r"est)[A-Z]", "kMax or kMin"),
    (r"\bforeto" r"ld\b|\bforete" r"ll", "predicted"),
    (r"\b(?:GoO" r"n|She" r"d|HoldBa" r"ck|Loo" r"ker|Stra" r"y|Count" r"ing::)\b", "what it is"),
)]
# For the product's code. Headers and documents that proto writes may have exponents, as in JSON.
EXPONENT = re.compile(r"^(?!proto/|tests/).*\.(?:cc|h)$"), re.compile(r"\{\w*:[^{}\" ]*[eg]\}")

# For the libraries: a program that embeds them may have set a locale with decimal commas.
LOCALE = re.compile(r"^(?:engine|proto|tiler|archive|bake)/.*\.(?:cc|h)$"), re.compile(r"\b(?:ato" r"f|str" r"to(?:d|f|ld)|sto" r"(?:d|f|ld))\(")


def files():
    """Files that git tracks or would track; without git all files that were not built or downloaded."""
    listing = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"], cwd=ROOT,
                             stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    if listing.returncode == 0:
        return sorted(ROOT / name for name in listing.stdout.decode().split("\0") if name)
    found = []
    for folder, folders, names in os.walk(ROOT):
        folders[:] = [name for name in folders if name not in SKIPPED_FOLDERS]
        found += [pathlib.Path(folder, name) for name in names]
    return sorted(found)


def findings(name, text):
    for number, line in enumerate(text.splitlines(), 1):
        for pattern, message in RULES:
            if match := pattern.search(line):
                yield f"{name}:{number}: '{match[0].strip()}' {message}"
        if EXPONENT[0].match(name) and (match := EXPONENT[1].search(line)):
            yield f"{name}:{number}: '{match[0]}' prints exponents such as 1e+06: use PlainNumber"
        if LOCALE[0].match(name) and (match := LOCALE[1].search(line)):
            yield f"{name}:{number}: '{match[0]}' depends on the locale of the program: use std::from_chars"
    if name.endswith("-inl.h"):  # included once for each instruction set
        if "HWY_TARGET_TOGGLE" not in text:
            yield f"{name}:1: a header of instruction sets without the guard of HWY_TARGET_TOGGLE"
    elif name.endswith(".h") and "#pragma once" not in text:
        yield f"{name}:1: a header without #pragma once"
    if text and not text.endswith("\n"):
        yield f"{name}: does not end in a line feed"


MAX_SOURCES = 25  # of C++ in a folder of the product


def crowded_folders(names):
    counts = collections.Counter(name.rpartition("/")[0] for name in names if name.endswith((".cc", ".h")) and not name.startswith("tests/"))
    for folder, count in counts.items():
        if count > MAX_SOURCES:
            yield f"{folder}: {count} sources, more than {MAX_SOURCES}: divide it or move some to the module that uses them"


class SelfTest(unittest.TestCase):
    def test_findings(self):
        for text in ("https://registry" ".npmjs.org/cesium\n", "cd /wo" "rk/main\n", "'/ho" "me/ann/dem.tif'\n", "<<<<" "<<< HEAD\n", "int kMo" "stTiles;\n", "// a shee" "t of rasters\n",
                     "// TO" "DO: later\n", "blank \n", "no line feed"):
            with self.subTest(text=text):
                self.assertEqual(len(list(findings("a.cc", text))), 1)
        for text in ('Format("{:.3g} m", error_m);\n', 'Format("{0:g}", x);\n'):
            self.assertEqual([len(list(findings(name, text))) for name in ("server/a.cc", "proto/a.cc", "a.md")], [1, 0, 0], text)
        text = "double x = std::sto" "d(text);\n"
        self.assertEqual([len(list(findings(name, text))) for name in ("engine/core/a.cc", "server/a.cc")], [1, 0])
        self.assertEqual(len(list(findings("a.h", "int a;\n"))), 1)
        self.assertEqual(len(list(findings("a-inl.h", "#pragma once\n"))), 1)

    def test_no_findings(self):
        for text in ("", "framework/roots/a\n", "https://example.org/home/page\n", "a / work / b\n", "#pragma once\n", "$HOME/root/x\n"):
            with self.subTest(text=text):
                self.assertEqual(list(findings("a.h" if "pragma" in text else "a.cc", text)), [])
        self.assertEqual(list(findings("a-inl.h", "#if defined(A) == defined(HWY_TARGET_TOGGLE)\n")), [])

    def test_crowded_folders(self):
        names = [f"engine/a/{k}.h" for k in range(MAX_SOURCES)] + ["engine/a/b/c.cc", "engine/a/CMakeLists.txt"]
        self.assertEqual(list(crowded_folders(names)), [])
        self.assertEqual(len(list(crowded_folders([*names, "engine/a/z.cc"]))), 1)


def main():
    if sys.argv[1:] == ["--self-test"]:
        unittest.main(argv=sys.argv[:1])
    names = [path.relative_to(ROOT).as_posix() for path in files() if path.is_file()]
    checked, found = 0, list(crowded_folders(names))
    for name in names:
        if CORPUS.match(name):
            continue
        try:
            text = (ROOT / name).read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue  # binary
        checked += 1
        found += findings(name, text)
    print(*found, sep="\n", end="\n" if found else "")
    print(f"{checked} files, {len(found)} findings")
    return 1 if found or not checked else 0


if __name__ == "__main__":
    sys.exit(main())
