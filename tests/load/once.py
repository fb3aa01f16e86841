#!/usr/bin/env python3
"""Asks for every tile of a walk once, in its order, over several connections, and prints one line of JSON.

    tests/load/once.py http://HOST:PORT WALK_FILE CONNECTIONS

On a server that has built nothing, every request is a build: what is measured is the making of tiles.
"""
import http.client
import json
import sys
import threading
import time
import urllib.parse


def percentile(ordered, share):
    return ordered[min(int(len(ordered) * share), len(ordered) - 1)]


def main():
    address, walk, connections = urllib.parse.urlsplit(sys.argv[1]).netloc, sys.argv[2], int(sys.argv[3])
    with open(walk, encoding="ascii") as file:
        paths = iter(list(dict.fromkeys(file.read().split())))
    lock = threading.Lock()
    latencies, sizes, errors = [], [], []

    def ask():
        connection = http.client.HTTPConnection(address, timeout=60)
        while True:
            with lock:
                path = next(paths, None)
            if path is None:
                return
            started = time.perf_counter()
            try:
                connection.request("GET", path, headers={"Accept-Encoding": "gzip"})
                reply = connection.getresponse()
                size = len(reply.read())
                if reply.status != 200:
                    errors.append(path)
            except (OSError, http.client.HTTPException):
                connection.close()
                errors.append(path)
                size = 0
            latencies.append(time.perf_counter() - started)
            sizes.append(size)

    started = time.perf_counter()
    threads = [threading.Thread(target=ask) for _ in range(connections)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    seconds = time.perf_counter() - started
    latencies.sort()
    print(json.dumps({"requests": len(latencies), "seconds": seconds, "bytes": sum(sizes), "p50_ms": percentile(latencies, 0.5) * 1e3,
                      "p99_ms": percentile(latencies, 0.99) * 1e3, "errors": len(errors)}))


if __name__ == "__main__":
    main()
