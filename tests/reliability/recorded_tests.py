"""Runs other tests, and reads the figures that they record."""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile


def run_tests(binary, pattern, long=False):
    """Runs GoogleTest tests, and returns the report of each."""
    with tempfile.NamedTemporaryFile(suffix=".json") as report:
        subprocess.run([str(binary), f"--gtest_filter={pattern}", f"--gtest_output=json:{report.name}"], stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL, timeout=14400 if long else 600, check=False,
                       env=os.environ | ({"TERRACE_LONG_TESTS": "1"} if long else {}))
        suites = json.load(open(report.name, encoding="utf-8"))
    return [case for suite in suites["testsuites"] for case in suite["testsuite"]]


def recorded_by(case):
    return {key: int(value) for key, value in case.items() if isinstance(value, str) and value.isdigit()}


def tests(binary, pattern):
    """Runs GoogleTest tests: (whether there were any and all passed, their number, recorded properties, failed tests)."""
    cases = run_tests(binary, pattern)
    recorded = {key: value for case in cases for key, value in recorded_by(case).items()}
    failed = [case["name"] for case in cases if case.get("failures") or case.get("result") == "SKIPPED"]
    return bool(cases) and not failed, len(cases), recorded, failed


def binary_of(test_binary, path):
    """The binary of another test in the same build, such as "http/server_http_test" beside server_test."""
    return (test_binary.parent / path).resolve()


def fuzzed(test_binary, *names):
    """Runs smoke tests of fuzz targets, which replay the corpus and run the given number of inputs derived from it."""
    kept, runs = True, []
    for name in names:
        passed, _, recorded, _ = tests(binary_of(test_binary, f"../fuzz/{name}_fuzz_smoke_test"), "*")
        kept = kept and passed
        runs.append(f"{recorded.get('runs', 0):,} x {name}")
    return kept, ", ".join(runs) + (": 0 crashes" if kept else ": FAILED")


def end_to_end(binary, script, *names, long=False):
    """Runs some tests of a script: (whether all passed, the printed lines with figures)."""
    root = pathlib.Path(__file__).resolve().parents[2]
    options = [part for name in names for part in ("-k", name)]
    done = subprocess.run([sys.executable, root / "tests/e2e" / script, binary, root, *options], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                          env=os.environ | ({"TERRACE_LONG_TESTS": "1"} if long else {}), check=False)
    lines = [line.lstrip(".") for line in done.stderr.splitlines() if re.search(r": .*\d|seen after", line)]
    last = done.stderr.strip().splitlines()[-1]
    passed = done.returncode == 0 and "skipped=" not in last  # a skipped test is not kept
    return passed, "; ".join(lines) if passed else last
