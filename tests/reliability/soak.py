#!/usr/bin/env python3
"""Row 33: mixed traffic on a server in a small cgroup. Every request has a list of allowed replies.

    tests/reliability/soak.py [--binary FILE] [--seconds N] [--clients N] [--samples FILE]

--samples writes the measurements, one every few seconds, as JSON for tools/plot_soak.py.
"""
import argparse
import collections
import dataclasses
import json
import pathlib
import random
import socket
import struct
import sys
import threading
import time

from server import MemoryGroup, Server, get, read_reply

MIB = 1 << 20
CGROUP_BYTES = 512 * MIB
CACHES = {"--cache-bytes": 16, "--refinement-cache-bytes": 32, "--gdal-cache-bytes": 32, "--transfer-bytes": 32}  # MiB
BOUND_MB = sum(CACHES.values()) + 128
PAUSE_S = 0.02  # of a client between two requests
CODINGS = ("", "Accept-Encoding: gzip\r\n", "Accept-Encoding: br\r\n", "Accept-Encoding: zstd\r\n")
NORMALS = "Accept: application/vnd.quantized-mesh;extensions=octvertexnormals\r\n"
MESH = {200}


@dataclasses.dataclass(frozen=True)
class Ask:
    """One request and its allowed replies."""
    kind: str
    message: bytes
    expected: frozenset
    head: bool = False  # the reply has no body, whatever its Content-Length
    closes: bool = False  # the server ends the connection after the reply


def ask(kind, target, expected, fields="", **more):
    return Ask(kind, get(target, fields), frozenset(expected), **more)


