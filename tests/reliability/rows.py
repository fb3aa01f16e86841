"""The other rows of docs/reliability.md that a client can test on the real binary. Each returns (kept, figures)."""
import itertools
import math
import os
import pathlib
import signal
import statistics
import tempfile
import threading
import time

import descriptors
import floods
import many_sources
import restarts
import soak
from load_rows import tiles
from recorded_tests import binary_of, end_to_end, fuzzed, recorded_by, run_tests, tests
from server import ROOT, Server, fetch, get, read_reply

HOT = "/earth/0/0/0.terrain"


def row_1(_, test_binary, __):
    return fuzzed(test_binary, "url")


def row_2(_, test_binary, __):
    return fuzzed(test_binary, "http", "heights")


def row_3(_, test_binary, __):
    return fuzzed(test_binary, "record", "config")


def row_4(_, test_binary, __):
    return fuzzed(test_binary, "greedy", "refinement", "quantized_mesh")


def row_8(_, test_binary, __):
    kept, _, recorded, failed = tests(test_binary, "HttpRules.*")
    return kept, f"{recorded.get('cases', 0)} cases" + (f", failed: {failed}" if failed else ", all kept")


def row_9(_, test_binary, __):
    kept, _, recorded, failed = tests(test_binary, "Framing.Ambiguous*")
    return kept, f"{recorded.get('cases', 0)} messages, {'none' if kept else 'some'} got two answers"


def row_12(_, test_binary, __):
    kept, _, recorded, _ = tests(test_binary, "Limits.FiveHundredSlowReaders*")
    return kept, f"RSS +{recorded.get('resident_kib', -1) * 1024 / 1e6:.0f} MB"


def row_16(_, test_binary, __):
    kept, _, recorded, _ = tests(binary_of(test_binary, "http/server_http_test"), "Negotiate.ComesToFortyOneErrorsAtMost")
    return kept, f"{recorded.get('errors', 0):,} errors come to {recorded.get('steps', 0)} a tile and format"


def row_17(_, test_binary, __):
    kept, count, recorded, failed = tests(binary_of(test_binary, "../engine/dem/dem_test"), "SourcePolicyTest.*")
    return kept, f"{recorded.get('names', 0)} names refused, nothing fetched, {count} tests" + (f", failed: {failed}" if failed else "")


def row_18(_, test_binary, __):
    kept, _, recorded, _ = tests(binary_of(test_binary, "../engine/dem/dem_test"), "DamagedFiles.*")
    return kept, f"{recorded.get('files', 0)} files, each in a process of its own: " + ("0 crashes, hangs or over 512 MB" if kept else "FAILED")


def row_20(_, test_binary, __):
    kept, count, recorded, failed = tests(test_binary, "AbandonedBuild.*:ServerTest.SurvivesASource*:ServerTest.SurvivesABuilder*:ServerTest.TellsEveryWaiter*")
    slowest = recorded.get("slowest_ms", math.inf)
    return kept and slowest <= 1000, f"{count} tests; 100 waiters told within {slowest} ms" + (f", failed: {failed}" if failed else "")


def row_24(binary, _, long):
    return end_to_end(binary, "disk_cache_test.py", "kill_9_under_load", "first_thousand", long=long)


def row_25(binary, _, long):
    return end_to_end(binary, "disk_cache_test.py", "power_cut", long=long)


def row_26(_, test_binary, __):
    kept, _, _, _ = tests(binary_of(test_binary, "tiles/server_tiles_test"), "Seal.*:TileRecord.RefusesEveryOtherLength")
    stores, count, _, _ = tests(binary_of(test_binary, "tiles/disk_store_test"), "DamagedStoreTest.*")
    return kept and stores, "every bit and every length of a record detected; " + (f"{count} tests of damaged files of the store" if stores else "FAILED")


def row_27(_, test_binary, __):
    kept, count, _, failed = tests(binary_of(test_binary, "tiles/disk_store_test"), "FailingDiskTest.*")
    return kept, f"{count} tests: nth read and write fail, once and for good, until clean" + (f", failed: {failed}" if failed else "")


def row_28(binary, _, long):
    return end_to_end(binary, "disk_cache_test.py", "full_disk", long=long)


def row_30(binary, _, long):
    return end_to_end(binary, "reload_test.py", "no_answer_mixes", "seen_soon", "overwritten_and_deleted", long=long)


