#!/usr/bin/env python3
"""Prints a line for each header: its name, and the header that is precompiled for it, or "-".

    tests/lint/header_groups.py FOLDER ... -- PRECOMPILED ...

A header may be compiled with another one precompiled if it includes that one, directly or not: nothing is visible to it then
that would not be anyway. The first of PRECOMPILED that fits is printed.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]


def main():
    separator = sys.argv.index("--")
    folders, precompiled = sys.argv[1:separator], sys.argv[separator + 1:]
    includes = {}
    for path in sorted(path for folder in folders for path in (ROOT / folder).rglob("*.h")):
        if "node_modules" not in path.parts:
            text = path.read_text(encoding="utf-8")
            includes[str(path.relative_to(ROOT))] = re.findall(r'^#include "([^"]+)"', text, re.MULTILINE)

    def reached(header):
        found, ahead = set(), [header]
        while ahead:
            new = set(includes.get(ahead.pop(), ())) - found
            found |= new
            ahead += new
        return found

    for header in includes:
        if not header.endswith("-inl.h"):  # a part of a source
            reach = reached(header)
            print(header, next((name for name in precompiled if name in reach), "-"))


if __name__ == "__main__":
    main()
