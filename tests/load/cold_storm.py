#!/usr/bin/env python3
"""Requests many distinct cold tiles at once, to compare the server's rate with that of the pipeline.

    tests/load/cold_storm.py CONFIG DATASET LEVEL --box=WEST,SOUTH,EAST,NORTH
                             [--tiles 2000] [--connections 64] [--turns 3] [--build build/release]

The pipeline alone (terrace_cold_tiles) and a new server take turns with the same random tiles of the box, on the
same cores; the server's client runs there as well. Prints a Markdown table. The exit status is 1 if the server is slower than
85 % of the pipeline, fails a request, or takes more than 128 MB of memory beside its caches.
"""
import argparse
import json
import os
import pathlib
import random
import re
import resource
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
CACHES = {"--cache-bytes": 64, "--refinement-cache-bytes": 64, "--gdal-cache-bytes": 64}  # MiB
MOST_BYTES = sum(CACHES.values()) + 128  # MiB


def paths(dataset, level, box, count):
    west, south, east, north = box
    width = 180 / 2**level
    columns = range(int((west + 180) // width), int((east + 180) // width) + 1)
    rows = range(int((south + 90) // width), int((north + 90) // width) + 1)
    every = [f"/{dataset}/{level}/{x}/{y}.terrain" for x in columns for y in rows]
    if len(every) < count:
        sys.exit(f"cold_storm.py: level {level} has only {len(every)} tiles in this box; take a deeper one")
    return random.Random(1).sample(every, count)


def children_seconds():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def run_pipeline(arguments, walk):
    before = children_seconds()
    out = subprocess.run([arguments.build / "tests/bench/terrace_cold_tiles", arguments.config, arguments.dataset, walk], check=True,
                         stdout=subprocess.PIPE, text=True, stderr=subprocess.DEVNULL).stdout
    return json.loads(out) | {"cpu": children_seconds() - before}


def processor_seconds(pid):
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def run_server(arguments, walk):
    flags = [part for flag, size in CACHES.items() for part in (flag, f"{size}MiB")]
    server = subprocess.Popen([arguments.build / "server/cli/terrace", "serve", "--config", arguments.config, "--listen", "127.0.0.1:0",
                               "--log-level", "warn", "--access-log", "off", *flags], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        url = re.search(r"http://\S+", server.stdout.readline())[0]
        client = subprocess.run([HERE / "once.py", url, walk, str(arguments.connections)], check=True, stdout=subprocess.PIPE, text=True)
        own = processor_seconds(server.pid)
        peak = int(re.search(r"VmHWM:\s+(\d+)", pathlib.Path(f"/proc/{server.pid}/status").read_text())[1]) / 1024
    finally:
        server.terminate()
        server.wait(30)
        server.stdout.close()
    figures = json.loads(client.stdout)
    return figures | {"tiles": figures["requests"], "peak": peak, "cpu": own}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("config", type=pathlib.Path)
    parser.add_argument("dataset")
    parser.add_argument("level", type=int)
    parser.add_argument("--box", required=True, type=lambda text: [float(number) for number in text.split(",")])
    parser.add_argument("--tiles", type=int, default=2000)
    parser.add_argument("--connections", type=int, default=64)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--build", type=pathlib.Path, default=HERE.parents[1] / "build/release")
    arguments = parser.parse_args()
    runs = {"pipeline": [], "server": []}
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as walk, tempfile.TemporaryDirectory() as caches:
        os.environ["XDG_CACHE_HOME"] = caches  # not the user's home
        walk.write("\n".join(paths(arguments.dataset, arguments.level, arguments.box, arguments.tiles)) + "\n")
        walk.flush()
        for _ in range(arguments.turns):
            runs["pipeline"].append(run_pipeline(arguments, walk.name))
            runs["server"].append(run_server(arguments, walk.name))
    print(f"{arguments.tiles:,} tiles of {arguments.dataset}, level {arguments.level}, {arguments.connections} connections, {os.cpu_count()} processors, "
          f"{arguments.turns} turns\n")
    print("| | tiles/s, best | median | processor ms a tile, least | errors | most memory, MB |\n|---|---|---|---|---|---|")
    speeds, errors = {}, 0
    peak = max(run["peak"] for run in runs["server"])
    for name, turns in runs.items():
        speeds[name] = [run["tiles"] / run["seconds"] for run in turns]
        errors += sum(run["errors"] for run in turns)
        print(f"| {name} | {max(speeds[name]):.1f} | {statistics.median(speeds[name]):.1f} | {min(run['cpu'] / run['tiles'] for run in turns) * 1e3:.2f} | "
              f"{sum(run['errors'] for run in turns)} | {f'{peak:.0f}' if name == 'server' else ''} |")
    share = max(speeds["server"]) / max(speeds["pipeline"])
    print(f"\nThe server makes {share:.0%} of the pipeline's tiles, {statistics.median(speeds['server']) / statistics.median(speeds['pipeline']):.0%} by the "
          f"medians; memory {peak:.0f} of {MOST_BYTES} MB")
    return 0 if share >= 0.85 and errors == 0 and peak <= MOST_BYTES else 1


if __name__ == "__main__":
    sys.exit(main())