def row_31(binary, _, __):
    statuses, bodies = {}, set()
    for clock in (None, "+10y", "-10y", "+0 x5"):
        prefix = () if clock is None else ("faketime", "-f", clock)
        with Server(binary, "--cache-bytes", "0", prefix=prefix) as server:
            for target in (HOT, "/jacksboro/9/272/359.terrain", "/earth/layer.json", "/readyz") * 10:
                reply = fetch(server, target)
                statuses[reply[0]] = statuses.get(reply[0], 0) + 1
                bodies.add((target, reply[2]))
    return set(statuses) == {200} and len(bodies) == 4, f"clocks 10 years off either way, 5x fast: {statuses}, {len(bodies)} different bodies of 4 URLs"


def row_32(binary, _, long):
    drains = 100 if long else 10
    slowest, cut, codes = 0, 0, set()
    for _ in range(drains):
        with Server(binary, "--cache-bytes", "0") as server:
            broken, stop = [], threading.Event()

            def run():
                targets, pending = itertools.cycle(list(tiles())), b""
                try:
                    with server.connect() as connection:
                        while not stop.is_set():
                            pending = b""
                            connection.sendall(get(next(targets)))
                            pending = connection.recv(65536)
                            if not pending:
                                return  # closed between two replies
                            if read_reply(connection, pending) is None:
                                broken.append(1)
                                return
                except OSError:
                    if pending:  # a reply had started
                        broken.append(1)

            threads = [threading.Thread(target=run) for _ in range(8)]
            for thread in threads:
                thread.start()
            time.sleep(0.5)
            begun = time.monotonic()
            os.kill(server.pid, signal.SIGTERM)
            codes.add(server.process.wait(30))
            slowest = max(slowest, time.monotonic() - begun)
            stop.set()
            for thread in threads:
                thread.join()
            cut += len(broken)
    return codes == {0} and cut == 0 and slowest <= 10, f"{drains} drains, exit codes {codes}, {cut} truncated, slowest {slowest:.1f} s"


def row_33(binary, _, long):
    seconds = 600 if long else 90
    samples, tally, words = soak.soak(binary, seconds)
    # A short run, or one on a busy machine, does not fill the caches, so memory still grows.
    return soak.kept(samples, tally, 1 if long else math.inf), soak.told(seconds, samples, tally, words)


def row_34(_, test_binary, __):
    kept, count, recorded, failed = tests(binary_of(test_binary, "allocation_test"), "*")
    return kept, f"{count} requests, each with every allocation on its way failing once: 503, an answer all the same or the end of the connection, " \
                 "and the next request is answered" + (f"; failed: {failed}" if failed else "")


def row_37(binary, _, __):
    """While a flood keeps the workers busy: RSS before 260 clients send complete uploads and disconnect, and its peak meanwhile."""
    with Server(binary, "--worker-threads", "2", "--trusted-proxies", "127.0.0.1") as server:
        everything, _ = floods.floods(server.port)
        with everything["12 meshes"]:
            floods.leave(server.port, 20, 10)
            before = most = server.resident_kib()
            leaving = threading.Thread(target=floods.leave, args=(server.port, 260, 130))
            leaving.start()
            while leaving.is_alive():
                most = max(most, server.resident_kib())
                leaving.join(0.01)
    return (most - before) * 1024 <= 32 << 20, f"260 uploads of 600 kB, 130 at once, left while workers were busy: RSS +{(most - before) / 1024:.0f} MB of 32 MiB"


def row_38(binary, test_binary, long):
    kept, count, _, failed = tests(test_binary, "Fairness.*:Uploads.*")
    told = [f"{count} tests" + (f", failed: {failed}" if failed else "")]
    with Server(binary, "--worker-threads", "2", "--trusted-proxies", "127.0.0.1") as server:
        everything, polite = floods.floods(server.port)
        for name, flood in everything.items():
            statuses = floods.beside(flood, polite, server.port, 20 if long else 5)
            bad = sum(count for of_kind in statuses.values() for status, count in of_kind.items() if status != 200)
            kept = kept and bad == 0
            told.append(f"beside {name}: {bad} of {sum(sum(of_kind.values()) for of_kind in statuses.values())} refused")
    return kept, "; ".join(told)


