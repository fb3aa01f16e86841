#!/usr/bin/env python3
"""Tests what docs/reliability.md promises about clients, and prints one line a row.

    tests/reliability/run.py [--binary FILE] [--tests FILE] [--long] [ROW ...]      ROW: 8, 9 ...; default: all

Exit status 1 if a row is not kept. The machine should have no other load, because some rows measure times.
"""
import argparse
import os
import pathlib
import sys
import tempfile
import time
import traceback

import load_rows
import rows

BUILD = pathlib.Path(__file__).resolve().parents[2] / "build/release"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", type=pathlib.Path, default=BUILD / "server/cli/terrace")
    parser.add_argument("--tests", type=pathlib.Path, default=BUILD / "tests/server/server_test")
    parser.add_argument("--long", action="store_true", help="as often as the scorecard says, not as a CI run can afford")
    parser.add_argument("rows", nargs="*", type=int, metavar="ROW")
    arguments = parser.parse_args()
    known = {int(name[4:]): row for name, row in (vars(load_rows) | vars(rows)).items() if name.startswith("row_")}
    caches = tempfile.TemporaryDirectory()
    os.environ["XDG_CACHE_HOME"] = caches.name  # for all servers, instead of the user's home
    failed = []
    for number in sorted(arguments.rows or known):
        begun = time.monotonic()
        try:
            kept, figures = known[number](arguments.binary, arguments.tests, arguments.long)
        except Exception:  # a row that cannot be tested is not kept
            kept, figures = False, traceback.format_exc().strip().splitlines()[-1]
            traceback.print_exc()
        if not kept:
            failed.append(number)
        print(f"row {number:2}: {'kept    ' if kept else 'NOT KEPT'} {figures} ({time.monotonic() - begun:.0f} s)", flush=True)
    print(f"{len(arguments.rows or known) - len(failed)} kept, {len(failed)} not kept" + (f": {failed}" if failed else ""))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
