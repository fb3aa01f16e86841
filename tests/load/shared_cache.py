#!/usr/bin/env python3
"""Measures for which tiles the shared cache pays: the time and processor time of a build against those of a look-up.

    tests/load/shared_cache.py BINARY [DATA]     DATA: a folder with elevation models, default ../shared/data

One worker, one client, a redis-server on the same machine, no cache in memory. Prints a Markdown table; docs/decisions/0021-shared-cache.md has one.
"""
import asyncio
import json
import os
import pathlib
import random
import re
import statistics
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/scale"))
import cluster  # noqa: E402
from redis_process import Redis  # noqa: E402

COUNT = 150


def processor_seconds(pid):
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def datasets(data):
    known = {"earth, 10'": cluster.earth()[0], "jacksboro, 30 m": {"name": "jacksboro", "sources": [str(cluster.SAMPLES / "jacksboro.tif")]}}
    for title, pattern in (("Maui, 1\"", "srtm1_N20W157*.tif"),):
        if found := sorted(data.glob(pattern)):
            known[title] = {"name": "maui", "sources": [{"path": str(found[0]), "nodata": 0}]}
    return known


def targets_of(node, name, level, suffix):
    layer = json.loads(node.get(f"/{name}/layer.json"))
    every = [(x, y) for part in layer["available"][level] for x in range(part["startX"], part["endX"] + 1) for y in range(part["startY"], part["endY"] + 1)]
    chosen = random.Random(1).sample(every, min(COUNT, len(every)))
    return [f"/{name}/{level}/{x}/{y}{suffix}" for x, y in chosen]


async def draw(port, targets):
    client, times, sizes = cluster.Client(port, is_tls=False), [], []
    for target in targets:
        begun = time.perf_counter()
        status, fields, body = await client.get(target)
        times.append((time.perf_counter() - begun) * 1000)
        sizes.append(len(body))
        assert status == 200, target
    client.close()
    return times, sizes


def measure(binary, dataset, level, suffix):
    with cluster.scratch() as folder:
        redis = Redis(folder).start()
        options = {"shared_cache": {"url": f"redis://127.0.0.1:{redis.port}/0", "min_build_ms": 0, "timeout_ms": 1000},
                   "cache_bytes": 0, "refinement_cache_bytes": 0, "worker_threads": 1}
        node = cluster.Node(binary, folder, [dataset], options).start()
        targets = targets_of(node, dataset["name"], level, suffix)
        time.sleep(1)

        def timed(pids):
            before = [processor_seconds(pid) for pid in pids]
            found = asyncio.run(draw(node.port, targets))
            return found, [(processor_seconds(pid) - b) * 1000 / len(targets) for pid, b in zip(pids, before)]
        pids = [node.process.pid, redis.process.pid]
        (build, sizes), (build_cpu, _) = timed(pids)
        time.sleep(0.5)
        rounds = 1 + 2000 // len(targets)
        found, cpu = [], [0.0, 0.0]
        for _ in range(rounds):
            (times, _), used = timed(pids)
            found += times
            cpu = [a + b / rounds for a, b in zip(cpu, used)]
        time.sleep(1.1)
        hits = cluster.sum_of(node.metrics(), "terrace_cache_hits_total", 'tier="shared"')
        memory = int(redis.ask(b"INFO", b"memory").split(b"used_memory_dataset:")[1].split(b"\r")[0]) / len(targets)
        node.stop()
        redis.stop()
        assert hits == len(targets) * rounds, (hits, len(targets), rounds)
        p99 = sorted(build)[len(build) * 99 // 100], sorted(found)[len(found) * 99 // 100]
        return (len(targets), statistics.mean(sizes) / 1000, memory / 1000, statistics.median(build), p99[0], build_cpu, statistics.median(found), p99[1], *cpu)


def main():
    binary = pathlib.Path(sys.argv[1]).resolve()
    data = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else ROOT.parent / "shared/data")
    processor = re.search(r"model name\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text())
    print(f"{processor[1] if processor else 'unknown processor'}, load {os.getloadavg()[0]:.1f}\n")
    print("| tiles | kB, gzip | kB in Redis | build: ms, p99, CPU ms | found: ms, p99, CPU ms of the node, of Redis | build / found |\n| --- | --- | --- | --- | --- | --- |")
    for title, dataset in datasets(data).items():
        levels = {"earth": (5, 7), "jacksboro": (9, 11), "maui": (10, 12)}[dataset["name"]]
        for level in levels:
            for suffix in (".terrain", ".glb"):
                count, size, memory, build, build99, build_cpu, found, found99, cpu, redis_cpu = measure(binary, dataset, level, suffix)
                print(f"| {count} of {title}, level {level}, {suffix} | {size:.1f} | {memory:.1f} | {build:.1f}, {build99:.1f}, {build_cpu:.1f} | "
                      f"{found:.2f}, {found99:.2f}, {cpu:.2f}, {redis_cpu:.3f} | {build / found:.0f} |", flush=True)


if __name__ == "__main__":
    main()
