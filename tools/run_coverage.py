#!/usr/bin/env python3
"""Which lines of each room the tests run: builds with clang's counters, runs ctest, and prints a table.

    tools/run_coverage.py [--jobs N] [--missed] [--no-run] [CTEST_OPTION ...]

--missed lists the files with the most lines that never run as well. --no-run counts what earlier runs have left in
build/coverage/profiles. Tests that kill the server leave no counts of it. Exit status 1 if a room is below 90 %.
"""
import argparse
import collections
import json
import os
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = ROOT / "build/coverage"
PROFILES = BUILD / "profiles"
ROOMS = ("engine/core", "engine/geo", "engine/tin", "engine/dem", "proto", "config", "server/tiles", "server/http", "server/handlers",
         "server/reload", "server/cli", "server")
WANTED = 90.0


def run(command, **kwargs):
    print("+", " ".join(map(str, command[:12])), flush=True)
    return subprocess.run(command, cwd=ROOT, stdin=subprocess.DEVNULL, **kwargs)


def run_tests(jobs, options):
    run(["cmake", "--preset", "coverage", "-DTERRACE_BUILD_TESTS=ON", "--log-level=WARNING"], check=True)
    run(["ninja", "-C", BUILD, "-j", str(jobs)], check=True)
    shutil.rmtree(PROFILES, ignore_errors=True)
    PROFILES.mkdir()
    # A file for each binary, which its processes add to.
    environment = os.environ | {"LLVM_PROFILE_FILE": f"{PROFILES}/%4m.profraw"}
    run(["ctest", "--test-dir", BUILD, "-j", str(jobs), "--output-on-failure", *options], env=environment)


def summaries():
    """File -> llvm-cov's summary of it."""
    merged = BUILD / "all.profdata"
    run(["llvm-profdata-14", "merge", "-sparse", "-o", merged, *sorted(PROFILES.glob("*.profraw"))], check=True)
    binaries = [path for path in sorted(BUILD.rglob("*"))
                if path.is_file() and os.access(path, os.X_OK) and path.suffix == "" and "CMakeFiles" not in path.parts]
    objects = [part for path in binaries[1:] for part in ("-object", str(path))]
    export = run(["llvm-cov-14", "export", "-summary-only", f"-instr-profile={merged}", binaries[0], *objects,
                  f"-ignore-filename-regex=({BUILD}|{ROOT}/tests|/usr|{ROOT}/.deps)"], check=True, stdout=subprocess.PIPE)
    files = json.loads(export.stdout)["data"][0]["files"]
    return {os.path.relpath(file["filename"], ROOT): file["summary"] for file in files}


def room_of(name):
    return max((room for room in ROOMS if name.startswith(room + "/")), key=len, default=None)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--missed", action="store_true")
    parser.add_argument("--no-run", action="store_true")
    arguments, options = parser.parse_known_args()
    if not arguments.no_run:
        run_tests(arguments.jobs, options)
    rooms, missed = collections.defaultdict(lambda: [0, 0, 0, 0]), []
    for name, summary in summaries().items():
        room = room_of(name)
        if room is None:
            continue
        lines, branches = summary["lines"], summary["branches"]
        counts = (lines["covered"], lines["count"], branches["covered"], branches["count"])
        rooms[room] = [total + count for total, count in zip(rooms[room], counts)]
        missed.append((lines["count"] - lines["covered"], lines["percent"], name))
    print("\n| room | lines | run | branches taken |\n|---|---|---|---|")
    low = False
    for room in ROOMS:
        run_lines, lines, taken, branches = rooms[room]
        share = 100 * run_lines / max(lines, 1)
        low = low or share < WANTED
        print(f"| `{room}` | {lines:,} | {share:.1f} %{'' if share >= WANTED else ' (low)'} | {100 * taken / max(branches, 1):.1f} % |")
    if arguments.missed:
        print("\n| file | lines that never run | run |\n|---|---|---|")
        for count, percent, name in sorted(missed, reverse=True)[:25]:
            print(f"| `{name}` | {count} | {percent:.1f} % |")
    return 1 if low else 0


if __name__ == "__main__":
    sys.exit(main())
