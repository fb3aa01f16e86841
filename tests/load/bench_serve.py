#!/usr/bin/env python3
"""Measures the time of tiles end to end, by level and by stage: `make bench-serve`.

    tests/load/bench_serve.py [--data FOLDER] [--only NAME,...] [--raster FILE] [--tiles N] [--rounds N] BINARY [BINARY...]

Each BINARY serves each dataset with one worker, without caches, and gets requests for the same tiles of each level, one
after the other. Binaries take turns within each round, so that other load on the machine affects all of them. The output for each
level is the processor time of a cold tile in the best and in the median round, the ratio of the best to that of the first binary, and
the means of the last binary's stages on the clock; if nothing else runs, these add up to the time of a tile without HTTP. Before the
levels it has the processor time of the first start and of a start with cached statistics; after them, the peak memory and the processor
time of a warm tile (another error of a refinement in the cache).

The dataset "cog" is a Cloud Optimized GeoTIFF with averages as overviews, read by range requests from a server on this machine; its
request and bytes a tile are printed too.

`--peer COMMAND` also runs a shell command in each round, which must write the same levels of the same source to
{folder}/{z}/{x}/{y}; {source}, {first} and {last} are replaced too. The output then has its processor time a tile as well.
"""
import argparse
import contextlib
import http.client
import json
import os
import pathlib
import platform
import random
import re
import resource
import shlex
import socket
import statistics
import subprocess
import sys
import tempfile
import time

from range_server import RangeServer

ROOT = pathlib.Path(__file__).resolve().parents[2]
MAUI = [f"srtm1_{name}.tif" for name in ("N20W157_maui_se_haleakala", "N20W158_maui_sw", "N21W157_maui_ne_molokai", "N21W158_maui_nw_molokai")]
DATASETS = {  # name: sources, levels
    "geographic": (MAUI[:1], range(8, 15)),
    "projected": (["bigtujunga_30m_utm11.tif"], range(9, 14)),
    "mosaic": ([*MAUI, "etopo5_global_10min.tif"], range(8, 15)),
    "lidar": (["lidar_greenriver_1m.tif"], range(14, 19)),
    "cog": (MAUI[:1], range(8, 15)),
}
STAGES = ("read", "refine", "encode", "compress")


def processor():
    try:
        return re.search(r"model name\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text())[1]
    except (OSError, TypeError):
        return platform.processor()


class Server:
    def __init__(self, binary, sources, cache_dir, flags=()):
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]
        with tempfile.NamedTemporaryFile("w", suffix=".json") as config:
            prefixes = [str(source).rpartition("/")[0] + "/" for source in sources if str(source).startswith("/vsicurl/")]
            json.dump({"allowed_prefixes": prefixes, "datasets": [{"name": "d", "sources": [str(source) for source in sources]}]}, config)
            config.flush()
            self.process = subprocess.Popen(
                [binary, "serve", "--config", config.name, "--listen", f"127.0.0.1:{self.port}", "--io-threads", "1", "--worker-threads", "1",
                 "--cache-bytes", "0", "--cache-dir", cache_dir, "--log-level", "error", "--access-log", "off", *flags],
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            while not self.is_ready():
                if self.process.poll() is not None:
                    raise SystemExit(f"bench_serve.py: {binary} does not start; run it by hand on {sources[0]}")
                time.sleep(0.05)
        self.start_seconds = self.cpu_ms() / 1000
        self.connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=600)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()

    def is_ready(self):
        try:
            connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=5)
            connection.request("GET", "/readyz")
            return connection.getresponse().status == 200
        except OSError:
            return False

    def cpu_ms(self):
        # The process's clock: clock_getcpuclockid(3). It has the time of threads that have ended, too.
        return time.clock_gettime_ns(~self.process.pid << 3 | 2) / 1e6

    def peak_mb(self):
        return int(re.search(r"VmHWM:\s+(\d+)", pathlib.Path(f"/proc/{self.process.pid}/status").read_text())[1]) / 1024

    def get(self, url):
        self.connection.request("GET", url, headers={"Accept-Encoding": "gzip"})
        reply = self.connection.getresponse()
        body = reply.read()
        if reply.status != 200:
            raise SystemExit(f"bench_serve.py: {url}: {reply.status} {body[:200]}")
        return reply

    def layer(self):
        self.connection.request("GET", "/d/layer.json")
        return json.loads(self.connection.getresponse().read())

    def take(self, urls):
        """Processor milliseconds a tile, and {stage: [milliseconds]}."""
        stages, before = {name: [] for name in STAGES}, self.cpu_ms()
        for url in urls:
            said = self.get(url).headers.get("Server-Timing", "")
            for name, duration in re.findall(r"(\w+);dur=([\d.]+)", said):
                stages.setdefault(name, []).append(float(duration))
        return (self.cpu_ms() - before) / len(urls), stages


def draw(ranges, count):
    """The same tiles on every run."""
    columns = [(x, r["startY"], r["endY"]) for r in ranges for x in range(r["startX"], min(r["endX"], r["startX"] + 400) + 1)]
    tiles = [(x, y) for x, south, north in columns for y in range(south, min(north, south + 400) + 1)]
    random.Random(7).shuffle(tiles)
    return tiles[:count]