def row_42(binary, _, long):
    """Many connections of clients that never retry; each requests cold tiles one by one."""
    connections, tiles_each = 480, 2
    with Server(binary, "--worker-threads", "2", "--cache-bytes", "0", "--refinement-cache-bytes", "0") as server:
        told, kept = [], True
        for _ in range(5 if long else 1):
            statuses, slowest = floods.patient(server.port, connections, tiles_each, tiles())
            kept = kept and statuses == {200: connections * tiles_each}
            told.append(f"{statuses.get(200, 0)} of {connections * tiles_each} served, slowest {slowest:.1f} s")
    return kept, "; ".join(told)


def row_39(binary, _, __):
    with tempfile.TemporaryDirectory() as folder:
        told = descriptors.serve_with_few(binary, ROOT, pathlib.Path(folder), 80)
    return not told.wrong and told.files > 80 and told.most < 80, str(told)


def row_43(binary, _, __):
    with tempfile.TemporaryDirectory() as folder:
        load = restarts.restart_under_load(binary, 20, 24, restarts.TARGETS, "--config", restarts.SAMPLES, "--disk-cache", folder)
    figures = (f"20 restarts, {load.count} requests of 24 clients: {len(load.failures)} failed, {load.again} sent again as their connection "
               f"closed, slowest {load.slowest:.1f} s")
    return not load.failures and load.count > 1000, figures


def row_46(binary, _, long):
    """Starts twice with many sources around the Earth, and measures cold tiles beside the antimeridian with and without the others."""
    count, pixels = (24_649, 3600) if long else (2_000, 600)
    place = (-83, -180)
    with tempfile.TemporaryDirectory() as scratch:
        folder, one = pathlib.Path(scratch) / "many", pathlib.Path(scratch) / "one"
        many_sources.write(folder, many_sources.cells(count), pixels)
        many_sources.write(one, [place], pixels)

        def served(dem):
            begun = time.monotonic()
            flags = (str(dem), "--cache-dir", f"{scratch}/cache", "--cache-bytes", "0", "--refinement-cache-bytes", "0", "--worker-threads", "2")
            server = Server(binary, *flags)
            return server, time.monotonic() - begun

        def tile_cost(server, dem):
            """Processor seconds of a tile; every request builds it."""
            targets = [f"/{dem.name}/9/{x}/{y}.terrain?error={error}" for x in (0, 1) for y in (20, 21) for error in (3, 5, 9, 20, 40)]
            statuses = [fetch(server, target, timeout=60)[0] for target in targets]
            begun = server.cpu_seconds()
            statuses += [fetch(server, target, timeout=60)[0] for target in targets]
            return (server.cpu_seconds() - begun) / len(targets), set(statuses)

        server, first = served(folder)
        with server:
            pass
        server, second = served(folder)
        with server:
            resident = server.resident_kib()
            of_many, statuses = tile_cost(server, folder)
        server, _ = served(one)
        with server:
            of_one, _ = tile_cost(server, one)
    kept = second <= 10 and resident < 1 << 20 and statuses == {200} and of_many <= 2 * of_one + 0.001
    return kept, f"{count:,} sources of {pixels} rows: {first:.0f} s to start, {second:.1f} s with statistics kept, RSS {resident / 1024:.0f} MB; " \
                 f"a cold tile takes {1000 * of_many:.1f} ms of a processor, {1000 * of_one:.1f} ms with its source alone; {statuses}"


def row_47(_, test_binary, long):
    """Checks both errors in a tile's headers by brute force on its bytes. Cases without data are skipped and reported."""
    told, kept = [], True
    for name, states in (("stated", "Terrain-Max-Error"), ("certified", "Terrain-Certified-Error")):
        cases = run_tests(binary_of(test_binary, f"tiles/{name}_error_test"), "*", long)
        tried = [recorded_by(case) for case in cases if case.get("result") != "SKIPPED"]
        failed = [case["name"] for case in cases if case.get("failures")]
        kept = kept and bool(tried) and not failed
        above = sum(case.get("above", 0) for case in tried)
        medians = sorted(case["hundredths_in_median"] / 100 for case in tried if "hundredths_in_median" in case)
        told.append(f"{states}: {above} of {sum(case.get('tiles', 0) for case in tried):,} tiles of {len(tried)} datasets above it"
                    + (f", {statistics.median(medians):.1f} times the true one, {medians[-1]:.1f} at most (medians)" if medians else "")
                    + (f", {len(cases) - len(tried)} skipped for want of data" if len(tried) < len(cases) else "")
                    + (f", failed: {failed}" if failed else ""))
    return kept, "; ".join(told)
