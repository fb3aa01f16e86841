"""unittest.main() for tests that mostly wait for time-outs: several at a time, each class set up once."""
import concurrent.futures
import sys
import unittest

THREADS = 4


def alone(test):
    """Decorator of a test that measures times: nothing else runs meanwhile."""
    test.is_alone = True
    return test


def cases_of(suite):
    for part in suite:
        if isinstance(part, unittest.TestSuite):
            yield from cases_of(part)
        else:
            yield part


def run_one(case):
    result = unittest.TestResult()
    case.run(result)
    for kind, found in (("FAIL", result.failures), ("ERROR", result.errors)):
        for test, text in found:
            print(f"{kind}: {test.id()}\n{text}", file=sys.stderr)
    for _, why in result.skipped:
        print(f"skipped: {case.id()}: {why}", file=sys.stderr)
    return result.wasSuccessful()


def main():
    """Arguments: names of tests, as those of unittest.main(); none: all of the program."""
    loader, program = unittest.TestLoader(), sys.modules["__main__"]
    names = [name for name in sys.argv[1:] if not name.startswith("-")]
    suite = loader.loadTestsFromNames(names, program) if names else loader.loadTestsFromModule(program)
    if loader.errors:
        sys.exit("\n".join(loader.errors))
    by_class, passed = {}, []
    for case in cases_of(suite):
        by_class.setdefault(type(case), []).append(case)
    for kind, cases in by_class.items():
        is_skipped = getattr(kind, "__unittest_skip__", False)
        try:
            if not is_skipped:
                kind.setUpClass()
            first = [case for case in cases if getattr(getattr(case, case._testMethodName), "is_alone", False)]
            passed += [run_one(case) for case in first]
            with concurrent.futures.ThreadPoolExecutor(THREADS) as pool:
                passed += list(pool.map(run_one, [case for case in cases if case not in first]))
        finally:
            if not is_skipped:
                kind.tearDownClass()
            kind.doClassCleanups()
    print(f"{sum(passed)} of {len(passed)} tests passed", file=sys.stderr)
    sys.exit(0 if passed and all(passed) else 1)
