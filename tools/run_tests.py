#!/usr/bin/env python3
"""Builds and runs the tests: all of them in release, and the GoogleTest binaries also under both sanitizers.

    tools/run_tests.py [--jobs N] [SUITE ...]     suites: release asan tsan; default: all three, in this order

A sanitizer suite runs tests that are executables of the build, and builds only these: `asan` all except those labelled
`slow`, `tsan` those labelled `threads`, which test several threads at once. The last line is
`N passed, N failed`, counted from ctest's reports; a test that could not be built or found counts as failed. Exit status 0
only if everything was built and nothing failed.
"""
import argparse
import dataclasses
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree

ROOT = pathlib.Path(__file__).resolve().parent.parent


@dataclasses.dataclass(frozen=True)
class Suite:
    name: str  # of the CMake preset
    choice: tuple = ()  # ctest's options that select by label; a suite with a choice runs only executables of the build
    environment: dict = dataclasses.field(default_factory=dict)


SANITIZER_TOOLS = {
    # clang-14 looks for a symbolizer without its version in the name.
    "ASAN_SYMBOLIZER_PATH": "/usr/bin/llvm-symbolizer-14",
    "TSAN_SYMBOLIZER": "/usr/bin/llvm-symbolizer-14",
}
SUITES = {
    suite.name: suite
    for suite in (
        Suite("release"),
        Suite("asan", ("-LE", "^slow$"), SANITIZER_TOOLS | {"UBSAN_OPTIONS": "print_stacktrace=1"}),
        Suite("tsan", ("-L", "^threads$"), SANITIZER_TOOLS | {
            "TSAN_OPTIONS": f"suppressions={ROOT}/tools/tsan.supp second_deadlock_stack=1 "
                            "external_symbolizer_path=/usr/bin/llvm-symbolizer-14"}),
    )
}


@dataclasses.dataclass
class Outcome:
    passed: int = 0
    failed: int = 0
    skipped: int = 0
    broken: list = dataclasses.field(default_factory=list)  # steps other than tests that failed

    def add(self, other):
        self.passed += other.passed
        self.failed += other.failed
        self.skipped += other.skipped
        self.broken += other.broken


def run(command, **kwargs):
    print("+", " ".join(map(str, command)), flush=True)
    return subprocess.run(command, cwd=ROOT, stdin=subprocess.DEVNULL, **kwargs).returncode


def programs_of(build, choice):
    """Test -> executable of the build, for the chosen tests. terrace_test gives both the same name; shards have a number."""
    listing = subprocess.run(["ctest", "--test-dir", str(build), "--show-only=json-v1", *choice], cwd=ROOT, check=True,
                             stdout=subprocess.PIPE, stdin=subprocess.DEVNULL)
    targets = subprocess.run(["ninja", "-C", str(build), "-t", "targets", "all"], check=True, stdout=subprocess.PIPE, text=True)
    known = {line.partition(":")[0] for line in targets.stdout.splitlines()}
    programs = {test["name"]: re.sub(r"_\d+$", "", test["name"]) for test in json.loads(listing.stdout)["tests"]}
    return {name: program for name, program in programs.items() if program in known}


def count(report):
    """Counts ctest's JUnit report."""
    outcome = Outcome()
    for case in ElementTree.parse(report).getroot().iter("testcase"):
        status = case.get("status")
        if status == "run":
            outcome.passed += 1
        elif status == "disabled" or (status == "notrun" and "SKIP" in (case.find("skipped").get("message") or "")):
            outcome.skipped += 1
        else:
            outcome.failed += 1
    return outcome


def address_space_prefix():
    """clang-14's ThreadSanitizer fails with the address randomization of recent kernels, so this turns it off if allowed."""
    prefix = ["setarch", os.uname().machine, "--addr-no-randomize"]
    if shutil.which("setarch") and subprocess.run([*prefix, "true"], stderr=subprocess.DEVNULL).returncode == 0:
        return prefix
    return []


def run_suite(suite, jobs):
    started = time.monotonic()
    build = ROOT / "build" / suite.name
    if run(["cmake", "--preset", suite.name, "-DTERRACE_BUILD_TESTS=ON", "--log-level=WARNING"]) != 0:
        return Outcome(broken=[f"{suite.name}: configure"])
    outcome = Outcome()
    # -k 0: builds and tests as much as possible; ctest reports the rest as failed.
    build_command = ["ninja", "-C", str(build), "-j", str(jobs), "-k", "0"]
    report = build / "ctest.xml"
    report.unlink(missing_ok=True)
    # Most tests wait for a server or a clock most of the time, hence twice as many jobs. Tests that need all processors
    # run alone. The timeout ends tests that hang. Tests must stay far below it, also on a loaded machine.
    ctest = ["ctest", "--test-dir", str(build), "--output-on-failure", "--no-tests=error", "-j", str(2 * jobs),
             "--timeout", "600", "--output-junit", str(report)]
    if suite.choice:
        tests = programs_of(build, suite.choice)
        if not tests:
            return Outcome(broken=[f"{suite.name}: no tests found"])
        build_command += sorted(set(tests.values()))
        ctest = address_space_prefix() + ctest + ["-R", f"^({'|'.join(sorted(tests))})$"]
    if run(build_command) != 0:
        outcome.broken.append(f"{suite.name}: build")
    run(ctest, env=os.environ | suite.environment)
    if report.exists():
        outcome.add(count(report))
    else:
        outcome.broken.append(f"{suite.name}: ctest")
    print(f"{suite.name}: {outcome.passed} passed, {outcome.failed} failed, {outcome.skipped} skipped, "
          f"{time.monotonic() - started:.0f} s", flush=True)
    return outcome


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("suites", nargs="*", metavar="SUITE", help="release, asan, tsan")
    arguments = parser.parse_args()
    unknown = set(arguments.suites) - set(SUITES)
    if unknown:
        parser.error(f"no suite {', '.join(sorted(unknown))}; there are {', '.join(SUITES)}")

    total = Outcome()
    for name in arguments.suites or SUITES:
        total.add(run_suite(SUITES[name], arguments.jobs))
    for step in total.broken:
        print(f"did not work: {step}")
    print(f"{total.passed} passed, {total.failed} failed", flush=True)
    return 1 if total.failed or total.broken or not total.passed else 0


if __name__ == "__main__":
    sys.exit(main())
