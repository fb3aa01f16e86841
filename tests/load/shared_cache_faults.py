#!/usr/bin/env python3
"""Measures what a fault of the shared cache costs clients: p50 and p99 with and without a shared cache, in turns.

    tests/load/shared_cache_faults.py BINARY SOURCE [ROUNDS]     SOURCE: a raster of 1" or finer

2,000 different tiles of the levels 11 to 13, four connections, one worker, no cache in memory, so that each request asks Redis and builds.
The fault happens in the middle; "after" are the last 900 requests. The default time-out. Prints a Markdown table; use a quiet machine.
"""
import asyncio
import json
import os
import pathlib
import random
import re
import signal
import statistics
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "scale"))
import cluster  # noqa: E402
from redis_process import Proxy, Redis  # noqa: E402

COUNT, CONNECTIONS = 2000, 4
WITHOUT = {"cache_bytes": 0, "refinement_cache_bytes": 0, "worker_threads": 1}


async def draw(node, targets, fault=None):
    """Milliseconds of each request, in the order of `targets`."""
    clients = [cluster.Client(node.port, is_tls=False) for _ in range(CONNECTIONS)]
    left, times = iter(enumerate(targets)), [0.0] * len(targets)

    async def request(client):
        for i, target in left:
            if fault and i == len(targets) // 2:
                await asyncio.to_thread(fault)
            begun = time.perf_counter()
            status, _, _ = await client.get(target)
            times[i] = (time.perf_counter() - begun) * 1000
            assert status == 200, (target, status)
    await asyncio.gather(*map(request, clients))
    for client in clients:
        client.close()
    return times


def flip(piece):
    middle = len(piece) // 2
    return piece[:middle] + bytes([piece[middle] ^ 255]) + piece[middle + 1:]


FAULTS = {  # name: options of Redis, what happens in the middle
    "none": ((), None),
    "killed": ((), lambda redis, proxy: redis.stop()),
    "frozen (SIGSTOP)": ((), lambda redis, proxy: redis.signal(signal.SIGSTOP)),
    "each reply a second late": ((), lambda redis, proxy: setattr(proxy, "delay", 1.0)),
    "flips a byte of each reply": ((), lambda redis, proxy: setattr(proxy, "change", flip)),
    "full (noeviction)": (("--maxmemory", "3mb", "--maxmemory-policy", "noeviction"), None),
}


def percentile(times, share):
    return sorted(times)[int(len(times) * share)]


def main():
    binary, source = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 3
    dataset = {"name": "d", "sources": [{"path": str(source), "nodata": 0}]}
    processor = re.search(r"model name\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text())
    print(f"{processor[1] if processor else 'unknown processor'}, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}\n")
    print("| Redis | p50, p99 without, ms | p50, p99 with, ms | largest | p99 after the fault | p99 with / without by round |\n|---|---|---|---|---|---|")
    with cluster.scratch() as folder:
        without = cluster.Node(binary, folder, [dataset], WITHOUT).start()
        available = json.loads(without.get("/d/layer.json"))["available"]
        targets = [f"/d/{level}/{x}/{y}.terrain" for level in (11, 12, 13) for part in available[level]
                   for x in range(part["startX"], part["endX"] + 1) for y in range(part["startY"], part["endY"] + 1)]
        targets = random.Random(3).sample(targets, COUNT)
        for name, (options, fault) in FAULTS.items():
            rows = []
            for _ in range(rounds):
                plain = asyncio.run(draw(without, targets))
                redis = Redis(folder, *options).start()
                proxy = Proxy(redis.port)
                tier = {"shared_cache": {"url": f"redis://127.0.0.1:{proxy.port}/0", "min_build_ms": 0}}
                node = cluster.Node(binary, folder, [dataset], WITHOUT | tier).start()
                times = asyncio.run(draw(node, targets, (lambda: fault(redis, proxy)) if fault else None))
                redis.signal(signal.SIGCONT) if redis.process.poll() is None else None
                node.stop()
                proxy.close()
                redis.stop()
                rows.append((percentile(plain, .5), percentile(plain, .99), percentile(times, .5), percentile(times, .99), max(times), percentile(times[-900:], .99)))
            middle = [statistics.median(column) for column in zip(*rows)]
            ratios = ", ".join(f"{row[3] / row[1]:.2f}" for row in rows)
            print(f"| {name} | {middle[0]:.1f}, {middle[1]:.1f} | {middle[2]:.1f}, {middle[3]:.1f} | {middle[4]:.1f} | {middle[5]:.1f} | {ratios} |", flush=True)
        without.stop()


if __name__ == "__main__":
    main()
