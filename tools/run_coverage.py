#!/usr/bin/env python3
"""Shows which lines of each module the tests run: builds with clang's counters, runs ctest, and prints a table.

    tools/run_coverage.py [--jobs N] [--missed] [--keep] [--no-run] [CTEST_OPTION ...]

--missed prints the lines that never ran, for every file with five or more of them. --keep adds to the counts of earlier runs in
build/coverage/profiles; --no-run uses only those. A server that a test kills leaves no counts, and neither does a test that times
out. Exit status 1 if a module is below 90 %.
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
MODULES = ("engine/core", "engine/geo", "engine/tin", "engine", "proto", "config", "tiler", "server/jobs", "server/store", "server/tiles", "server/net", "server/http",
         "server/telemetry", "server/openapi", "server/query", "server/api", "server/access", "server/documents", "server/handlers",
         "server/reload", "fly", "server/cli", "server", "archive", "bake", "redis")
WANTED = 90.0


def run(command, **kwargs):
    print("+", " ".join(map(str, command[:12])), flush=True)
    return subprocess.run(command, cwd=ROOT, stdin=subprocess.DEVNULL, **kwargs)


def run_tests(jobs, keep, options):
    run(["cmake", "--preset", "coverage", "-DTERRACE_BUILD_TESTS=ON", "--log-level=WARNING"], check=True)
    run(["ninja", "-C", BUILD, "-j", str(jobs)], check=True)
    if not keep:
        shutil.rmtree(PROFILES, ignore_errors=True)
    PROFILES.mkdir(exist_ok=True)
    # One file for each binary; its processes add their counts.
    environment = os.environ | {"LLVM_PROFILE_FILE": f"{PROFILES}/%4m.profraw"}
    run(["ctest", "--test-dir", BUILD, "-j", str(jobs), "--output-on-failure", *options], env=environment)


def export(*options):
    """The output of llvm-cov export for all binaries of the build."""
    merged = BUILD / "all.profdata"
    run(["llvm-profdata-14", "merge", "-sparse", "-o", merged, *sorted(PROFILES.glob("*.profraw"))], check=True)
    binaries = [path for path in sorted(BUILD.rglob("*"))
                if path.is_file() and os.access(path, os.X_OK) and path.suffix == "" and "CMakeFiles" not in path.parts]
    objects = [part for path in binaries[1:] for part in ("-object", str(path))]
    return run(["llvm-cov-14", "export", *options, f"-instr-profile={merged}", binaries[0], *objects], check=True,
               stdout=subprocess.PIPE).stdout


def name_of(path):
    """The path below the root: with ccache it may be build/coverage/../../config/config.h."""
    return os.path.relpath(path, ROOT)


def summaries():
    """File -> llvm-cov's summary of it."""
    files = json.loads(export("-summary-only"))["data"][0]["files"]
    return {name_of(file["filename"]): file["summary"] for file in files}


def missed_lines():
    """File -> the numbers of its lines that never ran."""
    missed, name = collections.defaultdict(list), None
    for line in export("-format=lcov").decode().splitlines():
        key, _, value = line.partition(":")
        if key == "SF":
            name = name_of(value)
        elif key == "DA" and value.endswith(",0"):
            missed[name].append(int(value.partition(",")[0]))
    return missed


def ranges(numbers):
    """Turns 3, 4, 5, 9 into "3-5, 9"."""
    found = []
    for number in sorted(numbers):
        if found and found[-1][1] == number - 1:
            found[-1][1] = number
        else:
            found.append([number, number])
    return ", ".join(f"{first}-{last}" if last > first else str(first) for first, last in found)


def module_of(name):
    return max((module for module in MODULES if name.startswith(module + "/")), key=len, default=None)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--missed", action="store_true")
    parser.add_argument("--keep", action="store_true")
    parser.add_argument("--no-run", action="store_true")
    arguments, options = parser.parse_known_args()
    if not arguments.no_run:
        run_tests(arguments.jobs, arguments.keep, options)
    totals, missed = collections.defaultdict(lambda: [0, 0, 0, 0]), []
    for name, summary in summaries().items():
        module = module_of(name)
        if module is None:
            continue
        lines, branches = summary["lines"], summary["branches"]
        counts = (lines["covered"], lines["count"], branches["covered"], branches["count"])
        totals[module] = [total + count for total, count in zip(totals[module], counts)]
        missed.append((lines["count"] - lines["covered"], lines["percent"], name))
    print("\n| module | lines | run | branches taken |\n|---|---|---|---|")
    low = False
    for module in MODULES:
        run_lines, lines, taken, branches = totals[module]
        share = 100 * run_lines / max(lines, 1)
        low = low or share < WANTED
        print(f"| `{module}` | {lines:,} | {share:.1f} %{'' if share >= WANTED else ' (low)'} | {100 * taken / max(branches, 1):.1f} % |")
    if arguments.missed:
        print("\n| file | run | lines that never run |\n|---|---|---|")
        numbers = missed_lines()
        for count, percent, name in sorted(missed, reverse=True):
            if count >= 5:
                print(f"| `{name}` | {percent:.1f} % | {count}: {ranges(numbers[name])} |")
    return 1 if low else 0


if __name__ == "__main__":
    sys.exit(main())
