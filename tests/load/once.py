#!/usr/bin/env python3
"""Requests every tile of a walk once, in its order, over several connections, and prints one line of JSON.

    tests/load/once.py http://HOST:PORT WALK_FILE CONNECTIONS

On a server without cached tiles every request is a build, so this measures building. The client is curl, because it takes less
processor time than one in Python.
"""
import json
import subprocess
import sys
import tempfile
import time
import urllib.parse


def percentile(ordered, share):
    return ordered[min(int(len(ordered) * share), len(ordered) - 1)]


def main():
    address, walk, connections = urllib.parse.urlsplit(sys.argv[1]).netloc, sys.argv[2], sys.argv[3]
    with open(walk, encoding="ascii") as file:
        paths = list(dict.fromkeys(file.read().split()))
    with tempfile.NamedTemporaryFile("w", suffix=".curl") as config:
        config.write("".join(f'url = "http://{address}{path}"\noutput = /dev/null\n' for path in paths))
        config.flush()
        started = time.perf_counter()
        client = subprocess.run(["curl", "--silent", "--show-error", "--no-progress-meter", "--parallel", "--parallel-max", connections,
                                 "--max-time", "600", "--header", "Accept-Encoding: gzip", "--config", config.name,
                                 "--write-out", "%{http_code} %{time_total} %{size_download}\n"],
                                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
        seconds = time.perf_counter() - started
    replies = [line.split() for line in client.stdout.splitlines()]
    latencies = sorted(float(time_total) for _, time_total, _ in replies)
    good = sum(1 for code, _, _ in replies if code == "200")
    if not latencies:
        sys.exit(f"once.py: curl ended with {client.returncode} and got nothing from {address}")
    print(json.dumps({"requests": len(latencies), "seconds": seconds, "bytes": sum(int(size) for _, _, size in replies),
                      "p50_ms": percentile(latencies, 0.5) * 1e3, "p99_ms": percentile(latencies, 0.99) * 1e3,
                      "errors": len(paths) - good}))


if __name__ == "__main__":
    main()