def run_peer(command, sources, level):
    with tempfile.TemporaryDirectory() as folder:
        filled = command.replace("{folder}", shlex.quote(folder)).replace("{source}", shlex.quote(str(sources[0])))
        filled = filled.replace("{first}", str(level)).replace("{last}", str(level))
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(filled, shell=True, check=True, stdout=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        tiles = sum(1 for path in pathlib.Path(folder).rglob("*") if path.is_file())
    return 1000 * (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / max(tiles, 1)


def bench(name, sources, levels, arguments):
    print(f"\n{name}: {', '.join(source.name for source in sources)}")
    with contextlib.ExitStack() as around:
        scratch = around.enter_context(tempfile.TemporaryDirectory())
        remote = None
        if name == "cog":
            remote = around.enter_context(RangeServer(scratch))
            subprocess.run(["gdal_translate", "-q", "-of", "COG", "-co", "COMPRESS=DEFLATE", "-co", "RESAMPLING=AVERAGE", str(sources[0]), f"{scratch}/cog.tif"], check=True)
            sources = [f"/vsicurl/{remote.url}cog.tif"]
        caches = [f"{scratch}/{k}" for k in range(len(arguments.binaries))]
        for binary, cache in zip(arguments.binaries, caches):
            with Server(binary, sources, cache) as server:
                print(f"  {binary}: first start {server.start_seconds:.2f} s of a processor", end="")
            with Server(binary, sources, cache) as server:
                print(f", with statistics kept {server.start_seconds:.2f} s")
        with contextlib.ExitStack() as stack:
            servers = [stack.enter_context(Server(binary, sources, cache, ("--refinement-cache-bytes", "0")))
                       for binary, cache in zip(arguments.binaries, caches)]
            available = servers[0].layer()["available"]
            tiles = {level: draw(available[level], arguments.tiles) for level in levels if level < len(available) and available[level]}
            print("  | level | tiles | ms a cold tile: best / median of each | ratios | stages of the last |" + (" peer |" if arguments.peer else ""))
            for level in tiles:
                before = (remote.requests, remote.bytes) if remote else None
                cold_level(servers, level, tiles[level], sources, arguments)
                if remote:
                    builds = len(tiles[level]) * len(servers) * (arguments.rounds + 1)
                    print(f"    {(remote.requests - before[0]) / builds:.2f} requests and {(remote.bytes - before[1]) / builds / 1000:.1f} KB a tile")
            print("  peak memory: " + ", ".join(f"{server.peak_mb():.0f} MB" for server in servers))
        with contextlib.ExitStack() as stack:
            servers = [stack.enter_context(Server(binary, sources, cache)) for binary, cache in zip(arguments.binaries, caches)]
            print("  ms a warm tile: " + warm_tiles(servers, tiles, arguments.rounds))


def rounds_of(servers, urls_of, rounds):
    """Runs servers in turns: ([[milliseconds a tile by round] by server], stages of the last). Round 0 does not count."""
    times, stages = [[] for _ in servers], {}
    for turn in range(rounds + 1):
        for server, of_server in zip(servers, times):
            cost, stages = server.take(urls_of(turn))
            if turn > 0:
                of_server.append(cost)
    return times, stages


def cold_level(servers, level, tiles, sources, arguments):
    urls = [f"/d/{level}/{x}/{y}.terrain?extensions=octvertexnormals" for x, y in tiles]
    times, stages = rounds_of(servers, lambda _: urls, arguments.rounds)
    cold = ", ".join(f"{min(t):.2f} / {statistics.median(t):.2f}" for t in times)
    ratios = ", ".join(f"{min(t) / min(times[0]):.2f}" for t in times)
    means = ", ".join(f"{stage} {statistics.mean(stages[stage]):.2f}" for stage in STAGES if stages[stage])
    peer = f" {min(run_peer(arguments.peer, sources, level) for _ in range(arguments.rounds)):.2f} |" if arguments.peer else ""
    print(f"  | {level} | {len(tiles)} | {cold} | {ratios} | {means} |{peer}", flush=True)


def warm_tiles(servers, tiles, rounds):
    """Requests coarser errors of refinements that were made for a fine one."""
    keys = [f"{level}/{x}/{y}" for level, of_level in tiles.items() for x, y in of_level]
    times, _ = rounds_of(servers, lambda turn: [f"/d/{key}.terrain?fraction={0.25 * 2 ** (turn / 4):.6f}" for key in keys], rounds)
    return ", ".join(f"{min(t):.2f} / {statistics.median(t):.2f}" for t in times)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binaries", nargs="+", metavar="BINARY")
    parser.add_argument("--data", type=pathlib.Path, default=ROOT / "../shared/data", metavar="FOLDER")
    parser.add_argument("--only", default=",".join(DATASETS), help="names of datasets: " + ", ".join(DATASETS))
    parser.add_argument("--raster", type=pathlib.Path, metavar="FILE", help='1" raster in place of that of "geographic" and "cog"')
    parser.add_argument("--tiles", type=int, default=40, help="of each level")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--peer", help="see above")
    arguments = parser.parse_args()
    print(f"{processor()}, {os.cpu_count()} processors")
    missing = True
    for name in arguments.only.split(","):
        names, levels = DATASETS[name]
        if arguments.raster and names == MAUI[:1]:
            names = [str(arguments.raster.resolve())]
        sources = [(arguments.data / source).resolve() for source in names]
        if not all(source.exists() for source in sources):
            print(f"{name}: left out, {arguments.data} does not have {', '.join(names)}")
            continue
        missing = False
        bench(name, sources, levels, arguments)
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
