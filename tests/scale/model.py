"""A discrete simulation of nodes behind a ring: who has a tile, who builds it, how long a request waits.

Requests come in the order of their times. A node has workers, a queue in the order of arrival, and a memory cache; a request
for a tile that is being built waits for that build. Because of the order, no event list is needed: the state of a node is when its
workers are free, and since when each of its tiles is there.
"""
import bisect
import collections
import heapq
import math
import random
import zlib

POINTS = 160  # of each node on the ring, as nginx has


class Ring:
    def __init__(self, nodes):
        self.points = sorted((zlib.crc32(f"node-{node}-{i}".encode()) * 2654435761 % 2**32, node) for node in nodes for i in range(POINTS))
        self.places = [point for point, _ in self.points]

    def node_of(self, key):
        at = bisect.bisect_left(self.places, zlib.crc32(repr(key).encode()) * 2654435761 % 2**32)
        return self.points[at % len(self.points)][1]


class Balancer:
    """Any node, as a balancer gives that does not look at the URL."""

    def __init__(self, nodes, chance):
        self.nodes, self.chance = list(nodes), chance

    def node_of(self, _):
        return self.chance.choice(self.nodes)


class Node:
    """`capacity`: tiles in memory, least recently used first out; tiles on disk are not limited, as a week's tiles fit."""

    def __init__(self, workers, capacity, times, chance, has_disk=False):
        self.free = [0.0] * workers
        self.capacity, self.times, self.chance, self.has_disk = capacity, times, chance, has_disk
        self.tiles, self.disk, self.flights = collections.OrderedDict(), set(), {}

    def serve(self, now, key):
        """(seconds until the reply, what was done)"""
        if key in self.tiles:
            self.tiles.move_to_end(key)
            ready = self.tiles[key]
            return (self.times.hit, "hit") if ready <= now else (ready - now + self.times.hit, "joined")
        from_disk = key in self.disk
        work = self.times.disk if from_disk else self.times.build(self.chance)
        start = max(now, heapq.heappop(self.free))
        heapq.heappush(self.free, start + work)
        self.tiles[key] = start + work
        if self.has_disk:
            self.disk.add(key)
        if len(self.tiles) > self.capacity:
            self.tiles.popitem(last=False)
        return start + work - now + self.times.hit, "disk" if from_disk else "build"


class Times:
    """Measured service times in seconds. `builds`: a sample of builds."""

    def __init__(self, measured):
        self.hit, self.disk, self.builds = measured["hit_s"], measured["disk_s"], measured["builds_s"]

    def build(self, chance):
        return chance.choice(self.builds)


class Fleet:
    """Changes are a list of (time, function of the fleet), in their order."""

    def __init__(self, count, workers, capacity, times, seed=1, has_disk=False, has_ring=True):
        self.chance = random.Random(seed)
        self.make = lambda: Node(workers, capacity, times, self.chance, has_disk)
        self.nodes = {i: self.make() for i in range(count)}
        self.versions = dict.fromkeys(self.nodes, 0)
        self.ring = Ring(self.nodes) if has_ring else Balancer(self.nodes, self.chance)

    def lose(self, node):
        del self.nodes[node], self.versions[node]
        self.ring = Ring(self.nodes)

    def add(self, node, version=0):
        self.nodes[node], self.versions[node] = self.make(), version
        self.ring = Ring(self.nodes)

    def change_data(self, node):
        """Tiles of the old version are not found any more."""
        self.nodes[node], self.versions[node] = self.make(), self.versions[node] + 1

    def run(self, requests, changes=()):
        """Yields (time, seconds, what, node) for each (time, key)."""
        pending = collections.deque(changes)
        for now, key in requests:
            while pending and pending[0][0] <= now:
                pending.popleft()[1](self)
            node = self.ring.node_of(key)
            seconds, what = self.nodes[node].serve(now, key)
            yield now, seconds, what, node


def zipf(rate, seconds, places, seed=1, levels=12):
    """Viewers that look at one of `places`, the k-th with a weight of 1/k, and ask for the tiles on the way down to it."""
    chance = random.Random(seed)
    spots = [(chance.random(), chance.random()) for _ in range(places)]
    weights = list(_running(1 / (k + 1) for k in range(places)))
    now = 0.0
    while True:
        u, v = spots[bisect.bisect(weights, chance.random() * weights[-1])]
        level = chance.randrange(levels + 1)
        x, y = int(u * 2 ** (level + 1)), int(v * 2 ** level)
        now += chance.expovariate(rate)
        if now >= seconds:
            return
        yield now, (level, x ^ chance.randrange(2), y ^ chance.randrange(2) if level else 0)


def flights(rate, seconds, viewers, seed=1, level=12, speed=2.0):
    """Viewers that fly straight on over the ground; each request is a tile ahead, or one of its ancestors."""
    chance = random.Random(seed)
    side = 2 ** level
    craft = [[chance.random() * 2 * side, chance.random() * side, chance.random() * 2 * math.pi] for _ in range(viewers)]
    now = 0.0
    while True:
        now += chance.expovariate(rate)
        if now >= seconds:
            return
        one = craft[chance.randrange(viewers)]
        one[0] = (one[0] + speed * math.cos(one[2]) * viewers / rate) % (2 * side)
        one[1] = (one[1] + speed * math.sin(one[2]) * viewers / rate) % side
        up = min(int(chance.expovariate(1)), level)
        ahead = chance.randrange(-2, 3), chance.randrange(-2, 3)
        x, y = (int(one[0]) >> up) + ahead[0], (int(one[1]) >> up) + ahead[1]
        yield now, (level - up, x % (2 * side >> up), y % max(side >> up, 1))


def mixed(rate, seconds, places=3000, viewers=200, share=0.5, seed=1):
    """Both kinds of traffic, merged by time."""
    return heapq.merge(zipf(rate * share, seconds, places, seed), flights(rate * (1 - share), seconds, viewers, seed + 1))


def _running(values):
    total = 0.0
    for value in values:
        total += value
        yield total


def percentile(values, share):
    ordered = sorted(values)
    return ordered[min(int(len(ordered) * share), len(ordered) - 1)] if ordered else 0.0


def by_second(replies, step=1.0):
    """[(time, requests, hit ratio, p99 seconds, builds a second)] for each step."""
    bins = collections.defaultdict(list)
    for now, seconds, what, _ in replies:
        bins[int(now / step)].append((seconds, what))
    rows = []
    for at, found in sorted(bins.items()):
        builds = sum(what == "build" for _, what in found)
        rows.append((at * step, len(found), 1 - builds / len(found), percentile([s for s, _ in found], 0.99), builds / step))
    return rows