class Client:
    """Draws random requests of one client, and keeps the ETags of its replies."""

    def __init__(self, seed):
        self.random, self.etags = random.Random(seed), {}

    def draw(self):
        kinds = {self.hot: 25, self.known: 10, self.cold: 25, self.glb: 15, self.image: 5, self.document: 5, self.heights: 5,
                 self.mesh: 2, self.wrong: 8}
        return self.random.choices(list(kinds), kinds.values())[0]()

    def hot_target(self):
        return f"/earth/4/{self.random.randrange(6)}/{self.random.randrange(6)}.terrain"

    def any_tile(self):
        if self.random.random() < 0.5:
            return f"/earth/5/{self.random.randrange(64)}/{self.random.randrange(32)}"
        return f"/jacksboro/12/{self.random.randrange(2176, 2182)}/{self.random.randrange(2871, 2877)}"

    def fraction(self):
        return f"fraction={2 ** self.random.uniform(-4, 3):.4f}"

    def hot(self):
        return ask("hot tile", self.hot_target(), {200}, self.random.choice(CODINGS))

    def known(self):
        """Requests a tile that the client has: the same bytes have the same ETag, also if the tile left the cache and was built again."""
        target = self.hot_target()
        if target in self.etags:
            return ask("tile it has", target, {304}, f"If-None-Match: {self.etags[target]}\r\n")
        return ask("tile with its ETag", target, {200})

    def cold(self):
        target = f"{self.any_tile()}.terrain?{self.fraction()}"
        return ask("tile", target, {200}, self.random.choice(CODINGS) + self.random.choice(("", NORMALS)))

    def glb(self):
        form = self.random.choice(("draco", "none", "quantized", "meshopt"))
        return ask("glb", f"{self.any_tile()}.glb?{self.fraction()}&compression={form}", {200})

    def image(self):
        encoding = self.random.choice(("mapbox", "terrarium"))
        return ask("png", f"/earth/4/{self.random.randrange(16)}/{self.random.randrange(16)}.png?encoding={encoding}", {200})

    def document(self):
        return ask("document", self.random.choice(("/earth/layer.json", "/earth/tileset.json", "/jacksboro/tiles.json", "/datasets", "/readyz",
                                                   "/livez", "/metrics")), {200}, self.random.choice(CODINGS))

    def heights(self):
        points = "|".join(f"{self.random.uniform(36.0, 36.9):.4f},{self.random.uniform(-84.9, -84.0):.4f}" for _ in range(self.random.choice((1, 10, 300))))
        if self.random.random() < 0.3:
            body = json.dumps({"locations": points}).encode()
            message = b"POST /jacksboro/heights HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n" \
                      b"Content-Length: %d\r\n\r\n%b" % (len(body), body)
            return Ask("heights by POST", message, frozenset({200}))
        return ask("heights", f"/jacksboro/heights?locations={points.replace('|', '%7C')}", {200})

    def mesh(self):
        west, south = self.random.uniform(-84.4, -84.2), self.random.uniform(36.17, 36.33)
        error, form = self.random.choice((5, 20, 50)), self.random.choice(("glb", "obj", "ply"))
        return ask("mesh", f"/jacksboro/mesh?bbox={west:.3f},{south:.3f},{west + 0.1:.3f},{south + 0.1:.3f}&error={error}&format={form}", MESH)

    def wrong(self):
        kind, message, status, closes = self.random.choice((
            ("no such dataset", get("/nowhere/0/0/0.terrain"), 404, False),
            ("no such tile", get("/earth/0/9/0.terrain"), 404, False),
            ("no such page", get("/viewer/nothing"), 404, False),
            ("error is no number", get("/earth/0/0/0.terrain?error=x"), 400, False),
            ("unknown parameter", get("/earth/0/0/0.terrain?colour=red"), 400, False),
            ("point out of range", get("/earth/heights?locations=91,0"), 400, False),
            ("area too large", get("/earth/mesh?bbox=-180,-90,180,90&error=0.001"), 400, False),
            ("other method", b"DELETE /earth/0/0/0.terrain HTTP/1.1\r\nHost: x\r\n\r\n", 405, True),
            ("long target", get("/earth/" + "a" * 9000), 414, True),
            ("long head", get("/livez", "A: " + "a" * 20000 + "\r\n"), 431, True),
            ("not HTTP", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\r\n\r\n", 400, True),
            ("smuggled body", get("/livez", "Transfer-Encoding: gzip\r\n"), 400, True)))
        return Ask(kind, message, frozenset({status}), closes=closes)


class Pauses:
    """Detects when the whole test was stopped from outside (a debugger, a suspended machine). Waits during that time do not count."""

    def __init__(self, end):
        self.last, self.seconds = 0.0, 0.0  # when the last one ended; all together
        self.thread = threading.Thread(target=self.watch, args=(end,))
        self.thread.start()

    def watch(self, end):
        seen = time.monotonic()
        while seen < end:
            time.sleep(0.2)
            now = time.monotonic()
            if now - seen > 5:
                self.last, self.seconds = now, self.seconds + now - seen
            seen = now

    def since(self, moment):
        time.sleep(0.5)  # gives the watching thread time to look
        return self.last >= moment


class Tally:
    def __init__(self, end):
        self.pauses = Pauses(end)
        self.lock, self.statuses, self.unexpected, self.aborted = threading.Lock(), collections.Counter(), collections.Counter(), 0
        self.kinds = collections.defaultdict(collections.Counter)

    def count(self, asked, outcome, begun):
        if outcome not in asked.expected and self.pauses.since(begun):
            outcome = f"{outcome} as all was stopped"
            asked = dataclasses.replace(asked, expected=frozenset({outcome}))
        with self.lock:
            self.statuses[outcome] += 1
            self.kinds[asked.kind][outcome] += 1
            if outcome not in asked.expected:
                self.unexpected[f"{outcome} for {asked.kind}: {asked.message[:120]!r}"] += 1


def converse(server, client, tally, leaves, end):
    """Sends requests on one connection until the server closes it or the client stops; with `leaves` the client resets it during a reply."""
    with server.connect(60) as connection:
        for _ in range(200):
            if time.monotonic() > end:
                return
            asked, begun = client.draw(), time.monotonic()
            connection.sendall(asked.message)
            if leaves and client.random.random() < 0.03:
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                with tally.lock:
                    tally.aborted += 1
                return
            try:
                reply = read_reply(connection)
            except OSError as error:
                tally.count(asked, type(error).__name__, begun)
                return
            if reply is None:
                tally.count(asked, "closed without a reply", begun)
                return
            status, fields = reply[:2]
            tally.count(asked, f"{status} + Retry-After" if status == 503 and "retry-after" in fields else status, begun)
            if asked.kind == "tile with its ETag" and status == 200:
                client.etags[asked.message.split()[1].decode()] = fields["etag"]
            if asked.closes:
                return
            time.sleep(PAUSE_S)


def soak(binary, seconds, clients=6, period=None):
    """(samples, tally, text about the cgroup); a sample has the seconds since the start, then MB."""
    period = period or min(5, seconds / 60)
    flags = [part for flag, size in CACHES.items() for part in (flag, f"{size}MiB")]
    samples, group = [], MemoryGroup(CGROUP_BYTES)
    with group, Server(binary, *flags, prefix=group.prefix) as server:
        begun = time.monotonic()
        end = begun + seconds
        tally = Tally(end)

        def run(seed):
            client = Client(seed)
            while time.monotonic() < end:
                try:
                    converse(server, client, tally, seed % 2 == 1, end)
                except OSError as error:  # no connection, or it was closed before a request was sent
                    with tally.lock:
                        tally.unexpected[f"{type(error).__name__} of a connection"] += 1
                    time.sleep(0.1)

        threads = [threading.Thread(target=run, args=(seed,)) for seed in range(clients)]
        for thread in threads:
            thread.start()
        while time.monotonic() < end:
            now = time.monotonic() - begun
            samples.append({"seconds": round(now, 1), "rss": round(server.resident_kib() / 1024, 2), "requests": sum(tally.statuses.values())} | group.usage_mb())
            time.sleep(period)
        for thread in threads:
            thread.join()
        alive = server.process.poll() is None
    if not alive:
        tally.unexpected["the server ended"] += 1
    return samples, tally, group.words


def middle_and_end(samples, key):
    """Medians of the third and the last fifth of the run."""
    values, fifth = [sample[key] for sample in samples], len(samples) // 5
    return [sorted(part)[len(part) // 2] for part in (values[2 * fifth:3 * fifth], values[-fifth:])]


def told(seconds, samples, tally, words):
    middle, last = middle_and_end(samples, "rss")
    most = max(sample["rss"] for sample in samples)
    group = f", group at most {max(sample['used'] for sample in samples):.0f} MB" if "used" in samples[0] else ""
    statuses = ", ".join(f"{count:,} x {status}" for status, count in sorted(tally.statuses.items(), key=lambda item: -item[1]))
    wrong = f"; UNEXPECTED {dict(tally.unexpected.most_common(5))}" if tally.unexpected else ", 0 unexpected"
    paused = f" ({tally.pauses.seconds:.0f} s of them stopped from outside)" if tally.pauses.seconds else ""
    return f"{seconds} s{paused}, {sum(tally.statuses.values()):,} requests ({statuses}{wrong}), {tally.aborted} left in mid-reply, {words}: RSS {most:.0f} MB at " \
           f"most (bound {BOUND_MB}), {middle:.1f} MB in the middle, {last:.1f} MB at the end{group}"


def kept(samples, tally, grown=1.0):
    middle, last = middle_and_end(samples, "rss")
    return not tally.unexpected and max(sample["rss"] for sample in samples) <= BOUND_MB and last - middle <= grown


def main():
    root = pathlib.Path(__file__).resolve().parents[2]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", type=pathlib.Path, default=root / "build/release/server/cli/terrace")
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--clients", type=int, default=6)
    parser.add_argument("--samples", type=pathlib.Path)
    arguments = parser.parse_args()
    samples, tally, words = soak(arguments.binary, arguments.seconds, arguments.clients)
    for kind, outcomes in sorted(tally.kinds.items()):
        print(f"{kind}: " + ", ".join(f"{count:,} x {outcome}" for outcome, count in outcomes.most_common()))
    if arguments.samples:
        arguments.samples.write_text(json.dumps({"limit_mb": CGROUP_BYTES / MIB, "bound_mb": BOUND_MB, "samples": samples}, indent=0) + "\n", encoding="utf-8")
    print(told(arguments.seconds, samples, tally, words))
    return 0 if kept(samples, tally) else 1


if __name__ == "__main__":
    sys.exit(main())
